//! Binary BVHs with every bounding-volume strategy.

use std::time::Instant;

use anyhow::Result;
use canted_bvh2::{OrientedLeaf, PairBvh, PairOrder};
use canted_lbvh::{self as lbvh, Bits, Costs, Domain, Strategy, Tree, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_scene::Scene;

/// One strategy on one level of BVHs.
#[derive(Clone, Copy, Default)]
pub(super) struct Row {
    /// Inner nodes.
    pub(super) nodes: usize,
    /// Nodes with an oriented volume.
    pub(super) oriented: usize,
    /// Sum of volumes, the scene scaled to the unit cube.
    pub(super) volume: f64,
    /// Sum of areas, the scene scaled to the unit cube.
    pub(super) area: f64,
    /// Cost by the surface area heuristic; over several BVHs, the mean weighted by root area.
    pub(super) sah: f64,
    /// Depth of the deepest BVH, leaf included.
    pub(super) depth: u32,
    /// Memory of the nodes.
    pub(super) bytes: usize,
    /// Milliseconds to fit all volumes.
    pub(super) volumes_ms: f64,
    /// Milliseconds to convert the nodes to their traced layout.
    pub(super) layout_ms: f64,
    /// Sum of the root areas, the weights of `sah`.
    root_area: f64,
}

/// Times of the passes that do not depend on the strategy.
#[derive(Clone, Copy, Default)]
pub(super) struct Passes {
    pub(super) gather_ms: f64,
    pub(super) codes_ms: f64,
    pub(super) sort_ms: f64,
    pub(super) tree_ms: f64,
}

/// Every strategy on one level of BVHs, in the order of [`Strategy::ALL`].
#[derive(Clone, Default)]
pub(super) struct Level {
    pub(super) passes: Passes,
    pub(super) rows: Vec<Row>,
}

/// All levels.
pub(super) struct BinaryStats {
    /// One BVH over all triangles in world space.
    pub(super) one: Level,
    /// One BVH per mesh.
    pub(super) bottom: Level,
    /// The BVH over the instances.
    pub(super) top: Level,
}

/// Builds the scene in one level and in two.
pub(super) fn measure(scene: &Scene) -> Result<BinaryStats> {
    let extent = scene.bounds_world().extent().into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let mut one = Level::default();
    add_mesh(&mut one, &positions, &triangles, extent)?;
    let mut bottom = Level::default();
    for (i, mesh) in scene.meshes.iter().enumerate() {
        add_mesh(&mut bottom, &mesh.positions, &mesh.triangles, extent / super::world_scale(scene, i))?;
    }
    let top = top_level(scene, extent);
    let mut measured = BinaryStats { one, bottom, top };
    for level in [&mut measured.one, &mut measured.bottom, &mut measured.top] {
        for row in &mut level.rows {
            row.sah /= row.root_area.max(f64::MIN_POSITIVE);
        }
    }
    Ok(measured)
}

fn add_mesh(level: &mut Level, positions: &[[f32; 3]], triangles: &[[u32; 3]], unit: f64) -> Result<()> {
    let ((corners, bounds), ms) = timed(|| lbvh::triangle_corners(positions, triangles).map_err(anyhow::Error::from))?;
    level.passes.gather_ms += ms;
    let (codes, ms) = timed(|| Ok(lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners)))?;
    level.passes.codes_ms += ms;
    let tree = sorted_tree(&mut level.passes, &codes);
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    add_rows(level, &tree, &sorted, &bounds, unit);
    Ok(())
}

fn top_level(scene: &Scene, unit: f64) -> Level {
    let mut level = Level::default();
    let mesh_bounds: Vec<Aabb> = scene
        .meshes
        .iter()
        .map(|mesh| Aabb::from_points(mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize])))
        .collect();
    let boxes: Vec<Obb> = scene
        .instances
        .iter()
        .map(|i| Obb::from_aabb(&mesh_bounds[i.mesh.0 as usize]).transformed(&i.world_from_object))
        .collect();
    let aabbs: Vec<Aabb> = boxes.iter().map(Obb::aabb).collect();
    let bounds = aabbs.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    let codes = lbvh::morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &aabbs);
    let tree = sorted_tree(&mut level.passes, &codes);
    let sorted: Vec<Obb> = tree.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    add_rows(&mut level, &tree, &sorted, &bounds, unit);
    level
}

fn sorted_tree(passes: &mut Passes, codes: &[u64]) -> Tree {
    let start = Instant::now();
    let sorted = lbvh::sort_by_code(codes, Bits::B63);
    passes.sort_ms += start.elapsed().as_secs_f64() * 1e3;
    let start = Instant::now();
    let tree = lbvh::radix(sorted);
    passes.tree_ms += start.elapsed().as_secs_f64() * 1e3;
    tree
}

fn add_rows<L: OrientedLeaf>(level: &mut Level, tree: &Tree, leaves: &[L], bounds: &Aabb, unit: f64) {
    level.rows.resize(Strategy::ALL.len(), Row::default());
    for (row, strategy) in level.rows.iter_mut().zip(Strategy::ALL) {
        let start = Instant::now();
        let volumes = lbvh::volumes(tree, leaves, &VolumeConfig { strategy, fallback: true });
        row.volumes_ms += start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let binary = PairBvh::new(tree, &volumes, leaves, bounds, PairOrder::Numbered);
        row.layout_ms += start.elapsed().as_secs_f64() * 1e3;
        let sums = lbvh::tree_cost(tree, &volumes, leaves, &Costs::default(), unit);
        let root_area = binary.bounds().area() / (unit * unit);
        row.nodes += sums.n_nodes;
        row.oriented += sums.n_oriented;
        row.volume += sums.volume;
        row.area += sums.area;
        row.sah += sums.sah * root_area;
        row.root_area += root_area;
        row.depth = row.depth.max(tree.depth);
        row.bytes += binary.n_bytes();
    }
}

fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, f64)> {
    let start = Instant::now();
    let value = work()?;
    Ok((value, start.elapsed().as_secs_f64() * 1e3))
}
