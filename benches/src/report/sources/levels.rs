//! Two levels compared with one: the dissertation's table 4, parts 3a and 3b.

use std::collections::HashMap;

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_lbvh::{Bits, Costs, Domain, Strategy, Tree, TreeCost, VolumeConfig};
use canted_obb::{Aabb, Obb};

use super::orders::Found;
use super::scenes;
use crate::models::{self, Model};
use crate::report::{
    effort::Effort,
    model::{Cell, Chapter, Table},
    samples::number,
};

/// The dissertation's scene with two levels.
const SPONZA: &str = "sponza";

/// The dissertation's Sponza: sum of volumes of both levels, percentage of oriented nodes of the top and bottom levels.
const THEIRS: [(Strategy, f64, Option<f64>, Option<f64>); 4] = [
    (Strategy::Aabb, 2.507_26, None, None),
    (Strategy::PcaUnbounded, 2.506_91, None, Some(94.2567)),
    (Strategy::PcaBounded, 2.506_93, Some(10.7143), Some(60.4837)),
    (Strategy::Quaternion, 2.506_93, Some(13.7755), Some(60.3462)),
];

/// The dissertation's sum for axis-aligned boxes in one level.
const THEIR_ONE_LEVEL: f64 = 5.330_77;

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut found = Found::default();
    for (name, model) in scenes(effort, &[SPONZA], chapter)? {
        let pieces = meshes(name, &model)?;
        let title = format!("Two levels (table 4, 3a and 3b): {name} in {} meshes, theirs in 393", pieces.len());
        let head = [
            "strategy",
            "volume over one level, theirs",
            "ours",
            "over axis-aligned, theirs",
            "ours",
            "top oriented, theirs",
            "ours",
            "bottom oriented, theirs",
            "ours",
        ];
        let mut table = Table::new(title, &head);
        let unit = model.mesh.diagonal();
        let one = bottom(&model.mesh, Strategy::Aabb, unit)?.0.volume;
        let mut aligned = f64::NAN;
        let (mut volumes, mut oriented_bottom) = (vec![], vec![]);
        for (strategy, their_volume, their_top, their_bottom) in THEIRS {
            let (top, bottom) = two_levels(&pieces, strategy, unit)?;
            let volume = top.volume + bottom.volume;
            if strategy == Strategy::Aabb {
                aligned = volume;
                found.says = format!(
                    "On {name}, two levels have {} times the volume of axis-aligned boxes in one level here, {} times in the dissertation.",
                    number(volume / one),
                    number(their_volume / THEIR_ONE_LEVEL)
                );
            }
            if name == SPONZA {
                volumes.push([their_volume, volume]);
                oriented_bottom.extend(their_bottom.map(|theirs| [theirs, oriented_percent(&bottom)]));
            }
            let percent = |theirs: Option<f64>| theirs.map_or_else(|| "–".to_owned(), |p| format!("{p:.1}%"));
            let oriented = |sums: &TreeCost| format!("{:.1}%", oriented_percent(sums));
            let cells = [
                format!("{strategy:?}"),
                format!("{:.3}", their_volume / THEIR_ONE_LEVEL),
                format!("{:.3}", volume / one),
                format!("{:.5}", their_volume / THEIRS[0].1),
                format!("{:.5}", volume / aligned),
                percent(their_top),
                oriented(&top),
                percent(their_bottom),
                oriented(&bottom),
            ];
            table.rows.push(cells.map(Cell::text).to_vec());
        }
        table.says = format!(
            "{} In both levels and for all strategies, the root box of a mesh is the axis-aligned box of its triangles.",
            found.says
        );
        chapter.tables.push(table);
        found.compared.extend([volumes, oriented_bottom]);
    }
    Ok(found)
}

#[expect(clippy::cast_precision_loss, reason = "counts of nodes")]
fn oriented_percent(sums: &TreeCost) -> f64 {
    100.0 * sums.n_oriented as f64 / sums.n_nodes.max(1) as f64
}

/// The meshes of the scene's file in world space, or the struts of a generated lattice.
pub(super) fn meshes(name: &str, model: &Model) -> Result<Vec<Mesh>> {
    let scene = if name == SPONZA { models::scene(name)? } else { None };
    Ok(match scene {
        Some(scene) => cut(canted_renderer::flatten(&scene)?),
        None => pieces(&model.mesh),
    })
}

/// Triangles in runs that begin at the given ones.
fn cut((positions, triangles, first): canted_renderer::Flattened) -> Vec<Mesh> {
    let ends = first[1..].iter().map(|&end| end as usize).chain([triangles.len()]);
    let runs = first.iter().zip(ends).map(|(&first, end)| &triangles[first as usize..end]);
    runs.filter(|run| !run.is_empty()).map(|run| of_corners(&positions, run)).collect()
}

/// A mesh with separate vertices for every corner.
fn of_corners(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    let mut mesh = Mesh { positions: vec![], triangles: vec![] };
    triangles.iter().for_each(|triangle| add_triangle(&mut mesh, triangle.map(|i| positions[i as usize])));
    mesh
}

fn add_triangle(mesh: &mut Mesh, corners: [[f32; 3]; 3]) {
    #[expect(clippy::cast_possible_truncation, reason = "no more than three times the triangles, which u32 counts")]
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    mesh.triangles.push([first, first + 1, first + 2]);
}

/// Sums of the tree over the pieces, and of the trees of all pieces.
fn two_levels(pieces: &[Mesh], strategy: Strategy, unit: f64) -> Result<(TreeCost, TreeCost)> {
    let mut all = TreeCost::default();
    let mut roots = vec![];
    for piece in pieces {
        let (sums, root) = bottom(piece, strategy, unit)?;
        all.n_nodes += sums.n_nodes;
        all.n_oriented += sums.n_oriented;
        all.volume += sums.volume;
        roots.push(root);
    }
    let boxes: Vec<Aabb> = roots.iter().map(Obb::aabb).collect();
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    let tree = radix(&canted_lbvh::morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes));
    let sorted: Vec<Obb> = tree.leaves.iter().map(|leaf| roots[leaf.index()]).collect();
    let volumes = canted_lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
    Ok((canted_lbvh::tree_cost(&tree, &volumes, &sorted, &Costs::default(), unit), all))
}

/// Sums of a piece's tree, and the box of the piece as the level above sees it.
fn bottom(piece: &Mesh, strategy: Strategy, unit: f64) -> Result<(TreeCost, Obb)> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&piece.positions, &piece.triangles)?;
    let tree = radix(&canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners));
    let sorted = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
    let volumes = canted_lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
    Ok((canted_lbvh::tree_cost(&tree, &volumes, &sorted, &Costs::default(), unit), Obb::from_aabb(&bounds)))
}

fn radix(codes: &[u64]) -> Tree {
    canted_lbvh::radix(canted_lbvh::sort_by_code(codes, Bits::B63))
}

/// The connected components of a mesh, in the order of their first triangles.
fn pieces(mesh: &Mesh) -> Vec<Mesh> {
    let mut first_at = HashMap::new();
    let welded: Vec<usize> = (0..)
        .zip(&mesh.positions)
        .map(|(i, position)| *first_at.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(i))
        .collect();
    let mut parents: Vec<usize> = (0..mesh.positions.len()).collect();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| root(&mut parents, welded[i as usize]));
        parents[b] = a;
        let c = root(&mut parents, c);
        parents[c] = a;
    }
    let mut places = HashMap::new();
    let mut pieces: Vec<Mesh> = vec![];
    for triangle in &mesh.triangles {
        let n = pieces.len();
        let place = *places.entry(root(&mut parents, welded[triangle[0] as usize])).or_insert(n);
        if place == n {
            pieces.push(Mesh { positions: vec![], triangles: vec![] });
        }
        add_triangle(&mut pieces[place], triangle.map(|i| mesh.positions[i as usize]));
    }
    pieces
}

/// The representative vertex of a piece (union-find with path halving).
fn root(parents: &mut [usize], mut vertex: usize) -> usize {
    while parents[vertex] != vertex {
        parents[vertex] = parents[parents[vertex]];
        vertex = parents[vertex];
    }
    vertex
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_split_at_its_meshes() {
        let positions = (0..4u8).map(|i| [f32::from(i); 3]).collect();
        let meshes = cut((positions, vec![[0, 1, 2], [1, 2, 3], [0, 2, 3]], vec![0, 2, 2]));
        let counts: Vec<usize> = meshes.iter().map(|mesh| mesh.triangles.len()).collect();
        assert_eq!((counts, meshes[1].positions.clone()), (vec![2, 1], vec![[0.0; 3], [2.0; 3], [3.0; 3]]));
    }

    #[test]
    fn pieces_share_no_vertex() {
        // Two triangles that share an edge, and a distant one.
        let positions =
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0; 3], [1.0, 0.0, 0.0], [-0.0, 1.0, 0.0], [1.0; 3]];
        let triangles = vec![[0, 1, 2], [3, 3, 3], [4, 5, 6]];
        let counts: Vec<usize> = pieces(&Mesh { positions, triangles }).iter().map(|p| p.triangles.len()).collect();
        assert_eq!(counts, [2, 1]);
    }
}
