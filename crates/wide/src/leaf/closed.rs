//! Whether a mesh is closed, by sums over its edges: each edge is added once for each triangle beside it, so that what cancels is zero.
//!
//! Two different sets of edges have the same sum with a probability of 2^-128.

/// In which sense the edges of a mesh cancel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Closed {
    /// An even number of triangles is at each edge: the parity of crossings tells inside from outside.
    pub(crate) by_parity: bool,
    /// As many triangles run along each edge in one direction as in the other: winding numbers are whole.
    pub(crate) by_winding: bool,
}

/// Sums over the edges of a mesh. Vertices are compared by their coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EdgeSums {
    parity: [u64; 2],
    winding: [u64; 2],
}

impl EdgeSums {
    pub(crate) fn add(&mut self, [a, b, c]: [[f32; 3]; 3]) {
        for [start, end] in [[a, b], [b, c], [c, a]].map(|edge| edge.map(bits)) {
            if start == end {
                continue;
            }
            let (sum, is_forward) = if start < end { (hash(start, end), true) } else { (hash(end, start), false) };
            let add = if is_forward { u64::wrapping_add } else { u64::wrapping_sub };
            for ((parity, winding), hash) in self.parity.iter_mut().zip(&mut self.winding).zip(sum) {
                *parity ^= hash;
                *winding = add(*winding, hash);
            }
        }
    }

    pub(crate) fn closed(&self) -> Closed {
        Closed { by_parity: self.parity == [0; 2], by_winding: self.winding == [0; 2] }
    }
}

fn bits(vertex: [f32; 3]) -> [u32; 3] {
    // Adding zero makes -0.0 positive.
    vertex.map(|x| (x + 0.0).to_bits())
}

/// Two hashes of an edge, by products of 128 bits whose halves are folded together.
fn hash(start: [u32; 3], end: [u32; 3]) -> [u64; 2] {
    let word = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
    let words = [word(start[0], start[1]), word(start[2], end[0]), word(end[1], end[2])];
    // The fractions of the square roots of 2 to 5 without 4, and of 7: odd numbers without a pattern.
    [[0x6a09_e667_f3bc_c909, 0xbb67_ae85_84ca_a73b], [0x3c6e_f372_fe94_f82b, 0xa54f_f53a_5f1d_36f1]].map(
        |[mut state, factor]| {
            for word in words {
                let product = u128::from(state ^ word) * u128::from(factor);
                state = (product as u64 ^ (product >> 64) as u64).wrapping_add(factor);
            }
            state
        },
    )
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{self as fixtures, Mesh};

    use super::*;

    fn closed(mesh: &Mesh) -> [bool; 2] {
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize]);
        let mut sums = EdgeSums::default();
        mesh.triangles.iter().for_each(|triangle| sums.add(corners(triangle)));
        let Closed { by_parity, by_winding } = sums.closed();
        [by_parity, by_winding]
    }

    #[test]
    fn meshes_are_closed_where_their_edges_cancel() {
        let mut mesh = fixtures::torus(12, 8);
        assert_eq!(closed(&mesh), [true; 2]);
        // One triangle that is turned over.
        mesh.triangles[5].swap(0, 1);
        assert_eq!(closed(&mesh), [true, false]);
        mesh.triangles[5].swap(0, 1);
        // Triangles without area have edges, too; those without extent have none.
        let [a, b, c] = mesh.triangles[0];
        mesh.triangles.extend([[a, a, b], [c, c, c]]);
        assert_eq!(closed(&mesh), [true; 2]);
        mesh.triangles.push([a, b, c]);
        assert_eq!(closed(&mesh), [false; 2]);
        mesh.triangles.push([a, c, b]);
        assert_eq!(closed(&mesh), [true; 2]);
        for missing in 0..mesh.triangles.len() - 4 {
            let mut open = mesh.clone();
            open.triangles.remove(missing);
            assert_eq!(closed(&open), [false; 2], "{missing}");
        }
        assert_eq!(closed(&Mesh { positions: vec![], triangles: vec![] }), [true; 2]);
    }
}
