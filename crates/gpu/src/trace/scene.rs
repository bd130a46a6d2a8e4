//! The BVHs of a scene in device memory.

use super::binary::Pairs;
use super::layout::BvhHeader;
use super::level::Level;
use super::wide::WideNodes;
use crate::loop_check::{LONG_LOOP, longest_loop};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation};

/// Maximum stack size. Wide BVHs have about ten levels, binary ones about thirty.
pub(super) const MAX_STACK: u32 = 128;

/// In a sequence of frames, stacks have a multiple of so many entries.
const DEPTH_STEP: u32 = 8;

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
    bvhs: Buffer<BvhHeader>,
    level: Level,
    /// Maximum depth in nodes.
    pub(super) depth: u32,
    max_iterations: u32,
}

/// The nodes and triangles of all BVHs.
pub(super) enum Nodes {
    /// Eight-wide BVHs.
    Wide(WideNodes),
    /// Binary BVHs.
    Binary(Pairs),
}

impl TracedScene {
    /// A scene whose BVHs have these headers.
    pub(super) async fn over(
        gpu: &Gpu,
        nodes: Nodes,
        headers: &[BvhHeader],
        level: Level,
        depth: u32,
    ) -> Result<Self, GpuError> {
        check_depth(depth)?;
        // A stack of another size is another kernel.
        let depth = if gpu.keeps_buffers() { depth.next_multiple_of(DEPTH_STEP).min(MAX_STACK) } else { depth };
        let max_iterations = iteration_limit(longest_loop(gpu).await?);
        let bvhs = match nodes {
            Nodes::Wide(ref wide) if !wide.is_rewritten() => gpu.read_only("bvhs", headers)?,
            // The device may write these.
            _ => gpu.buffer("bvhs", headers)?,
        };
        Ok(Self { nodes, bvhs, level, depth, max_iterations })
    }

    /// The headers of all BVHs.
    pub(super) fn headers(&self) -> &Buffer<BvhHeader> {
        &self.bvhs
    }

    /// What is above the BVHs of meshes.
    pub(super) fn level(&self) -> &Level {
        &self.level
    }

    /// The bindings of kernels that trace rays, by variable name.
    #[must_use]
    pub fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound = match &self.nodes {
            Nodes::Wide(wide) => wide.bindings(),
            Nodes::Binary(pairs) => pairs.bindings(),
        };
        bound.push(("bvhs", &self.bvhs));
        bound.extend(self.level.bindings());
        bound
    }

    /// The buffer of a variable, for a program that reads it in other ways; the front page of this crate has names and layouts. `None` for
    /// a variable that the scene does not have.
    #[must_use]
    pub fn buffer(&self, variable: &str) -> Option<&wgpu::Buffer> {
        let (_, bound) = self.bindings().into_iter().find(|(name, _)| *name == variable)?;
        match bound.resource() {
            wgpu::BindingResource::Buffer(binding) => Some(binding.buffer),
            _ => None,
        }
    }

    /// `chosen` with the parts and constants for this scene. The caller still chooses the parts `mask` and `count`.
    #[must_use]
    pub fn specialise(&self, chosen: Specialisation) -> Specialisation {
        let chosen = chosen.part("level", self.level.part()).number("MAX_ITERATIONS", self.max_iterations);
        let chosen = match &self.nodes {
            Nodes::Wide(wide) => wide.specialise(chosen),
            Nodes::Binary(pairs) => pairs.specialise(chosen),
        };
        chosen.number("STACK_SIZE", self.depth.max(1))
    }

    /// Size in device memory, in bytes.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        let nodes = match &self.nodes {
            Nodes::Wide(wide) => wide.n_bytes(),
            Nodes::Binary(pairs) => pairs.n_bytes(),
        };
        nodes + self.bvhs.n_bytes() + self.level.n_bytes()
    }

    /// The same scene with another iteration limit, to test incomplete traversal.
    #[doc(hidden)]
    #[must_use]
    pub fn with_max_iterations(self, max_iterations: u32) -> Self {
        Self { max_iterations, ..self }
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
    use canted_fixtures::or_skip;
    use canted_trace::Watertight;
    use canted_wide::TriangleBvh;

    use super::*;
    use crate::Choice;

    #[test]
    fn iteration_limit_is_shared_by_the_lanes_of_a_vector() {
        assert_eq!(iteration_limit(65_535), 7_665);
        assert_eq!(iteration_limit(LONG_LOOP - 1), (LONG_LOOP - 1) / LANES / 16 * 15);
        assert_eq!([iteration_limit(0), iteration_limit(LANES - 1)], [0, 0]);
        assert_eq!(iteration_limit(LONG_LOOP), MAX_ITERATIONS);
    }

    /// On every driver the iteration limit ends traversal before the driver would.
    #[test]
    fn iteration_limit_is_below_the_drivers() {
        let test = "iteration_limit_is_below_the_drivers";
        let Some(gpu) = or_skip(test, Gpu::open(&Choice::Best)) else { return };
        let bvh = TriangleBvh::<Watertight>::build(&[], &[], &canted_wide::Config::default()).unwrap();
        let scene = TracedScene::single_level(&gpu, &bvh, &[0]).unwrap();
        let counted = crate::loop_iterations(&gpu, 100_000).unwrap();
        let fits = if counted == 100_000 {
            scene.max_iterations == MAX_ITERATIONS
        } else {
            scene.max_iterations * LANES <= counted
        };
        assert!(fits, "limit {}, where a loop takes {counted}", scene.max_iterations);
        assert_eq!(scene.max_iterations, iteration_limit(counted));
    }
}
