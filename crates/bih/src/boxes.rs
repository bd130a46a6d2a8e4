use std::fmt;

use canted_lbvh::{MAX_PRIMITIVES, par};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{AABB_PAD, pad_aabb};

use crate::BihConfig;
use crate::build::build;
use crate::node::{Node, NodeKind};
use crate::partition::{Content, Item};

/// Boxes per job.
const CHUNK: usize = 1 << 13;

/// A bounding interval hierarchy over boxes alone: it reports the boxes that a ray may hit.
///
/// A leaf position is an index into [`BoxBih::primitives`]: boxes are reordered, so that each leaf is a range of positions.
/// Planes carry the part of the padding that depends on their content, so a [`SlabRay`](canted_trace::SlabRay) needs no
/// reach: `SlabRay::new(&ray, 0.0)`, or `SlabRay::with_error(&ray, 0.0, error)` for content other than triangles.
///
/// [`Bih`](crate::Bih) adds triangles.
///
/// ```
/// use canted_bih::{BoxBih, BihConfig};
/// use canted_obb::Aabb;
/// use canted_trace::{Ray, ScaledRay, SlabRay};
///
/// let boxes: Vec<Aabb> =
///     (0..100u8).map(f32::from).map(|x| Aabb { min: [x, 0.0, 0.0], max: [x + 0.5, 1.0, 1.0] }).collect();
/// let bih = BoxBih::build(&boxes, &BihConfig::default())?;
/// let ray = ScaledRay::new(&Ray::new([40.2, 0.5, -1.0], [0.0, 0.0, 1.0])).expect("a valid ray");
/// let mut entered = vec![];
/// bih.traverse_ordered(&SlabRay::new(&ray, 0.0), ray.t_max, &mut (), |position, t_max, ()| {
///     entered.push(bih.primitives()[position as usize].0);
///     t_max
/// });
/// assert!(entered.contains(&40) && entered.len() <= 8);
/// # Ok::<(), canted_bih::BoxBihError>(())
/// ```
#[derive(Clone)]
pub struct BoxBih {
    pub(crate) nodes: Vec<Node>,
    /// The number of the primitive at each leaf position.
    pub(crate) primitives: Vec<PrimId>,
    /// The box around everything, without and with padding.
    pub(crate) bounds: Aabb,
    pub(crate) padded_bounds: Aabb,
    pub(crate) depth: u32,
}

impl BoxBih {
    /// Greatest depth of any BIH: nodes on the longest path from the root to a leaf, including the leaf.
    pub const MAX_DEPTH: u32 = crate::build::MAX_DEPTH;

    /// Builds a BIH over boxes, which may be flat and may be equal.
    ///
    /// # Errors
    /// More than 2^30 boxes, checked first; the first box that is empty or not finite.
    pub fn build(boxes: &[Aabb], config: &BihConfig) -> Result<Self, BoxBihError> {
        if boxes.len() > MAX_PRIMITIVES {
            return Err(BoxBihError::TooMany { n_boxes: boxes.len() });
        }
        if let Some(index) = boxes.iter().position(|aabb| aabb.is_empty() || !aabb.is_finite()) {
            return Err(BoxBihError::Invalid { index });
        }
        let items = par::from_fn(boxes.len(), CHUNK, |i| Item::new(i as u32, &boxes[i]));
        let contents = par::map_chunks(&items, CHUNK, |_, chunk| Content::of(chunk));
        let content = contents.into_iter().reduce(Content::union).unwrap_or(Content::EMPTY);
        Ok(Self::of_items(items, content, config))
    }

    /// Builds over items with this content.
    pub(crate) fn of_items(items: Vec<Item>, content: Content, config: &BihConfig) -> Self {
        Self::with_pad(items, content, config, AABB_PAD)
    }

    /// As [`BoxBih::of_items`], with another part of the padding in planes, relative to the reach of their content.
    pub(crate) fn with_pad(mut items: Vec<Item>, content: Content, config: &BihConfig, pad: f32) -> Self {
        if items.is_empty() {
            return Self::empty();
        }
        let (nodes, depth) = build(&mut items, content, config, pad.into());
        Self {
            nodes,
            primitives: par::map(&items, CHUNK, Item::primitive),
            bounds: content.bounds,
            padded_bounds: pad_aabb(&content.bounds, content.reach),
            depth,
        }
    }

    fn empty() -> Self {
        Self { nodes: vec![], primitives: vec![], bounds: Aabb::EMPTY, padded_bounds: Aabb::EMPTY, depth: 0 }
    }

    /// The box around everything; a point at the origin if there are no boxes.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        Obb::from_aabb(&self.bounds)
    }

    /// The index of the box at each leaf position. Every box is at one position.
    #[must_use]
    pub fn primitives(&self) -> &[PrimId] {
        &self.primitives
    }

    /// Number of nodes on the longest path from the root to a leaf, including the leaf; at most [`BoxBih::MAX_DEPTH`].
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Number of nodes, leaves included.
    #[must_use]
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Memory of nodes and references.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.memory().total()
    }

    /// Memory of each array.
    #[must_use]
    pub fn memory(&self) -> BihMemory {
        BihMemory { nodes: size_of_val(&self.nodes[..]), references: size_of_val(&self.primitives[..]), triangles: 0 }
    }

    /// Calls `visit` with the box of each node and leaf, relative to the reference point of what was given: the box, its level, 0 for
    /// the root, and whether it is a leaf. Parents come before their children.
    ///
    /// The box of a node is that of its parent, cut at the plane of the split: what rays are tested with, and what is below it.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut open: Vec<(usize, Aabb, u32)> = vec![];
        if !self.nodes.is_empty() {
            open.push((0, self.padded_bounds, 0));
        }
        while let Some((index, aabb, level)) = open.pop() {
            let node = self.nodes[index];
            let [upper, lower] = node.planes;
            let cut = |axis: usize, max: f32, min: f32| {
                let mut part = aabb;
                part.max[axis] = part.max[axis].min(max);
                part.min[axis] = part.min[axis].max(min);
                part
            };
            visit(Obb::from_aabb(&aabb), level, matches!(node.kind(), NodeKind::Leaf { .. }));
            match node.kind() {
                NodeKind::Leaf { .. } => {}
                NodeKind::Clip { axis } => open.push((index + 1, cut(axis, upper, lower), level + 1)),
                NodeKind::Split { axis, second } => {
                    open.push((index + second as usize, cut(axis, f32::INFINITY, lower), level + 1));
                    open.push((index + 1, cut(axis, upper, f32::NEG_INFINITY), level + 1));
                }
            }
        }
    }
}

/// Sizes and bounds, not every node.
impl fmt::Debug for BoxBih {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BoxBih")
            .field("n_boxes", &self.primitives.len())
            .field("n_nodes", &self.nodes.len())
            .field("depth", &self.depth)
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}

/// Memory of a BIH by array, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BihMemory {
    /// Nodes.
    pub nodes: usize,
    /// Numbers of the primitives, in leaf order.
    pub references: usize,
    /// Records of the triangle test; 0 for boxes alone.
    pub triangles: usize,
}

impl BihMemory {
    /// The sum.
    #[must_use]
    pub fn total(&self) -> usize {
        self.nodes + self.references + self.triangles
    }
}

/// Why boxes are invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxBihError {
    /// A box is empty, or a coordinate is infinite or NaN.
    Invalid {
        /// Index of the box.
        index: usize,
    },
    /// More boxes than a BIH supports.
    TooMany {
        /// Number of boxes.
        n_boxes: usize,
    },
}

impl fmt::Display for BoxBihError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid { index } => write!(f, "box {index} is empty or not finite"),
            Self::TooMany { n_boxes } => write!(f, "{n_boxes} boxes exceed the maximum of {MAX_PRIMITIVES}"),
        }
    }
}

impl std::error::Error for BoxBihError {}
