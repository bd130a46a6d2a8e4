//! What the built-in scene is made with: instances, meshes of bars and blocks, noise and paints.

use std::f64::consts::{FRAC_PI_4, SQRT_2, TAU};

use canted_obb::Affine;
use canted_obb::vector::{Vector as Vec3, cross, normalized, sub, to_f32};

use crate::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene};

/// A scene under construction.
#[derive(Default)]
pub(super) struct SceneBuilder {
    pub(super) scene: Scene,
    n_placed: u32,
}

impl SceneBuilder {
    /// Adds a mesh without an instance.
    pub(super) fn mesh(&mut self, mesh: Mesh) -> MeshId {
        self.scene.meshes.push(mesh);
        MeshId(u32::try_from(self.scene.meshes.len() - 1).expect("few meshes"))
    }

    /// Adds an instance.
    pub(super) fn place(&mut self, mesh: MeshId, world_from_object: Affine) {
        self.scene.instances.push(Instance {
            mesh,
            world_from_object,
            world_from_object_close: None,
            first_primitive: self.n_placed,
        });
        let n_triangles = self.scene.meshes[mesh.0 as usize].triangles.len();
        self.n_placed += u32::try_from(n_triangles).expect("the scene is small");
    }
}

/// The affine transform with the given images of the axes and of the origin.
pub(super) fn affine(columns: [Vec3; 4]) -> Affine {
    Affine { columns: columns.map(to_f32) }
}

/// Scales per axis, rotates about y by `heading_rad` and translates to `position`.
pub(super) fn upright(position: Vec3, heading_rad: f64, scale: Vec3) -> Affine {
    tilted(position, [0.0, 1.0, 0.0], heading_rad, scale)
}

/// Scales per axis, rotates about y by `heading_rad`, tilts y to `upward` and translates to `position`.
///
/// `upward` is not parallel to z.
pub(super) fn tilted(position: Vec3, upward: Vec3, heading_rad: f64, scale: Vec3) -> Affine {
    let y = unit(upward);
    let x = unit(cross(y, [0.0, 0.0, 1.0]));
    let z = cross(x, y);
    let (sin, cos) = heading_rad.sin_cos();
    let mix = |a: f64, b: f64, by: f64| std::array::from_fn(|k| by * (a * x[k] + b * z[k]));
    affine([mix(cos, -sin, scale[0]), y.map(|c| c * scale[1]), mix(sin, cos, scale[2]), position])
}

/// A mesh under construction, object space, `f64`, y up.
#[derive(Default)]
pub(super) struct MeshBuilder {
    positions: Vec<Vec3>,
    faces: Vec<(Paint, [u32; 3])>,
}

impl MeshBuilder {
    /// Index of the vertex that will be added next.
    fn next_index(&self) -> u32 {
        u32::try_from(self.positions.len()).expect("the scene is small")
    }

    /// Adds a vertex and returns its index.
    pub(super) fn vertex(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        self.next_index() - 1
    }

    /// Adds a triangle of existing vertices.
    pub(super) fn triangle(&mut self, paint: Paint, corners: [u32; 3]) {
        self.faces.push((paint, corners));
    }

    /// Adds the quadrilateral `a b c d`, counter-clockwise seen from the front.
    pub(super) fn quad(&mut self, paint: Paint, [a, b, c, d]: [u32; 4]) {
        self.triangle(paint, [a, b, c]);
        self.triangle(paint, [a, c, d]);
    }

    /// Adds a frustum of `n_sides` without caps between two points; `widths` are diameters, 0 for a tip.
    pub(super) fn frustum(&mut self, paint: Paint, ends: [Vec3; 2], widths: [f64; 2], n_sides: u32) {
        let [u, v] = across(sub(ends[1], ends[0]));
        let first = self.next_index();
        for (end, width) in ends.into_iter().zip(widths) {
            for k in 0..n_sides {
                let (sin, cos) = (FRAC_PI_4 + TAU * f64::from(k) / f64::from(n_sides)).sin_cos();
                self.vertex(std::array::from_fn(|i| end[i] + 0.5 * width * (cos * u[i] + sin * v[i])));
            }
        }
        for k in 0..n_sides {
            let next = (k + 1) % n_sides;
            let [a, b, c, d] = [first + k, first + next, first + n_sides + next, first + n_sides + k];
            if widths[1] > 0.0 {
                self.quad(paint, [a, b, c, d]);
            } else {
                self.triangle(paint, [a, b, d]);
            }
        }
    }

    /// Adds a square bar of side `width` without caps: 8 triangles.
    pub(super) fn bar(&mut self, paint: Paint, from: Vec3, to: Vec3, width: f64) {
        self.frustum(paint, [from, to], [width * SQRT_2; 2], 4);
    }

    /// Adds a thin cable of three sides: 6 triangles.
    pub(super) fn cable(&mut self, paint: Paint, from: Vec3, to: Vec3, width: f64) {
        self.frustum(paint, [from, to], [width; 2], 3);
    }

    /// Adds an axis-parallel block: 12 triangles.
    pub(super) fn block(&mut self, paint: Paint, min: Vec3, max: Vec3) {
        let first = self.next_index();
        for corner in 0..8 {
            self.vertex(std::array::from_fn(|k| if corner >> k & 1 == 0 { min[k] } else { max[k] }));
        }
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        for side in sides {
            self.quad(paint, side.map(|corner| first + corner));
        }
    }

    /// Adds a lattice along `rings` of `N` corners: bars of width `chord` between rings, and of width `web` along each ring and
    /// along both diagonals of each face.
    pub(super) fn lattice<const N: usize>(
        &mut self,
        rings: &[[Vec3; N]],
        [chord, web]: [f64; 2],
        paint: impl Fn(usize) -> Paint,
    ) {
        for (bay, ends) in rings.windows(2).enumerate() {
            let paint = paint(bay);
            for corner in 0..N {
                let next = (corner + 1) % N;
                self.bar(paint, ends[0][corner], ends[1][corner], chord);
                self.bar(paint, ends[0][corner], ends[0][next], web);
                self.bar(paint, ends[0][corner], ends[1][next], web);
                self.bar(paint, ends[0][next], ends[1][corner], web);
            }
        }
    }

    /// The mesh, with triangles sorted by material.
    pub(super) fn finish(mut self, name: &str) -> Mesh {
        self.faces.sort_by_key(|&(paint, _)| paint);
        let mut parts: Vec<Part> = Vec::new();
        for (first_triangle, &(paint, _)) in (0..).zip(&self.faces) {
            if parts.last().is_none_or(|part| part.material != paint.material()) {
                parts.push(Part { first_triangle, material: paint.material() });
            }
        }
        Mesh {
            name: name.into(),
            positions: self.positions.iter().map(|p| p.map(|x| x as f32)).collect(),
            triangles: self.faces.into_iter().map(|(_, corners)| corners).collect(),
            parts,
            ..Mesh::default()
        }
    }
}

/// Rings of a straight square column: `n_bays + 1` of them, from half-width `half[0]` at the origin to `half[1]` at
/// `height` along y.
pub(super) fn square_rings(half: [f64; 2], height: f64, n_bays: u32) -> Vec<[Vec3; 4]> {
    let ring = |i: u32| {
        let fraction = f64::from(i) / f64::from(n_bays);
        let half = half[0] + (half[1] - half[0]) * fraction;
        [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, z]| [x, height * fraction, z])
    };
    (0..=n_bays).map(ring).collect()
}

/// Linear interpolation from `a` to `b`.
pub(super) fn lerp(a: Vec3, b: Vec3, fraction: f64) -> Vec3 {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * fraction)
}

/// `v` scaled to length 1.
pub(super) fn unit(v: Vec3) -> Vec3 {
    normalized(v).unwrap_or_default()
}

/// Two unit vectors that form a right-handed frame with `axis`; the first is horizontal.
fn across(axis: Vec3) -> [Vec3; 2] {
    let axis = unit(axis);
    let aside = if axis[1].abs() < 0.999 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
    let u = unit(cross(aside, axis));
    [u, cross(axis, u)]
}

/// A uniform random number in `[0, 1)` per cell, by integer arithmetic, identical on every platform.
pub(super) fn random(cell: [i32; 2], seed: u32) -> f64 {
    let [x, y] = cell.map(i32::cast_unsigned);
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    for multiplier in [0x7feb_352d, 0x846c_a68b] {
        h = (h ^ (h >> 16)).wrapping_mul(multiplier);
    }
    f64::from(h ^ (h >> 16)) / 4_294_967_296.0
}

/// Smooth value noise in `[-1, 1]` with lattice spacing 1 and the given period.
///
/// Source: Perlin, "Improving noise", 2002, for the quintic interpolation.
pub(super) fn noise(x: f64, y: f64, period: i32, seed: u32) -> f64 {
    let (cell_x, cell_y) = (x.floor(), y.floor());
    let [u, v] = [x - cell_x, y - cell_y].map(|f| f * f * f * (f * (f * 6.0 - 15.0) + 10.0));
    let at =
        |i: i32, j: i32| random([(cell_x as i32 + i).rem_euclid(period), (cell_y as i32 + j).rem_euclid(period)], seed);
    let near = at(0, 0) + (at(1, 0) - at(0, 0)) * u;
    let far = at(0, 1) + (at(1, 1) - at(0, 1)) * u;
    2.0 * (near + (far - near) * v) - 1.0
}

/// Five octaves of noise in `[-1, 1]`; the first has lattice spacing 1.
pub(super) fn hills(x: f64, y: f64, seed: u32) -> f64 {
    let octave = |i: u32| {
        let frequency = f64::from(1 << i);
        noise(frequency * x, frequency * y, 1 << 20, seed + i) / frequency
    };
    (0..5).map(octave).sum::<f64>() / 1.9375
}

/// Materials of the built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Paint {
    /// Girder and pylons.
    Steel,
    /// Stays, rails and guys.
    Cable,
    /// Piers, slabs, counterweights.
    Concrete,
    /// The road.
    Asphalt,
    /// Cranes.
    Yellow,
    /// Every other band of the masts.
    Red,
    /// The other bands, and the cabins.
    White,
    /// Tubes of the scaffolds.
    Zinc,
    /// Planks and trunks.
    Wood,
    /// Conifers.
    Needles,
    /// Broad-leaved trees in autumn.
    Leaves,
    /// Reeds at the shore.
    Reed,
    /// Tufts on the meadow.
    Meadow,
    /// The river.
    Water,
    /// Its banks.
    Sand,
    /// Meadows nearby.
    Grass,
    /// Steep ground.
    Rock,
    /// Hills beyond, paler with distance.
    Hills,
    /// Mountains at the horizon.
    Mountains,
    /// The farthest of them.
    Haze,
}

impl Paint {
    /// Name and linear reflectance of every paint, in the order of the variants.
    ///
    /// Hills, mountains and haze imitate aerial perspective.
    const ALL: [(Self, &str, [f32; 3]); 20] = [
        (Self::Steel, "orange steel", [0.78, 0.19, 0.035]),
        (Self::Cable, "cable", [0.82, 0.80, 0.74]),
        (Self::Concrete, "concrete", [0.62, 0.59, 0.53]),
        (Self::Asphalt, "asphalt", [0.10, 0.10, 0.11]),
        (Self::Yellow, "yellow steel", [0.86, 0.50, 0.04]),
        (Self::Red, "red steel", [0.68, 0.03, 0.025]),
        (Self::White, "white steel", [0.85, 0.85, 0.83]),
        (Self::Zinc, "zinc", [0.55, 0.57, 0.60]),
        (Self::Wood, "wood", [0.42, 0.25, 0.11]),
        (Self::Needles, "needles", [0.035, 0.085, 0.030]),
        (Self::Leaves, "leaves", [0.30, 0.15, 0.025]),
        (Self::Reed, "reed", [0.34, 0.29, 0.09]),
        (Self::Meadow, "meadow", [0.30, 0.31, 0.08]),
        (Self::Water, "water", [0.055, 0.165, 0.19]),
        (Self::Sand, "sand", [0.42, 0.33, 0.21]),
        (Self::Grass, "grass", [0.27, 0.265, 0.075]),
        (Self::Rock, "rock", [0.25, 0.22, 0.18]),
        (Self::Hills, "hills", [0.21, 0.24, 0.13]),
        (Self::Mountains, "mountains", [0.26, 0.33, 0.36]),
        (Self::Haze, "haze", [0.40, 0.49, 0.58]),
    ];

    /// The materials, one per paint.
    pub(super) fn materials() -> Vec<Material> {
        let material = |(_, name, base_color): (Self, &str, [f32; 3])| Material {
            name: name.into(),
            base_color,
            ..Material::default()
        };
        Self::ALL.map(material).into()
    }

    /// Index of the paint in [`Self::materials`].
    pub(super) fn material(self) -> MaterialId {
        MaterialId(self as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::Paint;

    #[test]
    fn paints_are_listed_in_order() {
        for (i, (paint, ..)) in Paint::ALL.iter().enumerate() {
            assert_eq!(paint.material().0 as usize, i);
        }
    }
}
