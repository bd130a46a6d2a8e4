//! Frames for a whole mesh: where the boxes of its triangles are small.
//!
//! Reads: triangles in any order. Writes: up to two different frames other than the axes of the space; none where no
//! direction dominates, or where the dominant ones are the axes. Holds: rows as everywhere in this stage; the same
//! for any number of threads; time that hardly grows with the mesh.
//!
//! Walls and parallel struts need axes along them, struts that cross along diagonals need axes that no strut runs
//! along. Sums over the boxes of single triangles find both: sums of areas the first, sums of volumes the second.
//! The sums find frames worth a try; only building a binary tree in a frame shows what it gains.

use canted_obb::dop;
use glam::{Vec3A, Vec4};

use super::vector::{frame, from_glam, to_glam, unit};

/// How a frame for the whole mesh is searched for.
///
/// Sums along the best axes, relative to those along the coordinate axes: rotated architecture 0.23 of the areas and
/// 0.04 of the volumes, a lattice of diagonal struts 0.98 and 0.62, many bridges in all directions 0.73 and 0.57;
/// scans 0.87 and 0.81 or more, a terrain on a grid, which only loses by a rotation, 0.86 and 0.75.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeshFrameConfig {
    /// Triangles that are sampled.
    pub(crate) n_sampled: u32,
    /// A frame is returned if the boxes' areas sum to at most this part of those along the coordinate axes...
    pub(crate) max_areas: f32,
    /// ... or their volumes to at most this part.
    pub(crate) max_volumes: f32,
}

impl Default for MeshFrameConfig {
    fn default() -> Self {
        Self { n_sampled: 1 << 14, max_areas: 0.8, max_volumes: 0.7 }
    }
}

/// Triangles that rank frames.
const N_RANKING: usize = 512;

/// Frames whose sum exceeds the required one by more than this part of the sum along the coordinate axes are not
/// refined, which takes two thirds of the time: on fourteen scenes no refinement saved more than 0.013.
const MARGIN: f64 = 0.1;

/// Triangles that the best frame is refined by.
const N_REFINING: usize = 4_096;

/// Triangles whose own frames are tried.
const N_OWN: usize = 64;

/// Best frames that are rotated to a local minimum.
const N_ROTATED: usize = 6;

/// Cosine of 10 degrees: frames closer than that reach the same minimum.
const ALIKE: f32 = 0.984_8;

/// Cosine of 1 degree: rotating the mesh by less gains nothing.
const EQUAL: f32 = 0.999_85;

/// A frame and the sum over the boxes along it.
type Ranked = ([Vec3A; 3], f64);

/// Tangents of half the first and the last angle that a frame is rotated by: 8 degrees and half a degree.
const COARSE: [f32; 2] = [0.07, 0.004];

/// The same for the best frame: half a degree, and what moves a point by a millionth of its distance.
const FINE: [f32; 2] = [0.004, 0.000_000_5];

/// Most iterations with one angle. After twice the angle two or three are enough; but along needles that
/// are almost parallel the sum falls towards zero, by some part of itself each time, for thousands.
const MAX_ITERATIONS: u32 = 16;

/// Frames in which the boxes of the mesh's triangles are smaller than along the coordinate axes.
///
/// `edges` are two edges of each of `n` triangles.
pub(crate) fn candidates(
    n: usize,
    edges: &dyn Fn(usize) -> [[f64; 3]; 2],
    config: &MeshFrameConfig,
) -> Vec<[[f32; 3]; 3]> {
    let sampled = evenly(n, edges, config.n_sampled);
    let mut found: Vec<[Vec3A; 3]> = vec![];
    for (sum, most) in [(Sum::Areas, config.max_areas), (Sum::Volumes, config.max_volumes)] {
        if let Some(rows) = best(&sampled, sum, most)
            && found.iter().all(|other| !are_alike(other, &rows, ALIKE))
        {
            found.push(rows);
        }
    }
    found.into_iter().map(from_glam).collect()
}

/// The frame of the least sum, if that is at most the part `most` of the sum along the coordinate axes.
fn best(sampled: &[Edges], sum: Sum, most: f32) -> Option<[Vec3A; 3]> {
    // Twice as many as there are: small meshes are cheap, and large triangles still count more.
    let ranking = Measure::of(&by_size(sampled, N_RANKING.min(2 * sampled.len())), sum);
    let fixed = dop::frames().iter().map(|&rows| to_glam(rows));
    let own = by_size(sampled, N_OWN.min(sampled.len())).into_iter().filter_map(along_longest_edge);
    let start = distinct(fixed.chain(own).map(|rows| (rows, ranking.of_boxes(&rows))).collect());
    let candidates = start.into_iter().map(|start| rotated(&ranking, start, COARSE));
    let (rows, coarse) = candidates.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let aligned = to_glam(dop::frames()[0]);
    if coarse > (f64::from(most) + MARGIN) * ranking.of_boxes(&aligned) {
        return None;
    }
    let refining = Measure::of(&by_size(sampled, N_REFINING.min(2 * sampled.len())), sum);
    let (rows, least) = rotated(&refining, (rows, refining.of_boxes(&rows)), FINE);
    let gains = least < f64::from(most) * refining.of_boxes(&aligned);
    (gains && !are_alike(&rows, &aligned, EQUAL)).then_some(rows)
}

/// The frame along a triangle's longest edge and its normal.
fn along_longest_edge([a, b]: Edges) -> Option<[Vec3A; 3]> {
    let longer = |e: Vec3A, f: Vec3A| if f.length_squared() > e.length_squared() { f } else { e };
    frame(longer(longer(a, b), b - a), a.cross(b))
}

/// A frame rotated about its axes, by ever smaller angles, while the sum falls.
fn rotated(measure: &Measure, start: Ranked, [first, last]: [f32; 2]) -> Ranked {
    let mut best = start;
    let mut tangent = first;
    let mut n_iterations = 0;
    while tangent >= last {
        let before = best.1;
        n_iterations += 1;
        for axis in 0..3 {
            for signed in [tangent, -tangent] {
                let Some(rows) = about_axis(&best.0, axis, signed) else { continue };
                let sum = measure.of_boxes(&rows);
                if sum < best.1 {
                    best = (rows, sum);
                }
            }
        }
        // Where the rounded sum falls by next to nothing, the angle is too small to matter.
        if best.1 >= before * (1.0 - f64::from(f32::EPSILON)) || n_iterations == MAX_ITERATIONS {
            tangent *= 0.5;
            n_iterations = 0;
        }
    }
    best
}

/// The frame rotated about one of its axes, by twice the angle of this tangent.
///
/// From the tangent of the half angle cosine and sine follow by arithmetic alone, the same on every platform; their
/// common factor cancels when rows are normalized.
fn about_axis(rows: &[Vec3A; 3], axis: usize, tangent: f32) -> Option<[Vec3A; 3]> {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let (cos, sin) = (1.0 - tangent * tangent, 2.0 * tangent);
    let mut rotated = *rows;
    rotated[i] = unit(rows[i] * cos + rows[j] * sin)?;
    rotated[j] = unit(rows[j] * cos - rows[i] * sin)?;
    Some(rotated)
}

/// The best frames, no two alike.
fn distinct(mut frames: Vec<Ranked>) -> Vec<Ranked> {
    frames.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut kept: Vec<Ranked> = Vec::with_capacity(N_ROTATED);
    for found in frames {
        if kept.len() < N_ROTATED && kept.iter().all(|other| !are_alike(&other.0, &found.0, ALIKE)) {
            kept.push(found);
        }
    }
    kept
}

/// Whether each axis of one frame is along an axis of the other, either way, up to the angle of this cosine.
fn are_alike(a: &[Vec3A; 3], b: &[Vec3A; 3], cosine: f32) -> bool {
    a.iter().all(|x| b.iter().any(|y| x.dot(*y).abs() >= cosine))
}

/// Edges of four triangles: three components of either.
type Four = [[Vec4; 3]; 2];

/// Groups of four that are summed in `f32` before the sums are added in `f64`.
const RUN: usize = 16;

/// What the frame minimizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sum {
    /// Half of the surface areas of the boxes: least along walls and along parallel struts.
    Areas,
    /// Their volumes: least where struts that cross lie in planes across the axes, as diagonals of a lattice do. Their
    /// boxes are flat there, so those of neighbors lie in layers.
    Volumes,
}

/// Triangles to measure frames by, four lanes.
struct Measure {
    triangles: Vec<Four>,
    sum: Sum,
}

impl Measure {
    /// Of these triangles; a last group is filled with points, which add nothing.
    fn of(triangles: &[Edges], sum: Sum) -> Self {
        let four = |chunk: &[Edges]| {
            let lanes = |edge: usize, k: usize| {
                Vec4::from_array(std::array::from_fn(|lane| chunk.get(lane).map_or(0.0, |edges| edges[edge][k])))
            };
            [0, 1].map(|edge| [0, 1, 2].map(|k| lanes(edge, k)))
        };
        Self { triangles: triangles.chunks(4).map(four).collect(), sum }
    }

    /// The sum over the triangles' boxes along `rows`.
    fn of_boxes(&self, rows: &[Vec3A; 3]) -> f64 {
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

/// Two edges of a triangle from one vertex.
type Edges = [Vec3A; 2];

/// 2⁶⁴ over the golden ratio: its multiples spread evenly over any range, in step with no period of a mesh.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// Up to `n` of `all` triangles, evenly over the mesh, scaled so that the longest edge has a length of about one.
fn evenly(all: usize, edges: &dyn Fn(usize) -> [[f64; 3]; 2], n: u32) -> Vec<Edges> {
    let index = |i: u32| ((u64::from(i).wrapping_mul(GOLDEN) >> 32) * all as u64) >> 32;
    let index = |i: u32| index(i) as usize;
    let sampled: Vec<[[f64; 3]; 2]> =
        if all <= n as usize { (0..all).map(edges).collect() } else { (0..n).map(|i| edges(index(i))).collect() };
    let reach = sampled.iter().flatten().flatten().fold(0.0, |reach: f64, x| reach.max(x.abs()));
    let scale = if reach > 0.0 { 1.0 / reach } else { 0.0 };
    let narrow = |edge: [f64; 3]| Vec3A::from_array(edge.map(|x| (x * scale) as f32));
    sampled.into_iter().map(|edges| edges.map(narrow)).collect()
}

/// `n` of the `sampled` triangles, in proportion to the square of the longest edge, each brought to a longest edge of
/// one; the larger come more than once. Empty where all are points.
fn by_size(sampled: &[Edges], n: usize) -> Vec<Edges> {
    let square = |&[a, b]: &Edges| f64::from(a.length_squared().max(b.length_squared()).max((b - a).length_squared()));
    let total: f64 = sampled.iter().map(square).sum();
    let step = total / n as f64;
    let (mut chosen, mut sum, mut next) = (Vec::with_capacity(n), 0.0, 0.5 * step);
    for edges in sampled {
        let square = square(edges);
        sum += square;
        while next < sum && chosen.len() < n {
            let scale = (1.0 / square.sqrt()) as f32;
            chosen.push(edges.map(|edge| edge * scale));
            next += step;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{self as fixtures, Mesh, Rotation};
    use canted_lbvh::{Corners, triangle_corners};

    use super::{MeshFrameConfig, candidates};
    use crate::build::item::Item;

    fn corners(mesh: &Mesh) -> Vec<Corners> {
        triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0
    }

    fn found(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
        let corners = corners(mesh);
        candidates(corners.len(), &|i| corners[i].edges(), &MeshFrameConfig::default())
    }

    /// Greatest angle, in degrees, between a row and the nearest image of an axis under `rotation`.
    ///
    /// By the sine, as the cosine of a small angle is one.
    fn angle_deg(rows: &[[f32; 3]; 3], rotation: &Rotation) -> f64 {
        let sine = |row: [f32; 3], axis: [f64; 3]| {
            let [x, y, z] = row.map(f64::from);
            let [a, b, c] = axis;
            let cross = [y * c - z * b, z * a - x * c, x * b - y * a];
            cross.iter().map(|x| x * x).sum::<f64>().sqrt()
        };
        let axes = [0, 1, 2].map(|k| rotation.rows.map(|row| row[k]));
        let nearest = |row| axes.iter().map(|&axis| sine(row, axis)).fold(1.0, f64::min);
        rows.iter().map(|&row| nearest(row)).fold(0.0, f64::max).asin().to_degrees()
    }

    /// Rooms in a row, their floors and walls tessellated, and a few slanted roofs.
    fn rooms() -> Mesh {
        let mut mesh = Mesh::default();
        let mut quad = |a: [f32; 3], u: [f32; 3], v: [f32; 3], cells: u8| {
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                let n = f32::from(cells);
                let at = |i: u8, j: u8| std::array::from_fn(|k| a[k] + (u[k] * f32::from(i) + v[k] * f32::from(j)) / n);
                let base = u32::try_from(mesh.positions.len()).unwrap();
                mesh.positions.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                mesh.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
            }
        };
        for room in 0..12u8 {
            let x = 5.0 * f32::from(room);
            quad([x, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 7.0, 0.0], 6);
            quad([x, 0.0, 0.0], [0.0, 7.0, 0.0], [0.0, 0.0, 3.0], 5);
            quad([x, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 0.0, 3.0], 4);
            quad([x, 0.0, 3.0], [5.0, 0.0, 0.0], [0.0, 3.5, 2.0], 3);
        }
        mesh
    }

    #[test]
    fn the_frame_of_rotated_rooms_is_found_to_a_thousandth_of_a_degree() {
        let frames = found(&rooms().off_axis());
        assert_eq!(frames.len(), 1);
        let angle = angle_deg(&frames[0], &Rotation::off_axis());
        assert!(angle < 1e-3, "{angle}");
    }

    #[test]
    fn the_frame_of_a_diagonal_lattice_is_found_though_no_strut_runs_along_it() {
        for thin in [false, true] {
            let frames = found(&fixtures::scaffold(1, thin));
            let angle = frames.iter().map(|rows| angle_deg(rows, &Rotation::off_axis())).fold(90.0, f64::min);
            // The nodes of the lattice are moved about, so its axes are known no better.
            assert!(angle < 0.5, "{thin}: {angle}");
        }
    }

    #[test]
    fn nothing_is_found_where_the_axes_dominate_or_no_direction() {
        let points = Mesh { positions: vec![[3.0; 3]], triangles: vec![[0; 3]; 9] };
        let meshes = [
            ("points", points),
            ("rooms", rooms()),
            ("grid", fixtures::grid(5, [300, 300])),
            ("poles", fixtures::poles(2)),
            ("sphere", fixtures::displaced_icosphere(1, 5)),
            ("none", Mesh::default()),
        ];
        for (name, mesh) in meshes {
            assert_eq!(found(&mesh), Vec::<[[f32; 3]; 3]>::new(), "{name}");
        }
    }

    /// The same rooms, rotated as the measure must ignore: the rotation, not the rooms, makes a candidate.
    #[test]
    fn a_quarter_turn_changes_nothing() {
        let quarter = Rotation { rows: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] };
        assert!(found(&rooms().rotated(&quarter)).is_empty());
        assert!(!found(&rooms().rotated(&Rotation::euler(0.0, 0.0, 0.1))).is_empty());
    }

    #[test]
    fn offsets_and_sizes_change_nothing() {
        let rooms = rooms().off_axis();
        for (scale, by) in [(1e-30f32, 0.0f32), (1e36, 0.0), (1.0, 1e5)] {
            let positions = rooms.positions.iter().map(|p| p.map(|x| x * scale + by)).collect();
            let frames = found(&Mesh { positions, triangles: rooms.triangles.clone() });
            assert_eq!(frames.len(), 1, "{scale}, {by}");
            // At the far offset coordinates are rounded to 1/128 of a unit, cells are about one unit large.
            let angle = angle_deg(&frames[0], &Rotation::off_axis());
            assert!(angle < if by > 0.0 { 0.1 } else { 1e-3 }, "{scale}, {by}: {angle}");
        }
    }

    #[test]
    fn rows_are_unit_vectors_but_for_rounding() {
        for rows in found(&fixtures::truss(4)).into_iter().chain(found(&rooms().off_axis())).flatten() {
            let length = rows.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() <= 2.0 * f64::from(f32::EPSILON), "{length}");
        }
    }
}
