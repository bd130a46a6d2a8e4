//! Triangles of all leaves, read from their blocks, and replaced in them.

use canted_lbvh::Corners;
use canted_obb::PrimId;

use crate::layout::{HALF_WORDS, Half, Lane, LeafLayout, PART_LANES, PARTS};
use crate::outline::{LeafOutline, Outline};
use crate::par;
use crate::refit::boxes::LeafContent;
use crate::traverse::MeshFrame;

const LAYOUT: &LeafLayout = &LeafLayout::BLOCKS;

/// Triangles by their place: vertices, and ids.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Triangles {
    pub(crate) corners: Vec<Corners>,
    pub(crate) ids: Vec<PrimId>,
}

impl Triangles {
    /// Reads all leaves.
    pub(crate) fn read(outline: &Outline, halves: &[Half]) -> Self {
        let words: &[u32] = bytemuck::cast_slice(halves);
        let mut all = vec![([[0.0; 3]; 3], PrimId(0)); outline.n_places];
        par::for_pieces(
            &outline.leaves,
            &mut all,
            |leaf| leaf.places.start,
            |leaf, out| {
                let words = &words[leaf.unit(LAYOUT) * HALF_WORDS..];
                let n = out.len();
                for (i, (corners, id)) in out.iter_mut().enumerate() {
                    let lane = Lane::of(i, n, leaf.part(LAYOUT));
                    for (row, x) in corners.as_flattened_mut().iter_mut().enumerate() {
                        *x = f32::from_bits(words[lane.word(row)]);
                    }
                    *id = PrimId(words[lane.word(Lane::ID_ROW)]);
                }
            },
        );
        let (corners, ids) = all.into_iter().unzip();
        Self { corners, ids }
    }
}

/// Replaces the vertices of all leaves by those of `positions`; ids stay. Returns the content of each leaf.
///
/// Each leaf is read and written once, while it is in the cache. Every index is valid.
pub(super) fn replace(
    outline: &Outline,
    halves: &mut [Half],
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    frame: &MeshFrame,
) -> Vec<LeafContent> {
    let replace_leaf = |leaf: &LeafOutline, words: &mut [u32]| {
        let (n, part) = (leaf.places.len(), leaf.part(LAYOUT));
        let replaced = (0..n).map(|i| {
            let lane = Lane::of(i, n, part);
            let corners = triangles[words[lane.word(Lane::ID_ROW)] as usize].map(|vertex| positions[vertex as usize]);
            for (row, x) in corners.as_flattened().iter().enumerate() {
                words[lane.word(row)] = x.to_bits();
            }
            corners
        });
        LeafContent::of(replaced, frame)
    };
    let order = outline.leaves_by_unit();
    // Leaves that share a half-block are written by one job.
    let unit = |&leaf: &u32| outline.leaves[leaf as usize].unit(LAYOUT);
    let together: Vec<&[u32]> = order.chunk_by(|a, b| unit(a) == unit(b)).collect();
    let replace_leaves = |leaves: &&[u32], out: &mut [Half]| {
        let words: &mut [u32] = bytemuck::cast_slice_mut(out);
        let mut contents = [LeafContent::EMPTY; PARTS];
        for (content, &leaf) in contents.iter_mut().zip(*leaves) {
            *content = replace_leaf(&outline.leaves[leaf as usize], words);
        }
        contents
    };
    let of_units = par::map_pieces(&together, halves, |leaves| unit(&leaves[0]), replace_leaves);
    let mut contents = vec![LeafContent::EMPTY; outline.leaves.len()];
    for (leaves, of_unit) in together.iter().zip(of_units) {
        leaves.iter().zip(of_unit).for_each(|(&leaf, content)| contents[leaf as usize] = content);
    }
    contents
}

/// Whether all words of a leaf's unused lanes are zero; lanes of a part that no leaf shares are its own.
pub(crate) fn unused_lanes_are_zero(leaf: &LeafOutline, halves: &[Half]) -> bool {
    let (n, first) = (leaf.places.len(), leaf.unit(LAYOUT));
    let words: &[u32] = bytemuck::cast_slice(&halves[first..first + LAYOUT.n_units(n)]);
    let n_lanes = if leaf.is_shared { PART_LANES } else { n.next_multiple_of(4) };
    (n..n_lanes).all(|i| {
        // The lane of a triangle if its block were filled.
        let lane = Lane::of(i, n, leaf.part(LAYOUT));
        (0..=Lane::ID_ROW).all(|row| words[lane.word(row)] == 0)
    })
}

#[cfg(test)]
mod tests {
    use canted_obb::{Aabb, Obb};
    use canted_trace::ReferencePoint;

    use super::*;
    use crate::layout::MAX_LEAF;
    use crate::traverse::Block;

    /// Reads a leaf as the traversal does.
    fn traversed(halves: &[Half], n: usize) -> Vec<(Corners, PrimId)> {
        let mut triangles = vec![];
        for first in (0..n).step_by(8) {
            let block = Block::at(halves, first / 4, u32::try_from(n - first).unwrap());
            triangles.extend((0..(n - first).min(8)).map(|lane| (block.vertices(lane), block.primitive(lane))));
        }
        triangles
    }

    #[test]
    fn leaves_of_any_size_are_read_as_the_traversal_reads_them() {
        for n in 1..=MAX_LEAF {
            let n_halves = LAYOUT.n_units(n);
            let words: Vec<u32> = (0_u16..).take(n_halves * HALF_WORDS).map(|i| f32::from(i).to_bits()).collect();
            let mut halves: Vec<Half> = words.chunks_exact(HALF_WORDS).map(|w| Half(w.try_into().unwrap())).collect();
            let leaf = LeafOutline { first: 0, places: 0..n, is_shared: false };
            let outline = Outline { nodes: vec![], leaves: vec![leaf.clone()], n_places: n, depth: 0 };
            let read = Triangles::read(&outline, &halves);
            let want = traversed(&halves, n);
            assert_eq!(read.corners, want.iter().map(|t| t.0).collect::<Vec<_>>(), "{n}");
            assert_eq!(read.ids, want.iter().map(|t| t.1).collect::<Vec<_>>(), "{n}");
            // Ids that are also numbers of triangles, in another order.
            let ids: Vec<PrimId> = (0u32..).take(n).map(|i| PrimId((5 * i + 3) % 37)).collect();
            let words: &mut [u32] = bytemuck::cast_slice_mut(&mut halves);
            for (i, id) in ids.iter().enumerate() {
                words[Lane::of(i, n, 0).word(Lane::ID_ROW)] = id.0;
            }
            // Replaced and read again; only used lanes change.
            let moved: Vec<Corners> = read.corners.iter().map(|c| c.map(|p| p.map(|x| -x - 1.0))).collect();
            let mut triangles = [[u32::MAX; 3]; 37];
            for (first, id) in (0u32..).step_by(3).zip(&ids) {
                triangles[id.index()] = [first, first + 1, first + 2];
            }
            let frame = MeshFrame::new(Obb::IDENTITY_FRAME, ReferencePoint::ORIGIN);
            let contents = replace(&outline, &mut halves, moved.as_flattened(), &triangles, &frame);
            assert_eq!(contents[0].bounds, Aabb::from_points(moved.iter().flatten().copied()));
            assert_eq!(Triangles::read(&outline, &halves), Triangles { corners: moved, ids });
            assert_eq!(unused_lanes_are_zero(&leaf, &halves), n % 4 == 0, "{n}");
        }
    }
}
