use std::f64::consts::{FRAC_PI_4, SQRT_2, TAU};

use canted_obb::vector::{Vector as Vec3, cross, length, sub};

use super::palette::Paint;
use crate::{Mesh, Part};

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
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how meshes are stored")]
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

/// `v` scaled to length 1 by division.
pub(super) fn unit(v: Vec3) -> Vec3 {
    let length = length(v);
    v.map(|x| x / length)
}

/// Two unit vectors that form a right-handed frame with `axis`; the first is horizontal.
fn across(axis: Vec3) -> [Vec3; 2] {
    let axis = unit(axis);
    let aside = if axis[1].abs() < 0.999 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
    let u = unit(cross(aside, axis));
    [u, cross(axis, u)]
}
