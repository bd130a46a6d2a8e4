//! A scene that rays can be traced through: the BVHs in device memory, and what is above them.

use std::sync::atomic::{AtomicU64, Ordering};

use canted_lbvh::Corners;
use canted_obb::Aabb;
use canted_tlas::Instance;
use canted_trace::RoundSegment;
use canted_wide::{RawBvh, TriangleBvh, WideBvh};

use super::instances::{MeshBounds, Packing, TopLevel, placed_boxes};
use super::layout::{BvhHeader, CENTER_REACH, HitError, check_coordinates};
use super::leaf_curves::{CurveKinds, DeviceCurve, HostCurves};
use super::leaf_triangles::{MOST_TRIANGLES, UploadedBvh};
use super::nodes::{DeviceBvh, MAX_STACK, NewNodes, Nodes, WideNodes, stack_size};
use super::octants::by_octants;
use super::tables::{Level, Tables};
use crate::build::{BuildConfig, BuildEncoder, Built, Primitives};
use crate::commands::{LONG_LOOP, longest_loop};
use crate::{Gpu, GpuError, NamedBinding, Variant, wait::block_on};

/// Iteration limit of an invocation on other drivers: about a second on the slowest devices, far more than rays need.
const MAX_ITERATIONS: u32 = 1 << 18;

/// Invocations of a vector, which share one iteration count on drivers that end loops early.
const LANES: u32 = 8;

/// BVHs of a scene for kernels that trace rays: `trace/closest`, `trace/occluded`, and all that use `shared/traverse`.
///
/// Wide BVHs are built by the CPU and traversed unchanged, or built on the device; binary ones are built on the device, with any of
/// [`build::STRATEGIES`](crate::build::STRATEGIES). A ray hits the triangles that [`Watertight`](canted_trace::Watertight) hits, and no
/// others; in an instance that moves, also triangles within [`HIT_ERROR`](crate::HIT_ERROR). `t` is rounded, so the closest hit may differ
/// from the CPU's by that much.
pub struct TracedScene {
    pub(super) nodes: Nodes,
    tables: Tables,
    /// Maximum depth in nodes.
    pub(super) depth: u32,
    max_iterations: u32,
    /// Whether some rays hit an instance and others do not.
    pub(super) has_masks: bool,
    /// Whether exact kernels trace all rays.
    is_exact: bool,
    /// Rays that exact kernels traced.
    pub(super) n_exact_rays: AtomicU64,
}

/// What a scene is made of: its BVHs, in one level or in two.
///
/// ```no_run
/// use canted_gpu::{Choice, Gpu, SceneInput, TracedScene, build::WideConfig};
/// use canted_trace::Ray;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let gpu = Gpu::open(&Choice::Best)?;
/// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let scene = TracedScene::new(&gpu, SceneInput::build([&[triangle]], WideConfig::default()))?;
/// let hits = scene.closest_hits(&gpu, &[Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])])?;
/// # Ok(())
/// # }
/// ```
pub struct SceneInput<'a> {
    bvhs: Bvhs<'a>,
    levels: Levels<'a>,
}

/// A BVH that the CPU built, to upload it; references convert into it.
#[derive(Clone, Copy)]
pub enum HostBvh<'a> {
    /// Over triangles.
    Triangles(&'a TriangleBvh),
    /// Over round segments.
    Segments(&'a WideBvh<RoundSegment>),
    /// Over spheres and other curves: cubic ones, ribbons, and those whose points move.
    Curves(HostCurves<'a>),
}

impl<'a> From<&'a TriangleBvh> for HostBvh<'a> {
    fn from(bvh: &'a TriangleBvh) -> Self {
        Self::Triangles(bvh)
    }
}

impl<'a> From<&'a WideBvh<RoundSegment>> for HostBvh<'a> {
    fn from(bvh: &'a WideBvh<RoundSegment>) -> Self {
        Self::Segments(bvh)
    }
}

impl<'a, P: DeviceCurve> From<&'a WideBvh<P>> for HostBvh<'a> {
    fn from(bvh: &'a WideBvh<P>) -> Self {
        Self::Curves(bvh.into())
    }
}

impl<'a> HostBvh<'a> {
    fn raw(self) -> RawBvh<'a> {
        match self {
            Self::Triangles(bvh) => bvh.raw(),
            Self::Segments(bvh) => bvh.raw(),
            Self::Curves(bvh) => bvh.raw(),
        }
    }

    fn bounds(self, words: &RawBvh<'_>) -> MeshBounds {
        let aabb = match self {
            Self::Triangles(bvh) => bvh.aabb(),
            Self::Segments(bvh) => bvh.aabb(),
            Self::Curves(bvh) => bvh.aabb(),
        };
        MeshBounds { reach: words.reach, aabb, is_of_curves: self.kinds() != CurveKinds::None }
    }

    fn kinds(self) -> CurveKinds {
        match self {
            Self::Triangles(_) => CurveKinds::None,
            Self::Segments(_) => CurveKinds::Segments,
            Self::Curves(bvh) => bvh.kinds(),
        }
    }

    /// The BVH as it is uploaded.
    fn uploaded<'w>(self, words: &RawBvh<'w>) -> Result<UploadedBvh<'w>, GpuError> {
        let (bvh, what) = match self {
            Self::Triangles(_) => (UploadedBvh::over_triangles(by_octants(words)), "triangles"),
            Self::Segments(bvh) => (UploadedBvh::over_segments(by_octants(words), bvh.primitives()), "segments"),
            Self::Curves(bvh) => (UploadedBvh::over_curves(by_octants(words), bvh.records(words)), "curves"),
        };
        let n = bvh.triangles.len();
        if n > MOST_TRIANGLES {
            return Err(GpuError::Unsupported {
                what: format!("a wide BVH with {n} {what} in its leaves, more than 2^26"),
            });
        }
        Ok(bvh)
    }
}

/// Where BVHs come from.
enum Bvhs<'a> {
    /// From the CPU.
    Uploaded(Vec<HostBvh<'a>>),
    /// From the device, over the triangles of each mesh.
    Built(Vec<&'a [Corners]>, DeviceBvh),
}

/// What is above the BVHs.
enum Levels<'a> {
    /// Nothing. The first triangle of each instance.
    One(&'a [u32]),
    /// A BVH over these instances.
    Two(&'a [Instance]),
}

impl<'a> SceneInput<'a> {
    /// BVHs that the CPU built, which are uploaded: over triangles, round segments, or what is a [`DeviceCurve`].
    ///
    /// Of a hit of a curve `u` is the position along it, and `v` the position across a ribbon, else 0, or in kernels 1 where the ray leaves. Batches of rays leave to the CPU what single precision
    /// does not decide ([`Outcome::Incomplete`](crate::Outcome::Incomplete)), and rays later than shutter opening through curves whose points move; kernels that use `shared/traverse` take the answer of single precision, whose hits are within
    /// [`HIT_ERROR`](crate::HIT_ERROR) of the surface, and may miss a curve that a ray enters less deep than that.
    #[must_use]
    pub fn upload<B: Into<HostBvh<'a>>>(bvhs: impl IntoIterator<Item = B>) -> Self {
        let bvhs = bvhs.into_iter().map(Into::into).collect();
        Self { bvhs: Bvhs::Uploaded(bvhs), levels: Levels::One(&[]) }
    }

    /// BVHs that the device builds over the triangles of each mesh.
    #[must_use]
    pub fn build<M: AsRef<[Corners]> + ?Sized + 'a>(
        meshes: impl IntoIterator<Item = &'a M>,
        bvh: impl Into<DeviceBvh>,
    ) -> Self {
        let bvhs = Bvhs::Built(meshes.into_iter().map(AsRef::as_ref).collect(), bvh.into());
        Self { bvhs, levels: Levels::One(&[]) }
    }

    /// In one level, whose single BVH is in world space. Its triangles belong to several instances: `first_triangles` has the first of each, in
    /// order. Without this call they belong to one instance.
    #[must_use]
    pub fn parts(self, first_triangles: &'a [u32]) -> Self {
        Self { levels: Levels::One(first_triangles), ..self }
    }

    /// In two levels: instances of the meshes, and a BVH over them.
    #[must_use]
    pub fn instances(self, instances: &'a [Instance]) -> Self {
        Self { levels: Levels::Two(instances), ..self }
    }
}

impl Bvhs<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Uploaded(bvhs) => bvhs.len(),
            Self::Built(meshes, _) => meshes.len(),
        }
    }
}

impl TracedScene {
    /// A scene of BVHs that the CPU built, or that the device builds; see [`SceneInput`]. Waits for the device.
    ///
    /// # Errors
    /// Several BVHs in one level; coordinates above [`MAX_COORDINATE`](crate::MAX_COORDINATE), also in world space; an unsupported strategy; more
    /// than 2^26 triangles of wide BVHs; an instance without a BVH, or with a transform that is too close to singular at any time, see
    /// [`MotionPolynomials::norm_of_inverse`](crate::MotionPolynomials::norm_of_inverse); a limit of the device, or device lost.
    pub fn new(gpu: &Gpu, input: SceneInput<'_>) -> Result<Self, GpuError> {
        block_on(Self::new_async(gpu, input))
    }

    /// [`TracedScene::new`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::new`].
    pub async fn new_async(gpu: &Gpu, input: SceneInput<'_>) -> Result<Self, GpuError> {
        let SceneInput { bvhs, levels } = input;
        if let (n, Levels::One(_)) = (bvhs.len(), &levels)
            && n != 1
        {
            return Err(GpuError::Input { message: format!("a scene of one level has one BVH, not {n}") });
        }
        match bvhs {
            Bvhs::Uploaded(meshes) => Self::uploaded(gpu, &meshes, levels).await,
            Bvhs::Built(meshes, bvh) => Self::built(gpu, &meshes, bvh, levels).await,
        }
    }

    /// Uploads BVHs; builds and uploads one over the instances.
    async fn uploaded(gpu: &Gpu, meshes: &[HostBvh<'_>], levels: Levels<'_>) -> Result<Self, GpuError> {
        let raw: Vec<RawBvh<'_>> = meshes.iter().map(|mesh| mesh.raw()).collect();
        let bounds: Vec<MeshBounds> = meshes.iter().zip(&raw).map(|(mesh, words)| mesh.bounds(words)).collect();
        let curves = meshes.iter().map(|mesh| mesh.kinds()).max().unwrap_or_default();
        let deepest = raw.iter().map(|words| words.depth).max().unwrap_or(0);
        let instances = match levels {
            Levels::One(first_triangles) => {
                check_coordinates(|| "the scene".to_owned(), raw[0].reach.into())?;
                check_depth(deepest)?;
                let bvh = meshes[0].uploaded(&raw[0])?;
                let all = [(bvh, HitError::of_triangles(raw[0].reach))];
                let (nodes, headers) = WideNodes::uploaded(gpu, &all, curves)?;
                let level = Level::flat(first_triangles);
                return Self::over(gpu, Nodes::Wide(nodes), &headers, &level, deepest).await;
            }
            Levels::Two(instances) => instances,
        };
        let outer = TopLevel::new(&bounds, instances)?;
        let words = by_octants(&outer.bvh.raw());
        let depth = words.depth + deepest;
        check_depth(depth)?;
        let order = outer.order(&words);
        let mut all = vec![(UploadedBvh::over_instances(words), outer.packing.error)];
        for (mesh, words) in meshes.iter().zip(&raw) {
            all.push((mesh.uploaded(words)?, HitError::of_triangles(words.reach)));
        }
        let (nodes, headers) = WideNodes::uploaded(gpu, &all, curves)?;
        Self::over(gpu, Nodes::Wide(nodes), &headers, &Level::two(outer.packing, order), depth).await
    }

    /// Builds on the device. Read back are the depth of the trees, which sizes the stack, and the boxes of the roots, from which the CPU
    /// places instances.
    async fn built(gpu: &Gpu, meshes: &[&[Corners]], bvh: DeviceBvh, levels: Levels<'_>) -> Result<Self, GpuError> {
        let mut build = BuildEncoder::new(gpu);
        let primitives = Primitives::triangles(gpu, meshes.iter().copied())?;
        let bottom = bvh.build(&mut build, primitives).await?;
        let of_root = |aabb: Aabb| MeshBounds {
            reach: if aabb.is_empty() { 0.0 } else { aabb.reach() },
            aabb,
            is_of_curves: false,
        };
        let bounds: Vec<_> = bottom.root_aabbs(gpu).await?.into_iter().map(of_root).collect();
        let (level, top) = match levels {
            Levels::One(first_triangles) => {
                check_coordinates(|| "the scene".to_owned(), bounds[0].reach.into())?;
                (Level::flat(first_triangles), None)
            }
            Levels::Two(instances) => {
                let packing = Packing::of(&bounds, instances)?;
                let boxes = placed_boxes(&packing, &bottom.roots_async(gpu).await?, instances);
                let config = BuildConfig { bits: bvh.bottom().bits, ..bvh.top() };
                let top = Built::new_async(&mut build, Primitives::boxes(gpu, &boxes)?, config).await?;
                (Level::One, Some((top, packing)))
            }
        };
        let tree = top.as_ref().map(|(top, _)| top);
        let new = NewNodes::new(&mut build, bvh, &bottom, tree).await?;
        let depth = new.depth(gpu, &bottom, tree).await?;
        let NewNodes { nodes, headers, .. } = new;
        let of_mesh =
            |&MeshBounds { reach, .. }: &MeshBounds| (reach, HitError::of_triangles(reach), bottom.obbs.is_some());
        let of_top = top.iter().map(|(_, packing)| {
            let reach = packing.boxes.iter().fold(0.0, |all: f32, of_instance| all.max(of_instance.reach()));
            (reach, packing.error, nodes.top_is_oriented())
        });
        let bounds = of_top.chain(bounds.iter().map(of_mesh));
        let headers = headers.into_iter().zip(bounds).map(|(header, (reach, error, is_oriented))| {
            header.with_bounds(if is_oriented { CENTER_REACH * reach } else { reach }, error)
        });
        let headers: Vec<BvhHeader> = headers.collect();
        let level = match top {
            Some((_, packing)) => {
                let order = packing.numbers.clone();
                Level::two(packing, order)
            }
            None => level,
        };
        Self::over(gpu, nodes.without_updates(), &headers, &level, depth).await
    }

    /// A scene whose BVHs have these headers.
    pub(super) async fn over(
        gpu: &Gpu,
        nodes: Nodes,
        headers: &[BvhHeader],
        level: &Level,
        depth: u32,
    ) -> Result<Self, GpuError> {
        check_depth(depth)?;
        let max_iterations = iteration_limit(longest_loop(gpu).await?);
        let tables = Tables::new(gpu, headers, level, nodes.are_final())?;
        let (has_masks, n_exact_rays) = (level.has_masks(), AtomicU64::new(0));
        Ok(Self { nodes, tables, depth, max_iterations, has_masks, is_exact: false, n_exact_rays })
    }

    /// Headers, and what is above the BVHs of meshes.
    pub(super) fn tables(&self) -> &Tables {
        &self.tables
    }

    /// The bindings of kernels that trace rays, by variable name.
    #[must_use]
    pub fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound = self.nodes.bindings();
        bound.extend(self.tables.bindings());
        bound
    }

    /// The buffer of a variable and where it lies in there, for a program that reads it in other ways; the front page of this crate has names and
    /// layouts. `None` for a variable that the scene does not have.
    #[must_use]
    pub fn buffer(&self, variable: &str) -> Option<wgpu::BufferBinding<'_>> {
        let (_, bound) = self.bindings().into_iter().find(|(name, _)| *name == variable)?;
        match bound.resource() {
            wgpu::BindingResource::Buffer(binding) => Some(binding),
            _ => None,
        }
    }

    /// Whether the scene has curves.
    #[must_use]
    pub fn has_curves(&self) -> bool {
        self.nodes.curves() != CurveKinds::None
    }

    /// Whether the scene has curves whose points move.
    pub(super) fn has_moving_curves(&self) -> bool {
        self.nodes.curves() == CurveKinds::Moving
    }

    /// `chosen` with the parts and constants for this scene. The caller still chooses the parts `mask` and `count`, and where the scene [has
    /// curves](Self::has_curves) `exits`.
    #[must_use]
    pub fn specialize(&self, chosen: Variant) -> Variant {
        let chosen = chosen.part("level", self.tables.part()).number("MAX_ITERATIONS", self.max_iterations);
        self.nodes.specialize(chosen).number("STACK_SIZE", stack_size(self.depth))
    }

    /// `chosen` for a kernel of `shared/certain`; `None` for binary BVHs, which need exact kernels for all rays.
    pub(super) fn specialize_certain(&self, kernel: &str, chosen: Variant) -> Result<Option<Variant>, GpuError> {
        if self.is_exact || matches!(self.nodes, Nodes::Binary(_)) {
            return Ok(None);
        }
        let (decide, weights) = match self.nodes.curves() {
            CurveKinds::None => ("shared/certain/decide/triangles", "shared/triangle/weights/triangles"),
            CurveKinds::Segments => ("shared/certain/decide/curves", "shared/segment/weights/curves"),
            CurveKinds::All | CurveKinds::Moving => {
                ("shared/curve_kinds/decide/kinds", "shared/curve_kinds/weights/kinds")
            }
        };
        Ok(Some(self.specialize(chosen).part("decide", decide).part("weights", weights).of_kernel(kernel)?))
    }

    /// Storage buffers of the kernels of a query: those of the scene, rays, answers, and the list of undecided rays.
    pub(super) fn n_query_buffers(&self) -> u32 {
        const NODES_TRIANGLES: u32 = 2;
        NODES_TRIANGLES + self.tables.bindings().len() as u32 + 3
    }

    /// How many rays of [`Self::closest_hits`] and [`Self::occluded`] so far were decided by exact arithmetic: those that the bounds of f32 leave
    /// undecided, or all of them where the BVHs are binary, or where the device binds too few buffers for instances that move. In a scene with round
    /// segments the CPU is to trace these.
    #[must_use]
    pub fn n_exact_rays(&self) -> u64 {
        self.n_exact_rays.load(Ordering::Relaxed)
    }

    /// Size in device memory, in bytes.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.nodes.n_bytes() + self.tables.n_bytes()
    }

    /// The same scene with another iteration limit, to test incomplete traversal.
    #[doc(hidden)]
    #[must_use]
    pub fn with_max_iterations(self, max_iterations: u32) -> Self {
        Self { max_iterations, ..self }
    }

    /// The same scene with exact kernels for all rays of queries, to measure them.
    #[doc(hidden)]
    #[must_use]
    pub fn with_exact_kernels(self) -> Self {
        Self { is_exact: true, ..self }
    }
}

/// Iteration limit on a driver that ended a loop of `LONG_LOOP` after `counted` iterations. A sixteenth is left for
/// the leaf in which an invocation reaches the limit.
fn iteration_limit(counted: u32) -> u32 {
    if counted < LONG_LOOP { counted / LANES / 16 * 15 } else { MAX_ITERATIONS }
}

/// Rejects BVHs that are too deep for a stack.
pub(super) fn check_depth(depth: u32) -> Result<(), GpuError> {
    if depth <= MAX_STACK {
        return Ok(());
    }
    Err(GpuError::Limit {
        what: "the stack of a ray".to_owned(),
        need: depth.into(),
        limit: "levels of nodes",
        most: MAX_STACK.into(),
        remedy: "use another builder",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iteration_limit_is_shared_by_the_lanes_of_a_vector() {
        assert_eq!(iteration_limit(65_535), 7_665);
        assert_eq!(iteration_limit(LONG_LOOP - 1), (LONG_LOOP - 1) / LANES / 16 * 15);
        assert_eq!([iteration_limit(0), iteration_limit(LANES - 1)], [0, 0]);
        assert_eq!(iteration_limit(LONG_LOOP), MAX_ITERATIONS);
    }
}
