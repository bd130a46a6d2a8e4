//! A scene that rays can be traced through: the BVHs in device memory, and what is above them.

use canted_shaders::{Number, ShaderName, choice};
use std::sync::atomic::{AtomicU64, Ordering};

use canted_lbvh::Corners;
use canted_obb::Aabb;
use canted_tlas::Instance;
use canted_wide::RawBvh;

use super::driver::DriverScene;
use super::instances::{MeshBounds, Packing, TopLevel, placed_boxes};
use super::layout::{BvhHeader, CENTER_REACH, EMPTY, HitError, check_coordinates};
use super::leaf_curves::{CurveKernels, CurveKinds};
use super::leaf_triangles::UploadedBvh;
use super::nodes::{DeviceBvh, MAX_STACK, NewNodes, Nodes, WideNodes, stack_size};
use super::octants::by_octants;
use super::packed::packed;
use super::source::{HostBvh, Levels, Options, Source};
use super::tables::{Level, Tables};
use crate::build::{BuildConfig, BuildEncoder, Built, Primitives};
use crate::commands::{LONG_LOOP, longest_loop};
use crate::{Gpu, GpuError, NamedBinding, Variant};

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
    /// Whether hits of some triangles are for kernels of the caller to decide.
    pub(super) has_masked: bool,
    /// Whether exact kernels trace all rays.
    is_exact: bool,
    /// Rays that exact kernels traced.
    pub(super) n_exact_rays: AtomicU64,
}

impl TracedScene {
    /// The only way to make one: from BVHs that the CPU built, or that the device builds, or from structures of the driver. Waits for the
    /// device, but not for the driver's build.
    ///
    /// ```no_run
    /// use canted_gpu::{Choice, Gpu, Options, Source, TracedScene, build::WideConfig};
    /// use canted_trace::Ray;
    ///
    /// # async fn example() -> Result<(), canted_gpu::GpuError> {
    /// let gpu = Gpu::open(&Choice::Best).await?;
    /// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let scene = TracedScene::new(&gpu, Source::build([&[triangle]], WideConfig::default()), Options::default()).await?;
    /// let hits = scene.closest_hits(&gpu, &[Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])]).await?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Several meshes to build in one level; parts in two levels; coordinates above [`MAX_COORDINATE`](crate::MAX_COORDINATE), also in
    /// world space; an unsupported strategy; more than 2^26 triangles of wide BVHs; an instance without a BVH, or with a transform that is
    /// too close to singular at any time, see [`MotionPolynomials::norm_of_inverse`](crate::MotionPolynomials::norm_of_inverse); what
    /// [`Source::DriverRayQueries`] does not support; a limit of the device, or device lost.
    pub async fn new(gpu: &Gpu, source: Source<'_>, options: Options<'_>) -> Result<Self, GpuError> {
        let Options { parts, masked } = options;
        let levels = match source.instances() {
            Some(_) if !parts.is_empty() => {
                return Err(GpuError::Input { message: "parts of meshes as instances in two levels".to_owned() });
            }
            Some(instances) => Levels::Two(instances),
            None => Levels::One(parts),
        };
        match &source {
            Source::Wide(bvh) => Self::uploaded(gpu, &[*bvh], masked, levels).await,
            Source::Tlas { bvhs, .. } => Self::uploaded(gpu, bvhs, masked, levels).await,
            Source::Build { .. } if !masked.is_empty() => {
                Err(GpuError::Input { message: "masked triangles of BVHs that the device builds".to_owned() })
            }
            Source::DriverRayQueries { .. } if !masked.is_empty() => {
                Err(GpuError::Unsupported { what: "masked triangles by ray queries of the driver".to_owned() })
            }
            Source::DriverRayQueries { .. } if parts.len() > 1 => {
                Err(GpuError::Unsupported { what: "parts of meshes by ray queries of the driver".to_owned() })
            }
            Source::DriverRayQueries { meshes, instances } => Self::of_driver(gpu, meshes, *instances),
            Source::Build { meshes, bvh, .. } => Self::built(gpu, meshes, *bvh, levels).await,
        }
    }

    /// Uploads BVHs; builds and uploads one over the instances.
    async fn uploaded(
        gpu: &Gpu,
        meshes: &[HostBvh<'_>],
        masked: &[Vec<bool>],
        levels: Levels<'_>,
    ) -> Result<Self, GpuError> {
        let has_masked = masked.iter().flatten().any(|is_masked| *is_masked);
        let masked = |mesh: usize| masked.get(mesh).map_or(&[][..], Vec::as_slice);
        let raw: Vec<RawBvh<'_>> = meshes.iter().map(|mesh| mesh.raw()).collect();
        let bounds: Vec<MeshBounds> = meshes.iter().zip(&raw).map(|(mesh, words)| mesh.bounds(words)).collect();
        let curves = meshes.iter().map(|mesh| mesh.kinds()).fold(CurveKinds::default(), CurveKinds::and);
        let deepest = raw.iter().map(|words| words.depth).max().unwrap_or(0);
        let instances = match levels {
            Levels::One(first_triangles) => {
                check_coordinates(|| "the scene".to_owned(), raw[0].reach.into())?;
                check_depth(deepest)?;
                let bvh = meshes[0].uploaded(&raw[0], masked(0))?;
                let all = [(bvh, HitError::of_triangles(raw[0].reach))];
                let (nodes, headers) = WideNodes::uploaded(gpu, &all, curves)?;
                let level = Level::flat(first_triangles);
                let scene = Self::over(gpu, Nodes::Wide(nodes), &headers, &level, deepest).await?;
                return Ok(Self { has_masked, ..scene });
            }
            Levels::Two(instances) => instances,
        };
        let outer = TopLevel::new(&bounds, instances)?;
        let words = packed(by_octants(&outer.bvh.raw()));
        let depth = words.depth + deepest;
        check_depth(depth)?;
        let order = outer.order(&words);
        let mut all = vec![(UploadedBvh::over_instances(words), outer.packing.error)];
        for (number, (mesh, words)) in meshes.iter().zip(&raw).enumerate() {
            all.push((mesh.uploaded(words, masked(number))?, HitError::of_triangles(words.reach)));
        }
        let (nodes, headers) = WideNodes::uploaded(gpu, &all, curves)?;
        let scene = Self::over(gpu, Nodes::Wide(nodes), &headers, &Level::two(outer.packing, order), depth).await?;
        Ok(Self { has_masked, ..scene })
    }

    /// Builds on the device. Read back are the depth of the trees, which sizes the stack, and the boxes of the roots, from which the CPU
    /// places instances.
    async fn built(gpu: &Gpu, meshes: &[&[Corners]], bvh: DeviceBvh, levels: Levels<'_>) -> Result<Self, GpuError> {
        if let (n, Levels::One(_)) = (meshes.len(), &levels)
            && n != 1
        {
            return Err(GpuError::Input { message: format!("a scene of one level has one mesh, not {n}") });
        }
        let mut build = BuildEncoder::new(gpu);
        let primitives = Primitives::triangles(gpu, meshes.iter().copied())?;
        let bottom = bvh.build(&mut build, primitives)?;
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
                let boxes = placed_boxes(&packing, &bottom.roots(gpu).await?, instances);
                let config = BuildConfig { bits: bvh.bottom().bits, ..bvh.top() };
                let top = Built::new(&mut build, Primitives::boxes(gpu, &boxes)?, config)?;
                (Level::One, Some((top, packing)))
            }
        };
        let tree = top.as_ref().map(|(top, _)| top);
        let new = NewNodes::new(&mut build, bvh, &bottom, tree)?;
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

    /// Has the driver build its structures.
    fn of_driver(gpu: &Gpu, meshes: &[&[Corners]], instances: Option<&[Instance]>) -> Result<Self, GpuError> {
        let scene = DriverScene::new(gpu, meshes, instances)?;
        // The driver has no headers; a table is not empty.
        let tables = Tables::new(gpu, &[BvhHeader::wide(EMPTY, 0)], &Level::One, true)?;
        let (has_masks, nodes) = (scene.has_masks, Nodes::Driver(scene));
        let (depth, max_iterations, n_exact_rays) = (0, 0, AtomicU64::new(0));
        Ok(Self { nodes, tables, depth, max_iterations, has_masks, has_masked: false, is_exact: false, n_exact_rays })
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
        let (has_masked, is_exact) = (false, false);
        Ok(Self { nodes, tables, depth, max_iterations, has_masks, has_masked, is_exact, n_exact_rays })
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

    /// Whether some triangles are [masked](crate::Options::masked).
    #[must_use]
    pub fn has_masked(&self) -> bool {
        self.has_masked
    }

    /// Whether the scene has curves.
    #[must_use]
    pub fn has_curves(&self) -> bool {
        self.nodes.curves().any()
    }

    /// Whether rays are those of [`Source::DriverRayQueries`].
    #[must_use]
    pub fn is_of_driver(&self) -> bool {
        matches!(self.nodes, Nodes::Driver(_))
    }

    /// Whether the scene has curves whose points move.
    pub(super) fn has_moving_curves(&self) -> bool {
        self.nodes.curves().moves
    }

    /// `chosen` with the parts and constants for this scene. The caller still chooses the parts `mask` and `count`, and where the scene
    /// [has curves](Self::has_curves) `exits`. Where the rays [are the driver's](Self::is_of_driver) there is no traversal, and kernels
    /// that use one are an error.
    #[must_use]
    pub fn specialize(&self, chosen: Variant) -> Variant {
        let chosen = chosen.with(self.tables.level()).number(Number::MaxIterations, self.max_iterations);
        self.nodes.specialize(chosen).number(Number::StackSize, stack_size(self.depth))
    }

    /// `chosen` for a kernel of `shared/certain`; `None` for binary BVHs, which need exact kernels for all rays. `leaves_masked`: whether masked triangles are left to exact kernels; if not, their hits count.
    pub(super) fn specialize_certain(
        &self,
        kernel: ShaderName,
        chosen: Variant,
        leaves_masked: bool,
    ) -> Result<Option<Variant>, GpuError> {
        if self.is_exact || !matches!(self.nodes, Nodes::Wide(_)) {
            return Ok(None);
        }
        let (decide, weights) = match (self.nodes.curves().kernels, leaves_masked && self.has_masked) {
            (CurveKernels::None, false) => (choice::Decide::Triangles, choice::Weights::Triangles),
            (CurveKernels::None, true) => (choice::Decide::Masked, choice::Weights::Triangles),
            (CurveKernels::Segments, _) => (choice::Decide::Curves, choice::Weights::Curves),
            (CurveKernels::Kinds, _) => (choice::Decide::Kinds, choice::Weights::Kinds),
            (CurveKernels::Patches, _) => (choice::Decide::Patches, choice::Weights::Patches),
        };
        Ok(Some(self.specialize(chosen).with(decide).with(weights).of_kernel(kernel)?))
    }

    /// Storage buffers of the kernels of a query: those of the scene, rays, answers, the list of undecided rays, and that of the rays to trace.
    pub(super) fn n_query_buffers(&self, each: choice::Each) -> u32 {
        const NODES_TRIANGLES: u32 = 2;
        NODES_TRIANGLES + self.tables.bindings().len() as u32 + 3 + u32::from(each == choice::Each::Listed)
    }

    /// How many rays of [`Self::closest_hits`] and [`Self::occluded`] so far were decided by exact arithmetic: those that the bounds of f32 leave
    /// undecided, or all of them where the BVHs are binary, or where the device binds too few buffers for instances that move. In a scene with
    /// curves the CPU is to trace these.
    #[must_use]
    pub fn n_exact_rays(&self) -> u64 {
        self.n_exact_rays.load(Ordering::Relaxed)
    }

    /// Size in device memory, in bytes, without that of structures of the driver, which it does not tell.
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
