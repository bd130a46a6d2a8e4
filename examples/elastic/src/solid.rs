//! Closed meshes, and the lattice of phyxels inside of one.

use std::f64::consts::TAU;

use anyhow::{Result, ensure};
use canted_obb::Aabb;
use canted_wide::{Config, Preset, Triangle, WideBvh};

/// A triangle mesh, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertices, m.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// A torus around the point at `height` on the y axis, which rolls about z and is then tilted about x by an angle.
///
/// `n[0]` rings of `n[1]` vertices each; triangles are listed ring by ring.
#[must_use]
pub fn torus([major, minor]: [f64; 2], n: [u32; 2], height: f64, tilt_rad: f64) -> TriangleMesh {
    let angle = |i: u32, n: u32| (TAU * f64::from(i) / f64::from(n)).sin_cos();
    let (sin_tilt, cos_tilt) = tilt_rad.sin_cos();
    let vertex = |i: u32, j: u32| {
        let ((sin_i, cos_i), (sin_j, cos_j)) = (angle(i, n[0]), angle(j, n[1]));
        let from_axis = major + minor * cos_j;
        let [x, y, z] = [from_axis * cos_i, from_axis * sin_i, minor * sin_j];
        #[expect(clippy::cast_possible_truncation, reason = "rounds")]
        [x, height + cos_tilt * y - sin_tilt * z, sin_tilt * y + cos_tilt * z].map(|x| x as f32)
    };
    let rings = || (0..n[0]).flat_map(|i| (0..n[1]).map(move |j| (i, j)));
    let index = |i: u32, j: u32| (i % n[0]) * n[1] + j % n[1];
    let quad = |(i, j): (u32, u32)| {
        let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    TriangleMesh {
        positions: rings().map(|(i, j)| vertex(i, j)).collect(),
        triangles: rings().flat_map(quad).collect(),
    }
}

/// Centers of all cells of a cubic lattice that are inside of a closed mesh. The lattice starts at the least corner of its bounds.
///
/// # Errors
/// A spacing that is not above zero, or gives more than 2^24 cells; invalid geometry, by index.
pub fn lattice_inside(mesh: &TriangleMesh, spacing: f64) -> Result<Vec<[f32; 3]>> {
    const MAX_CELLS: f64 = (1 << 24) as f64;
    let bvh = WideBvh::<Triangle>::build(&mesh.positions, &mesh.triangles, &Config::preset(Preset::Fast))?;
    let bounds = Aabb::from_points(mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize]));
    let n = std::array::from_fn(|k| ((f64::from(bounds.max[k]) - f64::from(bounds.min[k])) / spacing).ceil());
    let [nx, ny, nz]: [f64; 3] = n;
    ensure!(spacing > 0.0 && nx * ny * nz <= MAX_CELLS, "spacing {spacing} m of phyxels: use a larger one");
    let counter = |n: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 2^24; 0 without triangles"
        )]
        let n = n as u32;
        0..n
    };
    let mut centers = Vec::new();
    for i in counter(nx) {
        for j in counter(ny) {
            for k in counter(nz) {
                let cell = [i, j, k].map(|i| (f64::from(i) + 0.5) * spacing);
                #[expect(clippy::cast_possible_truncation, reason = "rounds")]
                centers.push(std::array::from_fn(|k| (f64::from(bounds.min[k]) + cell[k]) as f32));
            }
        }
    }
    let mut inside = vec![false; centers.len()];
    bvh.par_contains_many(&centers, &mut inside);
    Ok(centers.into_iter().zip(inside).filter_map(|(center, is_inside)| is_inside.then_some(center)).collect())
}
