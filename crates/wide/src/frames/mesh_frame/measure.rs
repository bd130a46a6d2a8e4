//! Sums over the boxes of triangles in a frame.

use glam::{Vec3A, Vec4};

use super::sample::Edges;

/// Edges of four triangles: three components of either.
type Four = [[Vec4; 3]; 2];

/// Groups of four that are summed in `f32` before the sums are added in `f64`.
const RUN: usize = 16;

/// What the frame minimizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sum {
    /// Half of the surface areas of the boxes: least along walls and along parallel struts.
    Areas,
    /// Their volumes: least where struts that cross lie in planes across the axes, as diagonals of a lattice do. Their
    /// boxes are flat there, so those of neighbors lie in layers.
    Volumes,
}

/// Triangles to measure frames by, four lanes.
pub(super) struct Measure {
    triangles: Vec<Four>,
    sum: Sum,
}

impl Measure {
    /// Of these triangles; a last group is filled with points, which add nothing.
    pub(super) fn of(triangles: &[Edges], sum: Sum) -> Self {
        let four = |chunk: &[Edges]| {
            let lanes = |edge: usize, k: usize| {
                Vec4::from_array(std::array::from_fn(|lane| chunk.get(lane).map_or(0.0, |edges| edges[edge][k])))
            };
            [0, 1].map(|edge| [0, 1, 2].map(|k| lanes(edge, k)))
        };
        Self { triangles: triangles.chunks(4).map(four).collect(), sum }
    }

    /// The sum over the triangles' boxes along `rows`.
    pub(super) fn of_boxes(&self, rows: &[Vec3A; 3]) -> f64 {
        let rows = rows.map(|row| [Vec4::splat(row.x), Vec4::splat(row.y), Vec4::splat(row.z)]);
        let of_run = |run: &[Four]| run.iter().map(|edges| self.of_four(edges, &rows)).sum::<Vec4>();
        self.triangles.chunks(RUN).map(|run| f64::from(of_run(run).element_sum())).sum()
    }

    /// The same of four triangles.
    #[inline]
    fn of_four(&self, edges: &Four, rows: &[[Vec4; 3]; 3]) -> Vec4 {
        let [x, y, z] = rows.map(|row| {
            // The vertex that both edges start from projects to zero.
            let [a, b] = edges.map(|edge| edge[0] * row[0] + edge[1] * row[1] + edge[2] * row[2]);
            a.max(b).max(Vec4::ZERO) - a.min(b).min(Vec4::ZERO)
        });
        match self.sum {
            Sum::Areas => (x + z) * y + z * x,
            Sum::Volumes => x * y * z,
        }
    }
}
