//! Triangles drawn from a mesh, without chance.

use canted_lbvh::Corners;
use glam::Vec3A;

/// Two edges of a triangle from one vertex.
pub(super) type Edges = [Vec3A; 2];

/// 2⁶⁴ over the golden ratio: its multiples spread evenly over any range, in step with no period of a mesh.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// Up to `n` triangles, evenly over the mesh, scaled so that the longest edge has a length of about one.
pub(super) fn evenly(corners: &[Corners], n: u32) -> Vec<Edges> {
    let all = corners.len();
    let place = |i: u32| ((u64::from(i).wrapping_mul(GOLDEN) >> 32) * all as u64) >> 32;
    #[expect(clippy::cast_possible_truncation, reason = "below the number of triangles")]
    let place = |i: u32| place(i) as usize;
    let drawn: Vec<[[f64; 3]; 2]> = if all <= n as usize {
        corners.iter().map(wide_edges).collect()
    } else {
        (0..n).map(|i| wide_edges(&corners[place(i)])).collect()
    };
    let reach = drawn.iter().flatten().flatten().fold(0.0, |reach: f64, x| reach.max(x.abs()));
    let scale = if reach > 0.0 { 1.0 / reach } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, reason = "scaled to at most one")]
    let narrow = |edge: [f64; 3]| Vec3A::from_array(edge.map(|x| (x * scale) as f32));
    drawn.into_iter().map(|edges| edges.map(narrow)).collect()
}

/// Two edges in `f64`, where no difference of coordinates overflows.
fn wide_edges(&[a, b, c]: &Corners) -> [[f64; 3]; 2] {
    [b, c].map(|end| std::array::from_fn(|k| f64::from(end[k]) - f64::from(a[k])))
}

/// `n` of the `drawn` triangles, in proportion to the square of the longest edge, each brought to a longest edge of
/// one; the larger come more than once. None where all are points.
pub(super) fn by_size(drawn: &[Edges], n: usize) -> Vec<Edges> {
    let square = |&[a, b]: &Edges| f64::from(a.length_squared().max(b.length_squared()).max((b - a).length_squared()));
    let total: f64 = drawn.iter().map(square).sum();
    #[expect(clippy::cast_precision_loss, reason = "a few thousand")]
    let step = total / n as f64;
    let (mut chosen, mut sum, mut next) = (Vec::with_capacity(n), 0.0, 0.5 * step);
    for edges in drawn {
        let square = square(edges);
        sum += square;
        while next < sum && chosen.len() < n {
            #[expect(clippy::cast_possible_truncation, reason = "near one after scaling")]
            let scale = (1.0 / square.sqrt()) as f32;
            chosen.push(edges.map(|edge| edge * scale));
            next += step;
        }
    }
    chosen
}
