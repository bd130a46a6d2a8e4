//! Winding numbers: how often a surface winds around a point, also where it has gaps, overlaps or doubled faces.
//!
//! The winding number of a point is the sum of the signed solid angles of all triangles, divided by 4π: 1 inside of a closed surface, 0
//! outside, 2 where two solids overlap, a fraction near the border of an open surface (Jacobson et al. 2013). Far from a cluster of
//! triangles the sum is close to the first two terms of a Taylor series about its centroid (Barill et al. 2018). Clusters are the subtrees of the BVH.
//!
//! # Error
//! Let `c` be the centroid of a cluster, `ρ` the distance of its farthest vertex, `A` its area and `M` the integral of `|x - c|²` over
//! it. The kernel `x/|x|³` has second derivatives of at most `6/|x|⁴`, so the terms that are dropped sum up to at most
//! `½·6·M / (d - ρ)⁴` at distance `d` from `c`. A cluster is expanded where that is at most a given part of `A / (d - ρ)²`, which bounds the solid
//! angle that it can have; else its children are visited, and triangles have their exact solid angles (van Oosterom and Strackee 1983).
//! So each sum comes with a bound of its error, and the part is made smaller until the bound is small enough.

use std::cmp::Ordering;
use std::f64::consts::PI;

use canted_obb::orient_3d;
use canted_obb::vector::{add, cross, dot, length, scale, sub, to_f64};

use super::containment::{Place, is_on};
use crate::bvh::TriangleBvh;
use crate::leaf::{LeafPrimitive, Triangle};
use crate::node::{ChildWord, DecodedWord, node_words};
use crate::par;
use crate::traverse::LeafRange;

/// Points of one parallel job.
const CHUNK: usize = 1 << 6;

/// The parts of their solid angle by which clusters may be wrong, one after another until the answer is certain; with the last, every triangle
/// is summed.
const PARTS: [f64; 5] = [0.25, 0.03, 0.004, 0.0005, 0.0];

/// Rounding of a solid angle, relative to its greatest value: 32 roundings of `f64`, doubled.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Triangles that are summed without clusters.
const FEW: usize = 64;

/// Answers winding numbers of a mesh; made by [`TriangleBvh::winding_numbers`].
///
/// ```
/// use canted_wide::TriangleBvh;
///
/// // Two tetrahedra that overlap; by parity, their common part is outside.
/// let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
/// let moved = corners.map(|[x, y, z]: [f32; 3]| [x + 0.5, y + 0.5, z + 0.5]);
/// let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let positions: Vec<[f32; 3]> = corners.into_iter().chain(moved).collect();
/// let triangles: Vec<[u32; 3]> = faces.into_iter().chain(faces.map(|face| face.map(|i| i + 4))).collect();
/// let bvh = TriangleBvh::build(&positions, &triangles)?;
/// let winding = bvh.winding_numbers();
/// assert!((winding.number([0.8, 0.8, 0.8], 1e-6) - 2.0).abs() < 1e-6);
/// assert!(winding.contains([0.8, 0.8, 0.8]) && !bvh.contains([0.8, 0.8, 0.8]));
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[derive(Clone, Debug)]
pub struct WindingNumbers {
    /// Breadth-first; the first is the root.
    clusters: Vec<Cluster>,
    /// Each triangle once, those of a leaf together.
    triangles: Vec<[[f32; 3]; 3]>,
    is_oriented: bool,
    /// Winding numbers are whole.
    is_closed: bool,
}

/// Triangles that are seen together from far away.
#[derive(Clone, Copy, Debug, Default)]
struct Cluster {
    /// Centroid of the area.
    center: [f64; 3],
    /// Distance of the farthest vertex.
    radius: f64,
    area: f64,
    /// Integral of the squared distance from the centroid.
    second_moment: f64,
    /// Integral of the normal.
    normal: [f64; 3],
    /// Integral of the outer product of the offset from the centroid, by rows, and the normal.
    spread: [[f64; 3]; 3],
    /// The first child, or the first triangle of a leaf.
    first: u32,
    n: u32,
    is_leaf: bool,
}

/// A sum of solid angles divided by 4π.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    number: f64,
    error: f64,
    is_on_surface: bool,
}

impl TriangleBvh {
    /// Prepares winding numbers: a pass over all triangles, and about 80 bytes for each.
    ///
    /// [`TriangleBvh::contains`] is exact and needs no preparation, but presupposes a closed mesh without overlaps.
    #[doc(alias = "generalized_winding_number")]
    #[must_use]
    pub fn winding_numbers(&self) -> WindingNumbers {
        let (mut clusters, mut words) = (vec![], vec![self.nodes.root]);
        let mut triangles = Vec::with_capacity(self.n_primitives());
        // Spatial splits refer to a triangle from several leaves; the first has it.
        let mut is_known = vec![false; self.n_primitives()];
        while let Some(&word) = words.get(clusters.len()) {
            let (first, is_leaf) = match word.kind() {
                DecodedWord::Node(kind, line) => {
                    let first = words.len();
                    let children = node_words(&self.nodes.lines, kind, line);
                    words.extend(children.iter().filter(|&&child| child != ChildWord::EMPTY));
                    (first, false)
                }
                DecodedWord::Leaf { first, n } => {
                    let start = triangles.len();
                    Triangle::for_each_shape(&self.leaves, LeafRange::new(first, n), |primitive, vertices| {
                        if !std::mem::replace(&mut is_known[primitive.index()], true) {
                            triangles.push(*vertices);
                        }
                    });
                    (start, true)
                }
                DecodedWord::Empty => (triangles.len(), true),
            };
            let n = if is_leaf { triangles.len() } else { words.len() } - first;
            clusters.push(Cluster { first: first as u32, n: n as u32, is_leaf, ..Cluster::default() });
        }
        // Children come after their parents.
        for i in (0..clusters.len()).rev() {
            let Cluster { first, n, is_leaf, .. } = clusters[i];
            let range = first as usize..(first + n) as usize;
            let parts: Vec<Cluster> = if is_leaf {
                triangles[range].iter().map(Cluster::of_triangle).collect()
            } else {
                clusters[range].to_vec()
            };
            clusters[i] = Cluster { first, n, is_leaf, ..Cluster::joined(&parts) };
        }
        WindingNumbers {
            clusters,
            is_oriented: is_oriented(&triangles),
            is_closed: self.closed().by_winding,
            triangles,
        }
    }
}

impl WindingNumbers {
    /// Whether neighbors agree in orientation: no edge belongs to just two triangles that both run along it in the same direction.
    ///
    /// Otherwise winding numbers say little, and [`TriangleBvh::contains`] is the better answer for a closed mesh. Vertices are compared by
    /// their coordinates, and triangles listed several times count once.
    #[must_use]
    pub fn is_oriented(&self) -> bool {
        self.is_oriented
    }

    /// The winding number of a point, off by at most `tolerance`, apart from roundings; NaN for a point that is not finite.
    ///
    /// Triangles that are counterclockwise seen from outside count as positive. Meshes of up to 64 triangles, and all with a tolerance
    /// of zero, are summed triangle by triangle. On the surface the number is that of the directions in which the inside lies: 1/2 on a flat face.
    #[must_use]
    pub fn number(&self, point: impl Into<[f32; 3]>, tolerance: f64) -> f64 {
        self.sum(point.into(), |sum| sum.error <= tolerance).number
    }

    /// The winding number of each point; see [`WindingNumbers::number`]. Panics where the slices differ in length.
    pub fn numbers(&self, points: &[[f32; 3]], tolerance: f64, numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer for each point");
        for (&point, number) in points.iter().zip(numbers) {
            *number = self.number(point, tolerance);
        }
    }

    /// The winding number of each point, on all threads.
    pub fn par_numbers(&self, points: &[[f32; 3]], tolerance: f64, numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer for each point");
        let jobs = points.chunks(CHUNK).zip(numbers.chunks_mut(CHUNK)).collect();
        par::for_jobs(jobs, |(points, numbers): (&[[f32; 3]], &mut [f64])| self.numbers(points, tolerance, numbers));
    }

    /// Whether the winding number of a point exceeds 1/2, with either sign, or the point is on a triangle.
    ///
    /// Clusters decide only where their error allows it; else triangles are summed, and the answer is that of the sum up to roundings of `f64`:
    /// those matter for points that all but touch an edge or a vertex.
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        self.place(point.into()) != Place::Outside
    }

    fn place(&self, point: [f32; 3]) -> Place {
        // Whole numbers are apart; others may be anywhere.
        let is_certain = |sum: &Sum| {
            if self.is_closed { sum.error < 0.5 } else { (sum.number.abs() - 0.5).abs() > sum.error }
        };
        let sum = self.sum(point, |sum| sum.is_on_surface || is_certain(sum));
        match sum.number.abs() > 0.5 {
            _ if sum.is_on_surface => Place::On,
            true => Place::Inside,
            false => Place::Outside,
        }
    }

    /// Distance to the surface of `bvh`, of which these are the winding numbers, as [`TriangleBvh::signed_distance`] but for the sign: negative
    /// where [`WindingNumbers::contains`] is true.
    #[must_use]
    pub fn signed_distance(&self, bvh: &TriangleBvh, point: impl Into<[f32; 3]>) -> f32 {
        let mut distance = [0.0];
        self.signed_distance_many(bvh, &[point.into()], &mut distance);
        distance[0]
    }

    /// The signed distance of each point, by its winding number; see [`WindingNumbers::signed_distance`].
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn signed_distance_many(&self, bvh: &TriangleBvh, points: &[[f32; 3]], distances: &mut [f32]) {
        bvh.signed_by(points, self.is_closed, distances, |asked| {
            asked.iter().map(|&point| self.place(point)).collect()
        });
    }

    /// [`WindingNumbers::signed_distance_many`] on all threads.
    pub fn par_signed_distance_many(&self, bvh: &TriangleBvh, points: &[[f32; 3]], distances: &mut [f32]) {
        assert_eq!(points.len(), distances.len(), "one answer for each point");
        par::for_chunks(distances, CHUNK, |first, distances| {
            self.signed_distance_many(bvh, &points[first..first + distances.len()], distances);
        });
    }

    /// Whether each point is inside; see [`WindingNumbers::contains`]. Panics where the slices differ in length.
    pub fn contains_many(&self, points: &[[f32; 3]], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer for each point");
        for (&point, inside) in points.iter().zip(inside) {
            *inside = self.contains(point);
        }
    }

    /// Whether each point is inside, on all threads.
    pub fn par_contains_many(&self, points: &[[f32; 3]], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer for each point");
        let jobs = points.chunks(CHUNK).zip(inside.chunks_mut(CHUNK)).collect();
        par::for_jobs(jobs, |(points, inside): (&[[f32; 3]], &mut [bool])| self.contains_many(points, inside));
    }

    /// The first sum that is good enough.
    fn sum(&self, point: [f32; 3], is_good: impl Fn(&Sum) -> bool) -> Sum {
        let mut sum = Sum { number: f64::NAN, ..Sum::default() };
        if !point.iter().all(|x| x.is_finite()) {
            return sum;
        }
        let parts = if self.triangles.len() <= FEW { &PARTS[PARTS.len() - 1..] } else { &PARTS };
        let mut waiting = vec![];
        for &part in parts {
            sum = self.sum_within(point, part, &mut waiting);
            if is_good(&sum) {
                break;
            }
        }
        sum
    }

    /// The sum in which each cluster is wrong by at most a part of the solid angle that it can have.
    fn sum_within(&self, point: [f32; 3], part: f64, waiting: &mut Vec<u32>) -> Sum {
        let (mut sum, origin) = (Sum::default(), to_f64(point));
        waiting.clear();
        waiting.push(0);
        while let Some(i) = waiting.pop() {
            let cluster = &self.clusters[i as usize];
            if cluster.add_far(origin, part, &mut sum) {
                continue;
            }
            let children = cluster.first..cluster.first + cluster.n;
            if cluster.is_leaf {
                for triangle in &self.triangles[children.start as usize..children.end as usize] {
                    add_triangle(point, triangle, &mut sum);
                }
            } else {
                waiting.extend(children);
            }
        }
        sum.number /= 4.0 * PI;
        sum.error /= 4.0 * PI;
        sum
    }
}

/// See [`WindingNumbers::is_oriented`].
fn is_oriented(triangles: &[[[f32; 3]; 3]]) -> bool {
    // Adding zero makes -0.0 positive.
    let bits = |vertex: [f32; 3]| vertex.map(|x| (x + 0.0).to_bits());
    let mut all: Vec<[[u32; 3]; 3]> = triangles.iter().map(|triangle| triangle.map(bits)).collect();
    all.retain(|[a, b, c]| a != b && b != c && c != a);
    for triangle in &mut all {
        let least = (0..3).min_by_key(|&k| triangle[k]).unwrap_or(0);
        triangle.rotate_left(least);
    }
    all.sort_unstable();
    all.dedup();
    // The ends of each edge, the lesser first, and whether the triangle runs from it to the other.
    let ends = |[a, b]: [[u32; 3]; 2]| if a < b { (a, b, true) } else { (b, a, false) };
    let mut edges: Vec<_> = all.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(ends)).collect();
    edges.sort_unstable();
    edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)).all(|uses| uses.len() != 2 || uses[0].2 != uses[1].2)
}

impl Cluster {
    fn of_triangle(vertices: &[[f32; 3]; 3]) -> Self {
        let [a, b, c] = vertices.map(to_f64);
        let center = scale(add(add(a, b), c), 1.0 / 3.0);
        let normal = scale(cross(sub(b, a), sub(c, a)), 0.5);
        let area = length(normal);
        let squares = [a, b, c].map(|vertex| dot(sub(vertex, center), sub(vertex, center)));
        let [p, q, r] = squares;
        let radius = p.max(q).max(r).sqrt();
        Self { center, radius, area, second_moment: area * (p + q + r) / 12.0, normal, ..Self::default() }
    }

    /// All of `parts`.
    fn joined(parts: &[Self]) -> Self {
        let area: f64 = parts.iter().map(|part| part.area).sum();
        let weight = |part: &Self| if area > 0.0 { part.area / area } else { 1.0 / parts.len() as f64 };
        let center = parts.iter().fold([0.0; 3], |sum, part| add(sum, scale(part.center, weight(part))));
        let mut all = Self { center, area, ..Self::default() };
        for part in parts {
            let offset = sub(part.center, center);
            all.radius = all.radius.max(length(offset) + part.radius);
            all.second_moment += part.second_moment + part.area * dot(offset, offset);
            all.normal = add(all.normal, part.normal);
            for (i, row) in all.spread.iter_mut().enumerate() {
                *row = add(*row, add(part.spread[i], scale(part.normal, offset[i])));
            }
        }
        all
    }

    /// Adds the solid angle seen from `origin`, where the series is wrong by at most a part of the greatest one.
    fn add_far(&self, origin: [f64; 3], part: f64, sum: &mut Sum) -> bool {
        let r = sub(self.center, origin);
        let squared = dot(r, r);
        let distance = squared.sqrt();
        let gap = distance - self.radius;
        let greatest = self.area / (gap * gap);
        let dropped = 3.0 * self.second_moment / (gap * gap * gap * gap);
        // False for what is not a number.
        if !(gap > 0.0 && dropped <= part * greatest) {
            return false;
        }
        let cubed = squared * distance;
        let trace = self.spread[0][0] + self.spread[1][1] + self.spread[2][2];
        let along = dot(r, self.spread.map(|row| dot(row, r)));
        sum.number += (dot(r, self.normal) + trace - 3.0 * along / squared) / cubed;
        sum.error += dropped + ROUNDING * greatest;
        true
    }
}

/// Adds the solid angle of a triangle, whose sign is exact.
fn add_triangle(point: [f32; 3], vertices: &[[f32; 3]; 3], sum: &mut Sum) {
    let [a, b, c] = vertices.map(|vertex| sub(to_f64(vertex), to_f64(point)));
    let side = orient_3d(vertices[0], vertices[1], vertices[2], point);
    if side == Ordering::Equal {
        // In its plane, a triangle has no solid angle.
        sum.is_on_surface |= is_on(point, vertices);
        return;
    }
    let [p, q, r] = [a, b, c].map(length);
    let size = p * q * r;
    let volume = dot(a, cross(b, c)).abs();
    let angle = 2.0 * volume.atan2(size + dot(a, b) * r + dot(b, c) * p + dot(c, a) * q);
    sum.number += if side == Ordering::Greater { angle } else { -angle };
    let rest = volume.hypot(size + dot(a, b) * r + dot(b, c) * p + dot(c, a) * q);
    sum.error += (ROUNDING * size / rest).min(2.0 * PI);
}
