use std::marker::PhantomData;

use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Corners, Domain, GeometryError, Leaf, Tree, bottom_up};
use canted_obb::{Aabb, Obb};
use canted_sah::{PlocConfig, ReinsertConfig};

use crate::collapse::{Areas, Plan};
use crate::emit::{Source, emit};
use crate::frames::{self, BoxAreas};
use crate::traverse::{LaneKernel, MeshFrame};
use crate::{Costs, SimdPath, Wide};

/// How a tree is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// What visits cost.
    pub costs: Costs,
    /// Whether nodes may lean.
    pub lean: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self { costs: Costs::default(), lean: true }
    }
}

impl<K: LaneKernel> Wide<K> {
    /// Builds a tree over triangles.
    ///
    /// # Errors
    /// The first triangle with a vertex that is missing or not finite, or more triangles than a tree can name.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &Config) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::gather(positions, triangles)?;
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let codes = lbvh::codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes);
        let sorted = lbvh::by_code(&codes, Bits::B63);
        let in_order: Vec<Aabb> = sorted.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
        let tree = canted_sah::ploc(sorted, &in_order, &PlocConfig::default());
        let in_order: Vec<Aabb> = tree.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
        let tree = canted_sah::reinsert(&tree, &in_order, &ReinsertConfig::BALANCED);
        Self::over(&tree, &corners, &bounds, config)
    }

    /// Collapses a binary tree of any builder; `corners` in primitive order.
    ///
    /// # Errors
    /// More triangles than a tree can name.
    pub fn over(tree: &Tree, corners: &[Corners], bounds: &Aabb, config: &Config) -> Result<Self, GeometryError> {
        let frame = MeshFrame::new(Obb::IDENTITY_FRAME);
        let sorted = lbvh::in_leaf_order(corners, &tree.leaves);
        let leaf_boxes: Vec<Aabb> = sorted.iter().map(Leaf::aabb).collect();
        let inner_boxes = bottom_up(tree, Aabb::EMPTY, |p| leaf_boxes[p as usize], |_, _, a, b| a.union(*b));
        let extent = bounds.extent().into_iter().fold(0.0, f64::max);
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        let scale = if extent > 0.0 { 2f32.powi(-(extent.log2().floor().clamp(-126.0, 126.0) as i32)) } else { 1.0 };
        #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
        let half_area = |b: &Aabb| (b.extent().map(|e| e * f64::from(scale)), ()).0;
        let half_area = |b: &Aabb| {
            let [x, y, z] = half_area(b);
            (x * y + y * z + z * x) as f32
        };
        let leaf_aligned: Vec<f32> = leaf_boxes.iter().map(half_area).collect();
        let inner_aligned: Vec<f32> = inner_boxes.iter().map(half_area).collect();
        let box_areas = BoxAreas { inner: &inner_aligned, leaf: &leaf_aligned };
        let fits = frames::fit(tree, &sorted, frame.rows, &box_areas, scale, &frames::FrameConfig::default());
        let inner_areas: Vec<Areas> =
            fits.inner.iter().zip(&inner_aligned).map(|(fit, &a)| Areas::new(a, fit.half_area)).collect();
        let leaf_areas = |p: u32| Areas::new(leaf_aligned[p as usize], fits.leaf[p as usize].half_area);
        let plan = Plan::new(tree, &inner_areas, &leaf_areas, &config.costs, config.lean);
        let rows = |child: Child| match child.kind() {
            ChildKind::Leaf(p) => fits.leaf[p as usize].rows,
            ChildKind::Inner(id) => fits.inner[id.index()].rows,
        };
        let source = Source {
            tree,
            corners: &sorted,
            primitives: &tree.leaves,
            leaf_boxes: &leaf_boxes,
            inner_boxes: &inner_boxes,
            frames: &rows,
        };
        let records =
            emit(&source, &plan).map_err(|_| GeometryError::TooMany { n_triangles: tree.leaves.len() })?;
        Ok(Self {
            records,
            frame,
            bounds: *bounds,
            n_triangles: corners.len(),
            path: SimdPath::detect(),
            kernel: PhantomData,
        })
    }
}
