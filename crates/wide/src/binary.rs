//! Which binary tree is collapsed, in which frame its boxes are aligned, and whether nodes may be oriented.
//!
//! A tree over groups of primitives is quick to build and good for aligned nodes. Only where a sample of its subtrees shows
//! that oriented nodes may pay, trees with a primitive per leaf are built, and frames for them.

use std::ops::Range;

use canted_lbvh::{NodeId, Tree};
use canted_obb::{Aabb, Obb, PrimId};
use canted_sah::{Builder, GroupConfig, Groups};

use crate::collapse::{ALIGNED, Areas, BOTH, Plan, Table, positive, tables};
use crate::config::Config;
use crate::costs::Costs;
use crate::frames::mesh_frame::{self, MeshFrameConfig};
use crate::frames::{self, BoxAreas, Fits, FrameConfig};
use crate::item::{self, Item, Items};
use crate::measure::{self, Aligned};
use crate::members::Members;
use crate::par;
use crate::sample;

/// The mesh is rotated where the cost of a quickly built tree falls to this part.
const MAX_ROTATED_COST: f32 = 0.87;

/// Trees that show whether a rotation pays.
const QUICK: GroupConfig = GroupConfig { improvement: None, ..GroupConfig::FAST };

/// Nodes may be oriented where that lowers the predicted cost to this part: closer to 1, the prediction is not reliable.
pub(crate) const MAX_ORIENTED_COST: f32 = 0.92;

/// Primitives of one job.
const CHUNK: usize = 1 << 13;

/// A binary tree over primitives, what it is collapsed by, and the costs of that.
pub(crate) struct Chosen<S: Items> {
    /// In input order.
    pub(crate) items: S,
    pub(crate) tree: Tree,
    /// `None` where each leaf is one primitive.
    pub(crate) groups: Option<Groups>,
    /// Whether leaves may share a primitive.
    pub(crate) is_shared: bool,
    /// Rows of the frame of its boxes.
    pub(crate) rows: [[f32; 3]; 3],
    pub(crate) aligned: Aligned,
    /// Of collapses into aligned nodes only.
    pub(crate) aligned_tables: Vec<Table<ALIGNED>>,
    pub(crate) oriented: Option<Oriented<S::Item>>,
}

/// Frames, and the collapses that may use them.
pub(crate) struct Oriented<I> {
    /// The primitives in leaf order.
    pub(crate) sorted: Vec<I>,
    pub(crate) fits: Fits,
    pub(crate) tables: Vec<Table<BOTH>>,
}

impl<S: Items> Chosen<S> {
    /// A tree over `items` with boxes along `rows`; leaves are groups, or else primitives.
    pub(crate) fn of(
        (tree, mut groups): (Tree, Option<Groups>),
        items: S,
        boxes: &[Aabb],
        rows: [[f32; 3]; 3],
        scale: f32,
        costs: &Costs,
    ) -> Self {
        let aligned = match &mut groups {
            Some(groups) => Aligned::of_leaves(&tree, std::mem::take(&mut groups.boxes), scale),
            None => Aligned::of(&tree, boxes, scale),
        };
        let (aligned_tables, oriented) = (vec![], None);
        let mut chosen = Self { items, tree, groups, is_shared: false, rows, aligned, aligned_tables, oriented };
        chosen.aligned_tables = chosen.tables_of_aligned(costs);
        chosen
    }

    fn tables_of_aligned(&self, costs: &Costs) -> Vec<Table<ALIGNED>> {
        tables_of_aligned(&self.tree, self.members(), &self.aligned, costs)
    }

    /// Finds frames and plans with oriented nodes; each leaf must be one primitive.
    fn fit(&mut self, config: &Config, scale: f32) {
        let areas = BoxAreas { inner: &self.aligned.inner_areas, leaf: &self.aligned.leaf_areas };
        let sorted = self.sorted(0..self.primitives().len());
        let fits = frames::fit(&self.tree, &S::Item::fitted(&sorted, scale), self.rows, &areas, &FrameConfig::default());
        let inner = |id: NodeId| both(self.aligned.inner_areas[id.index()], fits.inner[id.index()].half_area);
        let leaf = |i: usize| both(self.aligned.leaf_areas[i], fits.leaf[i].half_area);
        let tables = tables(&self.tree, self.members(), inner, leaf, &config.costs);
        self.oriented = Some(Oriented { sorted, fits, tables });
    }

    /// The primitives of each leaf.
    pub(crate) fn members(&self) -> Members<'_> {
        self.groups.as_ref().map_or(Members::One, |groups| Members::Groups(&groups.starts))
    }

    /// The primitive of each place in leaf order.
    pub(crate) fn primitives(&self) -> &[PrimId] {
        self.groups.as_ref().map_or(&self.tree.leaves, |groups| &groups.primitives)
    }

    /// The primitives of a range of places.
    pub(crate) fn sorted(&self, places: Range<usize>) -> Vec<S::Item> {
        par::map(&self.primitives()[places], CHUNK, |primitive| self.items.get(primitive.index()))
    }

    /// Areas of a leaf for a plan of aligned nodes.
    pub(crate) fn aligned_leaf(&self, i: usize) -> Areas<ALIGNED> {
        [positive(self.aligned.leaf_areas[i])]
    }

    /// Areas of a leaf for a plan of both kinds; without frames as for aligned nodes.
    pub(crate) fn both_leaf(&self, i: usize) -> Areas<BOTH> {
        let aligned = self.aligned.leaf_areas[i];
        both(aligned, self.oriented.as_ref().map_or(aligned, |oriented| oriented.fits.leaf[i].half_area))
    }

    /// Predicted cost with aligned nodes only, in tests of aligned nodes times area.
    pub(crate) fn aligned_cost(&self, costs: &Costs) -> f32 {
        root_cost(&self.tree, self.members(), &self.aligned, &self.aligned_tables, costs)
    }

    /// The same of the cheaper of both plans.
    fn cost(&self, costs: &Costs) -> f32 {
        self.oriented_cost(costs).unwrap_or(f32::INFINITY).min(self.aligned_cost(costs))
    }

    /// The same where nodes may be oriented.
    fn oriented_cost(&self, costs: &Costs) -> Option<f32> {
        let tables = &self.oriented.as_ref()?.tables;
        let leaf_areas = |i: usize| self.both_leaf(i);
        let (tree, members) = (&self.tree, self.members());
        let plan = Plan { tree, members, costs: *costs, tables, leaf_areas: &leaf_areas };
        Some(tree.root().map_or(0.0, |root| plan.cost(root)))
    }
}

fn tables_of_aligned(tree: &Tree, members: Members, aligned: &Aligned, costs: &Costs) -> Vec<Table<ALIGNED>> {
    let inner = |id: NodeId| [positive(aligned.inner_areas[id.index()])];
    tables(tree, members, inner, |i| [positive(aligned.leaf_areas[i])], costs)
}

/// Predicted cost of aligned nodes, whose tables these are.
fn root_cost(tree: &Tree, members: Members, aligned: &Aligned, tables: &[Table<ALIGNED>], costs: &Costs) -> f32 {
    let leaf_areas = |i: usize| [positive(aligned.leaf_areas[i])];
    let plan = Plan { tree, members, costs: *costs, tables, leaf_areas: &leaf_areas };
    tree.root().map_or(0.0, |root| plan.cost(root))
}

/// Areas of a box in the mesh frame and in its own.
fn both(aligned: f32, oriented: f32) -> Areas<BOTH> {
    let aligned = positive(aligned);
    [aligned, positive(oriented).min(aligned)]
}

/// Builds the binary tree over `items`, which `bounds` enclose.
pub(crate) fn choose<S: Items>(items: S, bounds: &Aabb, config: &Config) -> Chosen<S> {
    let scale = measure::unit_scale(bounds);
    let unrotated = item::boxes(items, Obb::IDENTITY_FRAME);
    let candidates = if config.rotate_mesh {
        mesh_frame::candidates(items.n(), &|i| items.get(i).edges(), &MeshFrameConfig::default())
    } else {
        vec![]
    };
    let boxes_along = |rows: &[[f32; 3]; 3]| item::boxes(items, *rows);
    let (rows, boxes) = match rotation(candidates, &unrotated, &boxes_along, scale, config) {
        Some(rows) => (rows, boxes_along(&rows)),
        None => (Obb::IDENTITY_FRAME, unrotated),
    };
    let costs = &config.costs;
    if let Some(groups) = config.groups {
        // Boxes are made again in the few cases that need them: they take half the memory of a BVH.
        let (tree, groups) = canted_sah::grouped(boxes, &limited(groups, costs));
        let coarse = Chosen::of((tree, Some(groups)), items, &[], rows, scale, costs);
        if !config.oriented || sample::oriented_cost(&coarse, config, scale) > sample::MAX_COST {
            return coarse;
        }
        let full = full(items, &boxes_along(&rows), rows, scale, config);
        return oriented_or(full, coarse, costs);
    }
    let full = full(items, &boxes, rows, scale, config);
    let is_worth_it =
        full.oriented_cost(costs).is_some_and(|cost| cost <= MAX_ORIENTED_COST * full.aligned_cost(costs));
    Chosen { oriented: if is_worth_it { full.oriented } else { None }, ..full }
}

/// Groups that fit into leaves.
fn limited(groups: GroupConfig, costs: &Costs) -> GroupConfig {
    GroupConfig { max_group: groups.max_group.min(costs.max_leaf as u32), ..groups }
}

/// `full` with oriented nodes where that is worth it, else the cheaper tree with aligned ones.
fn oriented_or<S: Items>(full: Chosen<S>, coarse: Chosen<S>, costs: &Costs) -> Chosen<S> {
    let [of_full, of_coarse] = [&full, &coarse].map(|chosen| chosen.aligned_cost(costs));
    if full.oriented_cost(costs).is_some_and(|cost| cost <= MAX_ORIENTED_COST * of_full.min(of_coarse)) {
        return full;
    }
    if of_full < of_coarse { Chosen { oriented: None, ..full } } else { coarse }
}

/// Builds trees with a primitive per leaf, and frames where nodes may be oriented; returns the cheaper one.
pub(crate) fn full<S: Items>(items: S, boxes: &[Aabb], rows: [[f32; 3]; 3], scale: f32, config: &Config) -> Chosen<S> {
    let built = |builder: &Builder| {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let tree = canted_sah::build(boxes, &bounds, builder);
        let mut chosen = Chosen::of((tree, None), items, boxes, rows, scale, &config.costs);
        if config.oriented {
            chosen.fit(config, scale);
        }
        chosen
    };
    let first = || built(&config.builder);
    let Some(alternative) = &config.alternative_builder else { return first() };
    // Each has serial parts of its own.
    let (first, alternative) = par::join(first, || built(alternative));
    // Compared as they would be built: at their leaf sizes, with their frames.
    if alternative.cost(&config.costs) < first.cost(&config.costs) { alternative } else { first }
}

/// A tree of any builder, with oriented nodes where that is worth it. `parts` are the boxes of the leaves, in leaf order, where they
/// hold parts of primitives.
pub(crate) fn over_tree<S: Items>(
    tree: Tree,
    parts: Option<Vec<Aabb>>,
    items: S,
    bounds: &Aabb,
    config: &Config,
) -> Chosen<S> {
    let (scale, rows) = (measure::unit_scale(bounds), Obb::IDENTITY_FRAME);
    let aligned = match parts {
        Some(parts) => Aligned::of_leaves(&tree, parts, scale),
        None => Aligned::of(&tree, &item::boxes(items, rows), scale),
    };
    // Trees with spatial splits have several references to a primitive.
    let (groups, is_shared, aligned_tables, oriented) = (None, true, vec![], None);
    let mut chosen = Chosen { items, tree, groups, is_shared, rows, aligned, aligned_tables, oriented };
    chosen.aligned_tables = chosen.tables_of_aligned(&config.costs);
    if config.oriented {
        chosen.fit(config, scale);
        let most = MAX_ORIENTED_COST * chosen.aligned_cost(&config.costs);
        chosen.oriented = chosen.oriented_cost(&config.costs).filter(|&cost| cost <= most).and(chosen.oriented);
    }
    chosen
}

/// Predicted costs of a subset of the mesh, in a tree of its own: with aligned nodes only, and with oriented ones.
pub(crate) fn costs_of_subset<I: Item>(items: &[I], rows: [[f32; 3]; 3], scale: f32, config: &Config) -> [f32; 2] {
    let boxes = item::boxes(items, rows);
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let tree = canted_sah::build(&boxes, &bounds, &sample::BUILDER);
    let mut chosen = Chosen::of((tree, None), items, &boxes, rows, scale, &config.costs);
    chosen.fit(config, scale);
    [chosen.aligned_cost(&config.costs), chosen.cost(&config.costs)]
}

/// The candidate in which a quickly built tree is so much cheaper that the mesh is rotated; `None` for the axes of the space.
fn rotation(
    candidates: Vec<[[f32; 3]; 3]>,
    unrotated: &[Aabb],
    boxes_along: &(dyn Fn(&[[f32; 3]; 3]) -> Vec<Aabb> + Sync),
    scale: f32,
    config: &Config,
) -> Option<[[f32; 3]; 3]> {
    if candidates.is_empty() {
        return None;
    }
    let quick = |boxes: &[Aabb]| {
        let (tree, groups) = canted_sah::grouped(boxes, &limited(QUICK, &config.costs));
        let aligned = Aligned::of_leaves(&tree, groups.boxes, scale);
        let members = Members::Groups(&groups.starts);
        root_cost(&tree, members, &aligned, &tables_of_aligned(&tree, members, &aligned, &config.costs), &config.costs)
    };
    let (unrotated, rotated) =
        par::join(|| quick(unrotated), || par::map(&candidates, 1, |rows| quick(&boxes_along(rows))));
    let (least, rows) = rotated.into_iter().zip(candidates).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (least <= MAX_ROTATED_COST * unrotated).then_some(rows)
}

#[cfg(test)]
mod tests;
