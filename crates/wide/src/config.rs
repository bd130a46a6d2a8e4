use canted_sah::{Builder, GroupConfig, TopDownConfig};
use canted_trace::TriangleTest;

use crate::node::{MAX_LEAF, NodeKind};

/// How much build time is spent on how fast a BVH.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Preset {
    /// For geometry that is built again for each frame: a binary tree by Morton codes, aligned nodes only.
    Dynamic,
    /// For geometry that changes: a binary tree over groups of up to eight primitives.
    Fast,
    /// Nearly the fastest traversal: smaller groups, moved where that helps, and a mesh frame. Over curves and other shapes, as with
    /// `Fast`, a short build and little memory: oriented nodes only where they save 30 % of the predicted cost.
    #[default]
    Balanced,
    /// The fastest traversal: groups are moved further; over triangles, where oriented nodes may pay, the better of two binary trees.
    /// Over other shapes oriented nodes wherever they save 3 %.
    Quality,
}

impl Preset {
    /// All presets, in the order of their numbers in files of the Python package.
    pub const ALL: [Self; 4] = [Self::Dynamic, Self::Fast, Self::Balanced, Self::Quality];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Dynamic => "dynamic",
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Quality => "quality",
        }
    }
}

/// How a BVH is built. [`Config::preset`] makes the usual configurations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Traversal costs, which the collapse minimizes.
    pub costs: Costs,
    /// Builds a binary tree over groups of primitives first, and `builder` is used only where a sample of its subtrees shows
    /// that oriented nodes may pay, over triangles only: over other primitives groups of two are divided. Groups are of eight and more over
    /// primitives with [`HULL`](crate::Primitive::HULL) or [`BALL`](crate::Primitive::BALL). `None` for `builder` always.
    pub groups: Option<GroupConfig>,
    /// Builder of a binary tree with a primitive per leaf.
    pub builder: Builder,
    /// A second such builder, used where `builder` is; its tree is taken where its predicted cost is lower.
    pub alternative_builder: Option<Builder>,
    /// Whether nodes may be oriented.
    pub oriented: bool,
    /// Over other primitives than triangles, oriented nodes are used only where they lower the predicted cost, with one for their
    /// memory, to this part, as a sample shows: builds with frames take several times as long, and BVHs with them more memory. With
    /// zero, negative numbers and NaN no node is oriented.
    pub max_oriented_cost: f32,
    /// Whether aligned nodes may be aligned with a frame of the mesh instead of the coordinate axes.
    pub rotate_mesh: bool,
    /// The triangle test of rays; BVHs over other primitives have none.
    pub test: TriangleTest,
}

impl Config {
    /// The usual settings.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let fast = Self {
            costs: Costs::default(),
            groups: Some(GroupConfig::FAST),
            builder: Builder::TopDown(TopDownConfig::BINNED, None),
            alternative_builder: None,
            oriented: true,
            max_oriented_cost: 0.7,
            rotate_mesh: false,
            test: TriangleTest::Watertight,
        };
        match preset {
            Preset::Dynamic => Self { groups: Some(GroupConfig::DYNAMIC), oriented: false, ..fast },
            Preset::Fast => fast,
            Preset::Balanced => {
                Self { groups: Some(GroupConfig::BALANCED), builder: Builder::BALANCED, rotate_mesh: true, ..fast }
            }
            Preset::Quality => Self {
                groups: Some(GroupConfig::QUALITY),
                builder: Builder::QUALITY,
                alternative_builder: Some(Builder::TopDown(TopDownConfig::BINNED, None)),
                max_oriented_cost: 0.97,
                rotate_mesh: true,
                ..fast
            },
        }
    }

    /// The same settings with aligned nodes only, along the coordinate axes.
    #[must_use]
    pub fn axis_aligned(self) -> Self {
        Self { oriented: false, rotate_mesh: false, ..self }
    }

    /// The same settings with [`Costs::ON_DEVICES`] in place of their own, and oriented nodes over any primitives where they lower the
    /// predicted cost by 8 %: small leaves are faster on devices, which test primitives one by one.
    #[must_use]
    pub fn for_devices(self) -> Self {
        Self { costs: Costs::ON_DEVICES, max_oriented_cost: 0.92, ..self }
    }

    /// The settings as builds use them: see [`Costs`].
    pub(crate) fn usable(&self) -> Self {
        // The greater of NaN and zero is zero.
        let max_oriented_cost = self.max_oriented_cost.max(0.0);
        Self { costs: self.costs.usable(self.oriented), max_oriented_cost, ..*self }
    }
}

impl From<Preset> for Config {
    fn from(preset: Preset) -> Self {
        Self::preset(preset)
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}

/// Traversal costs, relative to the test of an aligned node: what the collapse minimizes.
///
/// Over 14 scenes on an AMD EPYC (Zen 5) a ray takes 19 ns for an aligned node, 40 for an oriented one and 8 for a block. What
/// a leaf costs differs: next to nothing in a soup, as much as two nodes in a lattice, where its branches are seldom predicted;
/// the default lies between. `benches/TRIED.md` has the tables. Over triangles oriented nodes are used only where they lower the
/// predicted cost of a BVH by 8 %: smaller gains are within the error of the prediction. Over other primitives see
/// [`Config::max_oriented_cost`].
///
/// An infinite cost disables a kind of node, unless no other is left. Negative costs and NaN count as infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// A node whose boxes are aligned with the mesh frame.
    pub aligned_node: f32,
    /// A node with a frame for each child.
    pub oriented_node: f32,
    /// A leaf, without its blocks.
    pub leaf: f32,
    /// A block of up to eight triangles.
    pub block: f32,
    /// Most triangles of a leaf, clamped to 1 to 32.
    pub max_leaf: usize,
}

impl Default for Costs {
    fn default() -> Self {
        Self { aligned_node: 1.0, oriented_node: 2.2, leaf: 1.5, block: 0.42, max_leaf: 32 }
    }
}

impl Costs {
    /// Costs on GPUs, where a ray tests the primitives of a leaf one after another: leaves are small and cost less. After Ylitie, Karras
    /// and
    /// Laine 2017, who have leaves of at most three triangles.
    pub const ON_DEVICES: Self = Self { aligned_node: 1.0, oriented_node: 2.2, leaf: 0.5, block: 0.2, max_leaf: 3 };

    /// The cost of testing a node of this kind.
    #[must_use]
    pub fn node(&self, kind: NodeKind) -> f32 {
        match kind {
            NodeKind::Aligned => self.aligned_node,
            NodeKind::Oriented => self.oriented_node,
        }
    }

    /// These costs as builds use them; `oriented` allows oriented nodes.
    pub(crate) fn usable(&self, oriented: bool) -> Self {
        let [aligned_node, oriented_node, leaf, block] = [self.aligned_node, self.oriented_node, self.leaf, self.block]
            .map(|cost| if cost >= 0.0 { cost } else { f32::INFINITY });
        // If all kinds were disabled, all collapses would cost the same, and nodes would have two children each.
        let is_any_left = aligned_node.is_finite() || oriented && oriented_node.is_finite();
        let aligned_node = if is_any_left { aligned_node } else { Self::default().aligned_node };
        Self { aligned_node, oriented_node, leaf, block, max_leaf: self.max_leaf.clamp(1, MAX_LEAF) }
    }

    /// The cost of a leaf of `n` primitives.
    pub(crate) fn leaf_of(&self, n: usize) -> f32 {
        self.leaf + self.block * n.div_ceil(8) as f32
    }
}

/// The predicted traversal cost of a BVH with its boxes as they are, in tests of aligned nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RayCost {
    /// Of a ray that enters the box around all primitives.
    pub(crate) per_ray: f32,
    /// Of as many such rays as hit one primitive on average; zero where primitives have no area.
    pub(crate) per_primitive: f32,
}

/// What a refit compares with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Baseline {
    pub(crate) costs: Costs,
    /// The predicted cost before the first refit, which computes it.
    pub(crate) built: Option<RayCost>,
    /// After the last refit; not in files.
    pub(crate) now: Option<RayCost>,
}

impl Baseline {
    /// Of a BVH that was just built.
    pub(crate) fn new(costs: Costs) -> Self {
        Self { costs, built: None, now: None }
    }
}
