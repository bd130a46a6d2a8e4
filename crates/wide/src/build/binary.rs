//! Which binary tree is collapsed, in which frame its boxes are aligned, and whether nodes may be oriented.
//!
//! A tree over groups of primitives is quick to build and good for aligned nodes. Only where a sample of its subtrees shows
//! that oriented nodes may pay, trees with a primitive per leaf are built, and frames for them; over other primitives than triangles, a
//! tree over groups of two with these divided.
//!
//! Frames and their plan take longer than all the rest of a quick build, and on scans, terrain and architecture the plan then
//! has few oriented nodes or none. So subtrees are sampled, in proportion to their cost; each is built again with a
//! primitive per leaf, and planned with frames and without. The result is the same for any number of threads.

use std::ops::Range;

use canted_lbvh::{Child, ChildKind, NodeId, Tree, stages::stage};
use canted_obb::{Aabb, Obb, PrimId};
use canted_sah::{Axes, Builder, GroupConfig, Groups, Split, TopDownConfig};

use crate::build::collapse::{ALIGNED, Areas, BOTH, Plan, PlanCosts, Table, positive, tables};
use crate::build::frames::mesh_frame::{self, MeshFrameConfig};
use crate::build::frames::{BoxAreas, Fits};
use crate::build::item::{self, Item, Items};
use crate::build::subtrees;
use crate::build::subtrees::{Aligned, LeafContents};
use crate::config::{Config, Costs};
use crate::node::NodeKind;
use crate::par;

/// The mesh is rotated where the cost of a quickly built tree falls to this part.
const MAX_ROTATED_COST: f32 = 0.87;

/// Trees that show whether a rotation pays.
const QUICK: GroupConfig = GroupConfig { improvement: None, ..GroupConfig::FAST };

/// Nodes may be oriented where that lowers the predicted cost to this part: closer to 1, the prediction is not reliable.
pub(crate) const MAX_ORIENTED_COST: f32 = 0.92;

/// Primitives of one job.
const CHUNK: usize = 1 << 13;

/// A binary tree over primitives, what it is collapsed by, and the costs of that.
pub(crate) struct Chosen<'a, I: Item> {
    /// In input order.
    pub(crate) items: Items<'a, I>,
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
    pub(crate) oriented: Option<Oriented<I>>,
}

/// Frames, and the collapses that may use them.
pub(crate) struct Oriented<I> {
    /// The primitives in leaf order.
    pub(crate) sorted: Vec<I>,
    pub(crate) fits: Fits,
    pub(crate) tables: Vec<Table<BOTH>>,
    /// [`PlanCosts::line`] of the tables.
    pub(crate) line_cost: f32,
}

impl<'a, I: Item> Chosen<'a, I> {
    /// A tree over `items` with boxes along `rows`; leaves are groups, or else primitives.
    pub(crate) fn of(
        (tree, mut groups): (Tree, Option<Groups>),
        items: Items<'a, I>,
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
        chosen.aligned_tables = stage("plan", || chosen.tables_of_aligned(costs));
        chosen
    }

    fn tables_of_aligned(&self, costs: &Costs) -> Vec<Table<ALIGNED>> {
        tables_of_aligned(&self.tree, self.members(), &self.aligned, costs)
    }

    /// Finds frames and plans with oriented nodes; each leaf must be one primitive.
    fn fit(&mut self, config: &Config, scale: f32) {
        let areas = BoxAreas { inner: &self.aligned.inner_areas, leaf: &self.aligned.leaf_areas };
        let sorted = self.sorted(0..self.primitives().len());
        let fits = stage("frames of nodes", || I::fits(&sorted, scale, &self.tree, self.rows, &areas));
        let inner = |id: NodeId| both(self.aligned.inner_areas[id.index()], fits.inner[id.index()].half_area);
        let leaf = |i: usize| both(self.aligned.leaf_areas[i], fits.leaf[i].half_area);
        let n_lines = NodeKind::Aligned.n_lines() * self.primitives().len().max(1);
        let line = I::MEMORY_COST * self.aligned_cost(&config.costs) / n_lines as f32;
        // Nodes that are disabled have infinite costs.
        let line = if line.is_finite() { line } else { 0.0 };
        let costs = PlanCosts { rays: config.costs, line };
        let tables = stage("plan", || tables(&self.tree, self.members(), inner, leaf, &costs));
        self.oriented = Some(Oriented { sorted, fits, tables, line_cost: line });
    }

    /// The primitives of each leaf.
    pub(crate) fn members(&self) -> LeafContents<'_> {
        self.groups.as_ref().map_or(LeafContents::Single, |groups| LeafContents::Groups(&groups.starts))
    }

    /// The primitive of each place in leaf order.
    pub(crate) fn primitives(&self) -> &[PrimId] {
        self.groups.as_ref().map_or(&self.tree.leaves, |groups| &groups.primitives)
    }

    /// The primitives of a range of places.
    pub(crate) fn sorted(&self, places: Range<usize>) -> Vec<I> {
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

    /// The same where nodes may be oriented, with the cost of their memory.
    fn oriented_cost(&self, costs: &Costs) -> Option<f32> {
        let Oriented { tables, line_cost: line, .. } = self.oriented.as_ref()?;
        let leaf_areas = |i: usize| self.both_leaf(i);
        let (tree, members) = (&self.tree, self.members());
        let costs = PlanCosts { rays: *costs, line: *line };
        let plan = Plan { tree, members, costs, tables, leaf_areas: &leaf_areas };
        Some(tree.root().map_or(0.0, |root| plan.cost(root)))
    }
}

fn tables_of_aligned(tree: &Tree, members: LeafContents, aligned: &Aligned, costs: &Costs) -> Vec<Table<ALIGNED>> {
    let inner = |id: NodeId| [positive(aligned.inner_areas[id.index()])];
    tables(tree, members, inner, |i| [positive(aligned.leaf_areas[i])], &PlanCosts::of_rays(costs))
}

/// Predicted cost of aligned nodes, whose tables these are.
fn root_cost(tree: &Tree, members: LeafContents, aligned: &Aligned, tables: &[Table<ALIGNED>], costs: &Costs) -> f32 {
    let leaf_areas = |i: usize| [positive(aligned.leaf_areas[i])];
    let plan = Plan { tree, members, costs: PlanCosts::of_rays(costs), tables, leaf_areas: &leaf_areas };
    tree.root().map_or(0.0, |root| plan.cost(root))
}

/// Areas of a box in the mesh frame and in its own.
fn both(aligned: f32, oriented: f32) -> Areas<BOTH> {
    let aligned = positive(aligned);
    [aligned, positive(oriented).min(aligned)]
}

/// Builds the binary tree over `items`, which `bounds` enclose.
pub(crate) fn choose<'a, I: Item>(items: Items<'a, I>, bounds: &Aabb, config: &Config) -> Chosen<'a, I> {
    let scale = subtrees::unit_scale(bounds);
    let unrotated = stage("boxes", || item::boxes(items, Obb::IDENTITY_FRAME));
    let candidates = if config.rotate_mesh {
        mesh_frame::candidates(items.n(), &|i| items.get(i).edges(), &MeshFrameConfig::default())
    } else {
        vec![]
    };
    let boxes_along = |rows: &[[f32; 3]; 3]| item::boxes(items, *rows);
    let turned = stage("frame of the mesh", || rotation(candidates, &unrotated, &boxes_along, scale, config));
    let (rows, boxes) = match turned {
        Some(rows) => (rows, boxes_along(&rows)),
        None => (Obb::IDENTITY_FRAME, unrotated),
    };
    let costs = &config.costs;
    let max_oriented = if I::REFINES_GROUPS { config.max_oriented_cost } else { MAX_ORIENTED_COST };
    if let Some(config_of_groups) = config.groups {
        // Boxes are made again in the few cases that need them: they take half the memory of a BVH.
        let (tree, groups) = canted_sah::grouped(boxes, &limited(config_of_groups, costs));
        let coarse = Chosen::of((tree, Some(groups)), items, &[], rows, scale, costs);
        let most = if I::REFINES_GROUPS { max_oriented } else { MAX_SAMPLED_COST };
        let sampled = || sampled_cost(&coarse, config, scale);
        if !config.oriented || stage("sample of oriented nodes", sampled) > most {
            return coarse;
        }
        let boxes = boxes_along(&rows);
        let of_pairs = || {
            let config = GroupConfig { max_group: 2, max_run: 2, ..config_of_groups };
            let (tree, groups) = canted_sah::grouped(&boxes, &config);
            refined(&tree, &groups)
        };
        let groups = coarse.groups.as_ref().filter(|_| I::REFINES_GROUPS);
        let full = match groups.and_then(|groups| refined(&coarse.tree, groups).or_else(of_pairs)) {
            Some(tree) => fitted(tree, items, &boxes, rows, scale, config),
            None => full(items, &boxes, rows, scale, config),
        };
        return oriented_or(full, coarse, max_oriented, costs);
    }
    let full = full(items, &boxes, rows, scale, config);
    let is_worth_it = full.oriented_cost(costs).is_some_and(|cost| cost <= max_oriented * full.aligned_cost(costs));
    Chosen { oriented: if is_worth_it { full.oriented } else { None }, ..full }
}

/// The tree with a primitive per leaf that has the nodes of one over groups, where these have at most two primitives.
fn refined(tree: &Tree, Groups { primitives, starts, .. }: &Groups) -> Option<Tree> {
    if starts.windows(2).any(|ends| ends[1] - ends[0] > 2) {
        return None;
    }
    // Nodes over groups of two have the numbers after all others.
    let n_nodes = tree.nodes.len();
    let below = |child: Child| match child.kind() {
        ChildKind::Leaf(group) if starts[group as usize + 1] - starts[group as usize] == 1 => {
            Child::leaf(starts[group as usize])
        }
        ChildKind::Leaf(group) => Child::inner(NodeId(n_nodes as u32 + group)),
        ChildKind::Inner(_) => child,
    };
    let children = |id: NodeId| match tree.nodes.get(id.index()) {
        Some(node) => [below(node.left), below(node.right)],
        None => [0, 1].map(|i| Child::leaf(starts[id.index() - n_nodes] + i)),
    };
    let ChildKind::Inner(root) = below(tree.root()?).kind() else { return None };
    Some(Tree::numbered(primitives.len(), root, children, |place| primitives[place as usize]))
}

/// Groups that fit into leaves.
fn limited(groups: GroupConfig, costs: &Costs) -> GroupConfig {
    GroupConfig { max_group: groups.max_group.min(costs.max_leaf as u32), ..groups }
}

/// `full` with oriented nodes where they cost at most this part, else the cheaper tree with aligned ones.
fn oriented_or<'a, I: Item>(full: Chosen<'a, I>, coarse: Chosen<'a, I>, most: f32, costs: &Costs) -> Chosen<'a, I> {
    let [of_full, of_coarse] = [&full, &coarse].map(|chosen| chosen.aligned_cost(costs));
    if full.oriented_cost(costs).is_some_and(|cost| cost <= most * of_full.min(of_coarse)) {
        return full;
    }
    if of_full < of_coarse { Chosen { oriented: None, ..full } } else { coarse }
}

/// Builds trees with a primitive per leaf, and frames where nodes may be oriented; returns the cheaper one.
pub(crate) fn full<'a, I: Item>(
    items: Items<'a, I>,
    boxes: &[Aabb],
    rows: [[f32; 3]; 3],
    scale: f32,
    config: &Config,
) -> Chosen<'a, I> {
    let built = |builder: &Builder| {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        fitted(canted_sah::build(boxes, &bounds, builder), items, boxes, rows, scale, config)
    };
    let first = || built(&config.builder);
    let Some(alternative) = &config.alternative_builder else { return first() };
    // Each has serial parts of its own.
    let (first, alternative) = par::join_stages(first, || built(alternative));
    // Compared as they would be built: at their leaf sizes, with their frames.
    if alternative.cost(&config.costs) < first.cost(&config.costs) { alternative } else { first }
}

/// A tree with a primitive per leaf, and frames where nodes may be oriented.
fn fitted<'a, I: Item>(
    tree: Tree,
    items: Items<'a, I>,
    boxes: &[Aabb],
    rows: [[f32; 3]; 3],
    scale: f32,
    config: &Config,
) -> Chosen<'a, I> {
    let mut chosen = Chosen::of((tree, None), items, boxes, rows, scale, &config.costs);
    if config.oriented {
        chosen.fit(config, scale);
    }
    chosen
}

/// A tree of any builder, with oriented nodes where that is worth it. `parts` are the boxes of the leaves, in leaf order, where they
/// hold parts of primitives.
pub(crate) fn over_tree<'a, I: Item>(
    tree: Tree,
    parts: Option<Vec<Aabb>>,
    items: Items<'a, I>,
    bounds: &Aabb,
    config: &Config,
) -> Chosen<'a, I> {
    let (scale, rows) = (subtrees::unit_scale(bounds), Obb::IDENTITY_FRAME);
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
    let items = Items::Array(items);
    let boxes = item::boxes(items, rows);
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let tree = canted_sah::build(&boxes, &bounds, &SAMPLE_BUILDER);
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
        let members = LeafContents::Groups(&groups.starts);
        root_cost(&tree, members, &aligned, &tables_of_aligned(&tree, members, &aligned, &config.costs), &config.costs)
    };
    let (unrotated, rotated) =
        par::join(|| quick(unrotated), || par::map(&candidates, 1, |rows| quick(&boxes_along(rows))));
    let (least, rows) = rotated.into_iter().zip(candidates).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (least <= MAX_ROTATED_COST * unrotated).then_some(rows)
}

/// Frames are found for the whole mesh where the estimate is at most this part of the cost of aligned nodes. The sample does
/// not see nodes above its subtrees, so it may miss some of the gain.
const MAX_SAMPLED_COST: f32 = 0.91;

/// Most primitives of a sampled subtree.
const MAX_SAMPLED: usize = 256;

/// Most subtrees that are sampled.
const N_SAMPLED: usize = 16;

/// Builds sampled subtrees.
const SAMPLE_BUILDER: Builder = Builder::TopDown(
    TopDownConfig { split: Split::Binned { bins: 16, sweep_threshold: 8 }, axes: Axes::All, ..TopDownConfig::BINNED },
    None,
);

/// An estimate of the cost with oriented nodes, relative to that with aligned nodes only.
fn sampled_cost<I: Item>(chosen: &Chosen<I>, config: &Config, scale: f32) -> f32 {
    let leaf_areas = |i: usize| chosen.aligned_leaf(i);
    let (tree, members) = (&chosen.tree, chosen.members());
    let costs = PlanCosts::of_rays(&config.costs);
    let plan = Plan { tree, members, costs, tables: &chosen.aligned_tables, leaf_areas: &leaf_areas };
    let Some(root) = tree.root() else { return 1.0 };
    let range = |child: Child| {
        let range = match child.kind() {
            ChildKind::Leaf(position) => members.range(position, position),
            ChildKind::Inner(id) => members.range(tree.nodes[id.index()].first, tree.nodes[id.index()].last),
        };
        range.start as usize..range.end as usize
    };
    // Subtrees, and the sum of the costs of those before and of each.
    let mut subtrees = vec![];
    let (mut below, mut open) = (0.0f64, vec![root]);
    while let Some(child) = open.pop() {
        match child.kind() {
            ChildKind::Inner(id) if range(child).len() > MAX_SAMPLED => {
                let node = &tree.nodes[id.index()];
                open.extend([node.right, node.left]);
            }
            _ => {
                below += f64::from(plan.cost(child));
                subtrees.push((child, below));
            }
        }
    }
    let mut sampled: Vec<usize> = (0..N_SAMPLED)
        .map(|i| {
            let at = (i as f64 + 0.5) / N_SAMPLED as f64 * below;
            subtrees.partition_point(|&(_, end)| end < at).min(subtrees.len() - 1)
        })
        .collect();
    sampled.dedup();
    let costs =
        par::map(&sampled, 1, |&i| costs_of_subset(&chosen.sorted(range(subtrees[i].0)), chosen.rows, scale, config));
    // Expensive subtrees are sampled more often, so each counts by the part that remains.
    let remaining: f64 = costs.iter().map(|&[aligned, oriented]| f64::from(oriented / aligned)).sum();
    let part = remaining / costs.len() as f64;
    let total = f64::from(plan.cost(root)).max(below);

    ((total - below + part * below) / total) as f32
}

#[cfg(test)]
mod tests {
    use canted_fixtures::soup;
    use canted_lbvh::{Leaf, triangle_corners};

    use super::*;

    /// The primitives below each node, in order of their numbers.
    fn contents(tree: &Tree, places: impl Fn(u32, u32) -> Range<usize>, primitives: &[PrimId]) -> Vec<Vec<PrimId>> {
        let below = tree.nodes.iter().map(|node| primitives[places(node.first, node.last)].to_vec());
        below.map(|mut ids| (ids.sort_unstable(), ids).1).collect()
    }

    /// The first node of the tree over groups that the other one does not have, or a flaw of that.
    fn flaw(tree: &Tree, groups: &Groups, refined: &Tree) -> Option<String> {
        let mut all = refined.leaves.clone();
        all.sort_unstable();
        let is_complete = all.iter().zip(0..).all(|(id, i)| id.0 == i) && all.len() == groups.primitives.len();
        if !is_complete || refined.nodes.len() + 1 != all.len() {
            return Some("primitives are not in one leaf each".to_owned());
        }
        let members = LeafContents::Groups(&groups.starts);
        let in_groups =
            |first, last| members.range(first, last).start as usize..members.range(first, last).end as usize;
        let wanted = contents(tree, in_groups, &groups.primitives);
        let found = contents(refined, |first, last| first as usize..last as usize + 1, &refined.leaves);
        wanted.iter().position(|ids| !found.contains(ids)).map(|i| format!("node {i}"))
    }

    #[test]
    fn a_refined_tree_has_the_nodes_of_the_groups_and_each_primitive_once() {
        for n in [2, 3, 5, 300] {
            let mesh = soup(7, n);
            let boxes: Vec<Aabb> =
                triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0.iter().map(Leaf::aabb).collect();
            let (tree, groups) = canted_sah::grouped(&boxes, &GroupConfig::BALANCED);
            let mut refined = refined(&tree, &groups).unwrap();
            assert_eq!(flaw(&tree, &groups, &refined), None, "{n}");
            // The check sees a primitive that is elsewhere, and one that is in two leaves.
            if n == 300 {
                refined.leaves.swap(0, 200);
                assert!(flaw(&tree, &groups, &refined).is_some());
                refined.leaves[0] = refined.leaves[1];
                assert!(flaw(&tree, &groups, &refined).is_some());
            }
        }
        let boxes = [Aabb { min: [0.0; 3], max: [1.0; 3] }; 8];
        let (tree, groups) = canted_sah::grouped(boxes, &GroupConfig::FAST);
        assert!(refined(&tree, &groups).is_none(), "groups of eight");
    }
}
