//! Wide BVHs of presets.

use std::time::Instant;

use anyhow::Result;
use canted_obb::Obb;
use canted_scene::Scene;
use canted_wide::{NodeKind, Preset, TriangleBvh};

/// One preset on one level of BVHs.
#[derive(Clone, Copy, Default)]
pub(super) struct Row {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`].
    pub(super) nodes: [usize; NodeKind::ALL.len()],
    /// Predicted traversal cost if all nodes were aligned, for a ray that enters the root, in visits of aligned nodes; over
    /// several BVHs, the mean weighted by root area.
    pub(super) aligned_cost: f64,
    /// Predicted traversal cost of the BVHs as built.
    pub(super) cost: f64,
    /// BVHs whose mesh is rotated into a local frame.
    pub(super) n_rotated: usize,
    /// The largest angle of such a rotation.
    pub(super) max_angle_rad: f64,
    /// Memory of the nodes.
    pub(super) node_bytes: usize,
    /// Memory of the triangle blocks.
    pub(super) block_bytes: usize,
    /// Triangles of all BVHs.
    pub(super) n_triangles: usize,
    /// Nodes on the longest path from a root.
    pub(super) depth: u32,
    /// Milliseconds to build all BVHs from indexed triangles.
    pub(super) build_ms: f64,
    /// Sum of the root areas, the weights of the costs.
    pub(super) root_area: f64,
}

/// All presets on one level of BVHs.
pub(super) struct Level {
    pub(super) n_bvhs: usize,
    /// In the order of the command line.
    pub(super) rows: Vec<(Preset, Row)>,
}

/// All levels.
pub(super) struct WideStats {
    /// One BVH over all triangles in world space.
    pub(super) one: Level,
    /// One BVH per mesh.
    pub(super) bottom: Level,
}

impl Row {
    /// Nodes of all kinds.
    pub(super) fn n_nodes(&self) -> usize {
        self.nodes.iter().sum()
    }

    /// Fraction of nodes of one kind.
    pub(super) fn share(&self, kind: NodeKind) -> f64 {
        let of_kind = NodeKind::ALL.iter().zip(self.nodes).filter(|(each, _)| **each == kind).map(|(_, n)| n);
        of_kind.sum::<usize>() as f64 / (self.n_nodes() as f64).max(1.0)
    }

    /// Memory of nodes and blocks per triangle.
    pub(super) fn bytes_per_triangle(&self) -> f64 {
        (self.node_bytes + self.block_bytes) as f64 / (self.n_triangles as f64).max(1.0)
    }

    fn add(&mut self, wide: &TriangleBvh, area: f64, build_ms: f64) {
        let (sizes, predicted) = (wide.sizes(), wide.predicted());
        for (sum, n) in self.nodes.iter_mut().zip(sizes.nodes) {
            *sum += n;
        }
        self.aligned_cost += f64::from(predicted.aligned) * area;
        self.cost += f64::from(predicted.chosen) * area;
        if wide.frame() != Obb::IDENTITY_FRAME {
            self.n_rotated += 1;
            self.max_angle_rad = self.max_angle_rad.max(angle_rad(wide.frame()));
        }
        self.node_bytes += sizes.node_bytes;
        self.block_bytes += sizes.leaf_bytes;
        self.n_triangles += wide.n_primitives();
        self.depth = self.depth.max(sizes.depth);
        self.build_ms += build_ms;
        self.root_area += area;
    }
}

/// Builds the scene in one level and in two, with each preset.
pub(super) fn measure(scene: &Scene, presets: &[Preset]) -> Result<WideStats> {
    let empty = || Level { n_bvhs: 0, rows: presets.iter().map(|&preset| (preset, Row::default())).collect() };
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let mut one = empty();
    add_mesh(&mut one, &positions, &triangles, 1.0)?;
    let mut bottom = empty();
    for (i, mesh) in scene.meshes.iter().enumerate() {
        add_mesh(&mut bottom, &mesh.positions, &mesh.triangles, super::world_scale(scene, i))?;
    }
    for (_, row) in one.rows.iter_mut().chain(&mut bottom.rows) {
        // Without any area, the costs are zero.
        let area = row.root_area.max(f64::MIN_POSITIVE);
        row.aligned_cost /= area;
        row.cost /= area;
    }
    Ok(WideStats { one, bottom })
}

fn add_mesh(level: &mut Level, positions: &[[f32; 3]], triangles: &[[u32; 3]], world_scale: f64) -> Result<()> {
    level.n_bvhs += 1;
    for (preset, row) in &mut level.rows {
        let start = Instant::now();
        let wide = TriangleBvh::build_with(positions, triangles, *preset)?;
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        row.add(&wide, wide.bounds().area() * world_scale * world_scale, build_ms);
    }
    Ok(())
}

/// The smallest rotation angle between axis-aligned boxes and boxes in a frame of unit rows.
///
/// Boxes do not change when axes are permuted or reversed. Of the 24 rotations that give the same boxes, the one with the
/// greatest trace has the smallest angle.
fn angle_rad(rows: [[f32; 3]; 3]) -> f64 {
    const ORDERS: [([usize; 3], f64); 6] =
        [([0, 1, 2], 1.0), ([1, 2, 0], 1.0), ([2, 0, 1], 1.0), ([0, 2, 1], -1.0), ([2, 1, 0], -1.0), ([1, 0, 2], -1.0)];
    let entry = |row: usize, column: usize| f64::from(rows[row][column]);
    let cofactor = |a: usize, b: usize| entry(1, a) * entry(2, b) - entry(1, b) * entry(2, a);
    let determinant = entry(0, 0) * cofactor(1, 2) + entry(0, 1) * cofactor(2, 0) + entry(0, 2) * cofactor(0, 1);
    let traces = ORDERS.map(|(order, parity)| {
        let diagonal = [0, 1, 2].map(|row| entry(row, order[row]));
        let all: f64 = diagonal.iter().map(|x| x.abs()).sum();
        // If reversing axes to make the diagonal positive gives a reflection, the axis of least magnitude is not reversed.
        let is_rotation = diagonal.iter().fold(parity * determinant, |product, x| product * x) >= 0.0;
        let least = diagonal.iter().fold(f64::INFINITY, |least, x| least.min(x.abs()));
        if is_rotation { all } else { all - 2.0 * least }
    });
    let trace = traces.into_iter().fold(-1.0, f64::max);
    (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding three entries changes the cosine of an angle by at most 3/2 of a rounding error `e`. The angle changes by at
    /// most `sqrt(2 * 1.5 * e)`, for small angles.
    fn angle_error_rad() -> f64 {
        (2.0 * 1.5 * 0.5 * f64::from(f32::EPSILON)).sqrt()
    }

    #[test]
    fn a_rotation_about_an_axis_has_its_smallest_equivalent_angle() {
        for degrees in [0.0f64, 10.0, 30.0, 44.0, 46.0, 80.0, 135.0, 200.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let [sin, cos] = [sin, cos].map(rounded);
            let least = (degrees / 90.0 - (degrees / 90.0).round()).abs() * 90.0;
            for rows in [
                [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]],
                // The same axes permuted and reversed, right- and left-handed.
                [[0.0, 0.0, -1.0], [-sin, cos, 0.0], [cos, sin, 0.0]],
                [[-sin, cos, 0.0], [cos, sin, 0.0], [0.0, 0.0, 1.0]],
            ] {
                let angle = angle_rad(rows).to_degrees();
                let bound = angle_error_rad().to_degrees();
                assert!((angle - least).abs() <= bound, "{degrees}: {angle} is not {least}");
            }
        }
    }

    #[test]
    fn the_angle_is_the_smallest_of_all_24_rotations() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from((state >> 40) as u32) / f64::from(1 << 23) - 1.0
        };
        for _ in 0..200 {
            let q = canted_obb::Quaternion { w: random(), x: random(), y: random(), z: random() };
            let rows = rows_of(q);
            let expected = smallest_of_24(rows);
            let angle = angle_rad(rows.map(|row| row.map(rounded)));
            assert!((angle - expected).abs() <= angle_error_rad(), "{angle} is not {expected}");
        }
    }

    fn rounded(x: f64) -> f32 {
        x as f32
    }

    /// The rotation matrix of a quaternion of any length.
    fn rows_of(q: canted_obb::Quaternion) -> [[f64; 3]; 3] {
        let canted_obb::Quaternion { w, x, y, z } = q;
        let n = w * w + x * x + y * y + z * z;
        [
            [n - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), n - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), n - 2.0 * (x * x + y * y)],
        ]
        .map(|row| row.map(|entry| entry / n))
    }

    /// The smallest angle of the rotation after each rotation of a cube.
    fn smallest_of_24(rows: [[f64; 3]; 3]) -> f64 {
        let mut least = f64::INFINITY;
        for (a, b) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            for signs in 0..4u8 {
                let [mut u, mut v] = [[0.0; 3]; 2];
                u[a] = if signs & 1 == 0 { 1.0 } else { -1.0 };
                v[b] = if signs & 2 == 0 { 1.0 } else { -1.0 };
                let w = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
                let trace = dot(rows[0], u) + dot(rows[1], v) + dot(rows[2], w);
                least = least.min((0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos());
            }
        }
        least
    }
}
