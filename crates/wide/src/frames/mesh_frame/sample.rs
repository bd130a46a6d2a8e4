//! Deterministic samples of the triangles of a mesh.

use glam::Vec3A;

/// Two edges of a triangle from one vertex.
pub(super) type Edges = [Vec3A; 2];

/// 2⁶⁴ over the golden ratio: its multiples spread evenly over any range, in step with no period of a mesh.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// Up to `n` of `all` triangles, evenly over the mesh, scaled so that the longest edge has a length of about one.
pub(super) fn evenly(all: usize, edges: &dyn Fn(usize) -> [[f64; 3]; 2], n: u32) -> Vec<Edges> {
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
pub(super) fn by_size(sampled: &[Edges], n: usize) -> Vec<Edges> {
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
