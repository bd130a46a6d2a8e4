use std::marker::PhantomData;

use canted_lbvh::{self as lbvh, Child, ChildKind, Corners, GeometryError, Tree};
use canted_obb::{Aabb, Obb};

use crate::binary::{self, Chosen};
use crate::collapse::{Areas, Plan};
use crate::emit::{Source, emit};
use crate::frames::{self, BoxAreas, Fits, FrameConfig};
use crate::layout::Limits;
use crate::measure::{self, Aligned};
use crate::refit::Wear;
use crate::traverse::{LaneKernel, MeshFrame};
use crate::{Config, PredictedCost, SimdPath, WideBvh};

impl<K: LaneKernel> WideBvh<K> {
    /// Builds a tree over triangles.
    ///
    /// # Errors
    /// More than [`MAX_TRIANGLES`](crate::MAX_TRIANGLES), before any is looked at, or so many that their tree is too large; the first
    /// triangle with a vertex that is missing or not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &Config) -> Result<Self, GeometryError> {
        Self::build_within(&Limits::OF_WORDS, positions, triangles, config)
    }

    /// As [`WideBvh::build`], where words can name no more than this.
    pub(crate) fn build_within(
        limits: &Limits,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        config: &Config,
    ) -> Result<Self, GeometryError> {
        check_number(triangles.len(), limits)?;
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let config = config.usable();
        let chosen = binary::choose(&corners, &bounds, &config);
        assemble(&chosen, &corners, &bounds, &config, limits)
    }

    /// Collapses a binary tree of any builder; `corners` in primitive order and finite, `bounds` around them.
    ///
    /// # Errors
    /// As [`WideBvh::build`] where there are too many triangles.
    pub fn over(tree: &Tree, corners: &[Corners], bounds: &Aabb, config: &Config) -> Result<Self, GeometryError> {
        let limits = &Limits::OF_WORDS;
        check_number(corners.len(), limits)?;
        let scale = measure::unit_scale(bounds);
        let rows = Obb::IDENTITY_FRAME;
        let aligned = Aligned::of(tree, &measure::boxes(corners, rows), scale);
        assemble(&Chosen { tree: tree.clone(), rows, aligned, scale }, corners, bounds, &config.usable(), limits)
    }
}

/// More triangles than leaves can name are told before the work.
fn check_number(n_triangles: usize, limits: &Limits) -> Result<(), GeometryError> {
    if n_triangles > limits.n_triangles() { Err(GeometryError::TooMany { n_triangles }) } else { Ok(()) }
}

/// Finds frames, plans the collapse and writes the records.
fn assemble<K: LaneKernel>(
    chosen: &Chosen,
    corners: &[Corners],
    bounds: &Aabb,
    config: &Config,
    limits: &Limits,
) -> Result<WideBvh<K>, GeometryError> {
    let Chosen { tree, rows, aligned, scale } = chosen;
    let sorted = lbvh::in_leaf_order(corners, &tree.leaves);
    let aligned_cost = binary::cost(tree, aligned, &config.costs);
    let (areas, fits) = if config.oriented {
        let areas = BoxAreas { inner: &aligned.inner_areas, leaf: &aligned.leaf_areas };
        let frame_config = FrameConfig { rounds: config.refine_iterations, ..FrameConfig::default() };
        let fits = frames::fit(tree, &sorted, *rows, &areas, *scale, &frame_config);
        (plan_areas(aligned, Some(&fits)), fits)
    } else {
        (plan_areas(aligned, None), Fits::default())
    };
    let leaf_areas = |place: u32| areas.1[place as usize];
    let plan = Plan::new(tree, &areas.0, &leaf_areas, &config.costs, config.oriented);
    let root_area = tree.root().map_or(1.0, |root| plan.area(root, crate::NodeKind::Aligned));
    let chosen_cost = tree.root().map_or(0.0, |root| plan.cost(root));
    let frame_of = |child: Child| match child.kind() {
        ChildKind::Leaf(place) => fits.leaf[place as usize].rows,
        ChildKind::Inner(id) => fits.inner[id.index()].rows,
    };
    let source = Source {
        tree,
        corners: &sorted,
        primitives: &tree.leaves,
        leaf_boxes: &aligned.leaf_boxes,
        inner_boxes: &aligned.inner_boxes,
        frames: &frame_of,
    };
    let records = emit(&source, &plan, limits).map_err(|_| GeometryError::TooMany { n_triangles: corners.len() })?;
    Ok(WideBvh {
        records,
        frame: MeshFrame::new(*rows),
        bounds: *bounds,
        n_triangles: corners.len(),
        predicted: PredictedCost { aligned: aligned_cost / root_area, chosen: chosen_cost / root_area },
        wear: Wear::new(config.costs),
        path: SimdPath::detect(),
        kernel: PhantomData,
    })
}

/// Areas of inner nodes and of leaves.
type AllAreas = (Vec<Areas>, Vec<Areas>);

fn plan_areas(aligned: &Aligned, fits: Option<&Fits>) -> AllAreas {
    let areas = |aligned: &[f32], fits: Option<&[frames::Fit]>| -> Vec<Areas> {
        let lean = |i: usize| fits.map_or(f32::MAX, |fits| fits[i].half_area);
        aligned.iter().enumerate().map(|(i, &area)| Areas::new(area, lean(i))).collect()
    };
    let inner = areas(&aligned.inner_areas, fits.map(|fits| &fits.inner[..]));
    (inner, areas(&aligned.leaf_areas, fits.map(|fits| &fits.leaf[..])))
}
