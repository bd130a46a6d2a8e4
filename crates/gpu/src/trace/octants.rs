//! Children of wide nodes in the order of octants, for `shared/certain`.

use canted_wide::RawBvh;

use super::layout::{EMPTY, WIDTH};
use super::packed::{ADDRESSES, CPU_ADDRESS, is_node, is_oriented, words_row};

/// A BVH with the children of each node in other places: child `i` toward the corner of the node that is high along axis `k` where bit `k`
/// of `i` is set, in the frame of the mesh. Hits stay the same; rays that take the children in the order of `i ^ octant` meet near ones first.
///
/// Greedy, after Ylitie, Karras and Laine 2017, who solve the assignment: the child and the corner that fit best come first.
pub(super) fn by_octants<'a>(bvh: &RawBvh<'a>) -> RawBvh<'a> {
    let mut nodes = bvh.nodes.to_vec();
    let mut waiting = vec![bvh.root];
    while let Some(word) = waiting.pop() {
        if !is_node(word) {
            continue;
        }
        let at = (word & ADDRESSES) as usize * CPU_ADDRESS;
        let (is_aligned, n_rows) = (!is_oriented(word), words_row(word) + 1);
        let node = &mut nodes[at..][..n_rows * WIDTH];
        let children: [u32; WIDTH] = std::array::from_fn(|i| node[(n_rows - 1) * WIDTH + i]);
        let center = |i| if is_aligned { aligned_center(node, i) } else { oriented_center(node, i, &bvh.frame) };
        let centers = std::array::from_fn(|i| (children[i] != EMPTY).then(|| center(i)));
        let from = assigned(&centers);
        for row in node.chunks_exact_mut(WIDTH) {
            let old: [u32; WIDTH] = std::array::from_fn(|i| row[i]);
            row.iter_mut().zip(from).for_each(|(word, from)| *word = old[from]);
        }
        waiting.extend(children);
    }
    RawBvh { nodes: nodes.into(), ..bvh.clone() }
}

fn number(node: &[u32], row: usize, child: usize) -> f32 {
    f32::from_bits(node[row * WIDTH + child])
}

/// Twice the center of an axis-aligned child, in the frame of the mesh.
fn aligned_center(node: &[u32], child: usize) -> [f32; 3] {
    [0, 2, 4].map(|row| number(node, row, child) + number(node, row + 1, child))
}

/// Twice the center of an oriented child, in the frame of the mesh.
fn oriented_center(node: &[u32], child: usize, frame: &[[f32; 3]; 3]) -> [f32; 3] {
    // The rows of a child are unit vectors, and so is the frame.
    let mut center = [0.0; 3];
    for row in [0, 5, 10] {
        let along = 2.0 * number(node, row + 3, child);
        for (k, x) in center.iter_mut().enumerate() {
            *x += along * number(node, row + k, child);
        }
    }
    frame.map(|[x, y, z]| x * center[0] + y * center[1] + z * center[2])
}

/// For each place the child that moves there.
fn assigned(centers: &[Option<[f32; 3]>; WIDTH]) -> [usize; WIDTH] {
    let n = centers.iter().flatten().count().max(1) as f32;
    let sum = centers.iter().flatten().fold([0.0; 3], |sum: [f32; 3], c| std::array::from_fn(|k| sum[k] + c[k]));
    // Along the diagonal to each corner; a missing child fits nowhere.
    let fits = centers.map(|center| {
        let [x, y, z] = center.map_or([0.0; 3], |c| std::array::from_fn(|k| c[k] - sum[k] / n));
        let along = |place: usize| {
            let signed = |bit: usize, x: f32| if place & bit != 0 { x } else { -x };
            signed(1, x) + signed(2, y) + signed(4, z)
        };
        std::array::from_fn::<f32, WIDTH, _>(along)
    });
    let mut from = [WIDTH; WIDTH];
    let mut is_open = centers.map(|center| center.is_some());
    while is_open.contains(&true) {
        let pairs = (0..WIDTH)
            .filter(|&child| is_open[child])
            .flat_map(|child| (0..WIDTH).filter(|&place| from[place] == WIDTH).map(move |place| (child, place)));
        let best = pairs.max_by(|&(a, i), &(b, j)| fits[a][i].total_cmp(&fits[b][j]));
        let Some((child, place)) = best else { break };
        from[place] = child;
        is_open[child] = false;
    }
    let mut missing = (0..WIDTH).filter(|&child| centers[child].is_none());
    from.map(|child| if child == WIDTH { missing.next().unwrap_or(0) } else { child })
}

#[cfg(test)]
mod tests {
    use canted_wide::{Config, Costs, TriangleBvh};

    use super::*;

    /// The eight corners of a cube, in any order, move to their places.
    #[test]
    fn children_move_to_their_corners() {
        let corner = |i: usize| [1, 2, 4].map(|bit| if i & bit != 0 { 5.0_f32 } else { 3.0 });
        let order = [3, 0, 7, 5, 1, 6, 2, 4];
        let from = assigned(&order.map(|i| Some(corner(i))));
        assert_eq!(from.map(|child| order[child]), [0, 1, 2, 3, 4, 5, 6, 7]);
        // Missing children fill what is left.
        let some = order.map(|i| (i != 6 && i != 1).then(|| corner(i)));
        let mut places = assigned(&some);
        assert!([0, 2, 3, 4, 5, 7].iter().all(|&i| order[places[i]] == i));
        places.sort_unstable();
        assert_eq!(places, [0, 1, 2, 3, 4, 5, 6, 7]);
    }

    /// Every node keeps its children with their boxes, for both kinds of nodes.
    #[test]
    fn nodes_keep_their_children() {
        let positions: Vec<[f32; 3]> = (0..600u32)
            .map(|i| {
                [1, 7, 49].map(|k| ((i * k).wrapping_mul(2_654_435_761_u32.wrapping_mul(i + 1)) % 1000) as f32 * 0.01)
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..200).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        for [aligned_node, oriented_node] in [[0.01, 1e6], [1e6, 0.01]] {
            let costs = Costs { aligned_node, oriented_node, leaf: 0.0, block: 0.01, max_leaf: 1 };
            let bvh = TriangleBvh::build_with(&positions, &triangles, Config { costs, ..Config::default() }).unwrap();
            let raw = bvh.raw();
            let moved = by_octants(&raw);
            let (n_rows, kind) = if aligned_node < 1.0 { (7, 0) } else { (16, 1) };
            let (mut waiting, mut n_moved) = (vec![raw.root], 0);
            while let Some(word) = waiting.pop() {
                if !is_node(word) {
                    continue;
                }
                assert_eq!(word >> 29, kind);
                let at = (word & ADDRESSES) as usize * CPU_ADDRESS;
                let columns = |nodes: &[u32]| {
                    let column = |i: usize| (0..n_rows).map(|row| nodes[at + row * WIDTH + i]).collect::<Vec<_>>();
                    (0..WIDTH).map(column).collect::<Vec<_>>()
                };
                let (mut old, mut new) = (columns(&raw.nodes), columns(&moved.nodes));
                n_moved += usize::from(old != new);
                waiting.extend(new.iter().map(|column| column[n_rows - 1]));
                old.sort_unstable();
                new.sort_unstable();
                assert_eq!(old, new);
            }
            assert!(n_moved > 10, "only {n_moved} nodes have moved children");
        }
    }
}
