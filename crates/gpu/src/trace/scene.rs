//! The BVHs of a scene in device memory.

use bytemuck::Pod;
use canted_obb::Aabb;
use canted_tlas::Instance;
use canted_wide::{LaneKernel, RawBvh, TriangleBvh};

use super::alternatives::{ParentLink, Traversal, links};
use super::coordinates::check_coordinates;
use super::layout::{BvhHeader, HitError, InstanceData, Quad, Start};
use super::motion::MotionData;
use super::nodes::is_aligned;
use super::top_level::TopLevel;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation, loop_iterations};

/// Maximum stack size. Our BVHs have about ten levels.
const MAX_STACK: u32 = 128;

/// Levels whose pending children fit into four words, eight bits each.
const MAX_BIT_LEVELS: u32 = 16;

/// Iterations requested to detect drivers that end loops early.
const REQUESTED_ITERATIONS: u32 = 100_000;

/// Iteration limit of an invocation on other drivers: about a second on the slowest devices, far more than rays need.
const MAX_ITERATIONS: u32 = 1 << 18;

/// Invocations of a vector, which share one iteration count on drivers that end loops early.
const LANES: u32 = 8;

/// BVHs of a scene for kernels that trace rays: `trace/closest`, `trace/occluded`, and all that use `shared/traverse`.
///
/// The device traverses the CPU's nodes and triangles. Its triangle test hits everything that
/// [`Watertight`](canted_trace::Watertight) hits, and triangles within [`HIT_ERROR`](crate::HIT_ERROR) of a ray. So its closest
/// hit may differ from the CPU's by that much.
pub struct TracedScene {
    nodes: Buffer<Quad>,
    halves: Buffer<Quad>,
    bvhs: Buffer<BvhHeader>,
    level: Level,
    traversal: Traversal,
    /// Links to parents, for traversals that need them.
    links: Option<Buffer<ParentLink>>,
    /// Whether all nodes are aligned.
    is_aligned: bool,
    /// Maximum depth in nodes.
    depth: u32,
    max_iterations: u32,
}

/// What is above the BVHs of meshes.
enum Level {
    /// Nothing: a single instance.
    One,
    /// First triangle of each instance; one BVH contains all triangles.
    Flat(Buffer<u32>),
    /// Instances below a top-level BVH.
    Two(Instances),
}

/// Instances in device memory.
struct Instances {
    instances: Buffer<InstanceData>,
    /// Their indices in the order of the top-level BVH.
    order: Buffer<u32>,
    /// Motions, if any instance moves.
    motions: Option<Buffer<MotionData>>,
}

impl TracedScene {
    /// Uploads one BVH over the triangles of all instances, in world space. `first_triangles` are the indices of the first
    /// triangle of each instance, in order.
    ///
    /// # Errors
    /// Coordinates above [`MAX_COORDINATE`](crate::MAX_COORDINATE), a limit of the device, or device lost.
    pub fn single_level<K: LaneKernel>(
        gpu: &Gpu,
        bvh: &TriangleBvh<K>,
        first_triangles: &[u32],
    ) -> Result<Self, GpuError> {
        let words = bvh.raw();
        check_coordinates(|| "the BVH over all instances".to_owned(), words.reach.into())?;
        let level = if first_triangles.len() > 1 {
            Level::Flat(gpu.buffer("first triangles", first_triangles)?)
        } else {
            Level::One
        };
        let error = HitError::of_triangles(words.reach);
        Self::new(gpu, &[(words, error)], level, words.depth)
    }

    /// Uploads one BVH per mesh, and builds and uploads a BVH over the instances.
    ///
    /// # Errors
    /// As for [`TracedScene::single_level`], including coordinates in world space; an instance without a BVH; or a transform
    /// that is too close to singular at any time, see
    /// [`MotionPolynomials::norm_of_inverse`](crate::MotionPolynomials::norm_of_inverse).
    pub fn two_level<K: LaneKernel>(
        gpu: &Gpu,
        meshes: &[&TriangleBvh<K>],
        instances: &[Instance],
    ) -> Result<Self, GpuError> {
        let words: Vec<(RawBvh<'_>, Aabb)> = meshes.iter().map(|mesh| (mesh.raw(), mesh.aabb())).collect();
        let outer = TopLevel::new(&words, instances)?;
        let motions = Some(&outer.motions).filter(|motions| !motions.is_empty());
        let level = Level::Two(Instances {
            instances: gpu.buffer("instances", &outer.instances)?,
            order: gpu.buffer("instance order", &outer.order)?,
            motions: motions.map(|motions| gpu.buffer("motions", motions)).transpose()?,
        });
        let deepest = words.iter().map(|(words, _)| words.depth).max().unwrap_or(0);
        let outer_words = outer.bvh.raw();
        let bvhs: Vec<_> = std::iter::once((outer_words, outer.error))
            .chain(words.iter().map(|(words, _)| (*words, HitError::of_triangles(words.reach))))
            .collect();
        Self::new(gpu, &bvhs, level, outer_words.depth + deepest)
    }

    fn new(gpu: &Gpu, bvhs: &[(RawBvh<'_>, HitError)], level: Level, depth: u32) -> Result<Self, GpuError> {
        if depth > MAX_STACK {
            return Err(too_deep(depth, MAX_STACK));
        }
        let nodes: Vec<&[u32]> = bvhs.iter().map(|(words, _)| words.nodes).collect();
        let blocks: Vec<&[u32]> = bvhs.iter().map(|(words, _)| words.blocks).collect();
        let mut start = Start::default();
        let headers = bvhs.iter().map(|(words, error)| {
            let header = BvhHeader::new(words, start, *error);
            start = start.after(words);
            header
        });
        let headers: Vec<BvhHeader> = headers.collect();
        let max_iterations = iteration_limit(loop_iterations(gpu, REQUESTED_ITERATIONS)?);
        Ok(Self {
            nodes: joined(gpu, "nodes", &nodes)?,
            halves: joined(gpu, "triangle blocks", &blocks)?,
            bvhs: gpu.buffer("bvhs", &headers)?,
            level,
            traversal: Traversal::Stack,
            links: None,
            is_aligned: bvhs.iter().all(|(words, _)| is_aligned(quads(words.nodes), words.root)),
            depth,
            max_iterations,
        })
    }

    /// The same scene with another traversal.
    ///
    /// # Errors
    /// A BVH too deep for the traversal, or device lost.
    pub fn with_traversal(self, gpu: &Gpu, traversal: Traversal) -> Result<Self, GpuError> {
        if traversal == Traversal::Bits && self.depth > MAX_BIT_LEVELS {
            return Err(too_deep(self.depth, MAX_BIT_LEVELS));
        }
        let links = match traversal {
            Traversal::Stack => None,
            Traversal::Bits | Traversal::Links => {
                let (nodes, bvhs) = (gpu.read(&self.nodes)?, gpu.read(&self.bvhs)?);
                Some(gpu.buffer("parent links", &links(&nodes, &bvhs))?)
            }
        };
        Ok(Self { traversal, links, ..self })
    }

    /// The same scene with invalid links, to show that tests detect it.
    ///
    /// # Errors
    /// The device is lost.
    #[doc(hidden)]
    pub fn without_parent_links(self, gpu: &Gpu) -> Result<Self, GpuError> {
        let n = self.links.as_ref().map_or(0, Buffer::len);
        Ok(Self { links: Some(gpu.buffer("parent links", &vec![ParentLink::OF_ROOT; n])?), ..self })
    }

    /// The bindings of kernels that trace rays, by variable name.
    #[must_use]
    pub fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound: Vec<NamedBinding<'_>> =
            vec![("nodes", &self.nodes), ("triangle_blocks", &self.halves), ("bvhs", &self.bvhs)];
        bound.extend(self.links.as_ref().map(|links| -> NamedBinding<'_> { ("links", links) }));
        match &self.level {
            Level::One => {}
            Level::Flat(first) => bound.push(("first_triangles", first)),
            Level::Two(Instances { instances, order, motions }) => {
                bound.push(("instances", instances));
                bound.push(("instance_order", order));
                bound.extend(motions.as_ref().map(|motions| -> NamedBinding<'_> { ("motions", motions) }));
            }
        }
        bound
    }

    /// `chosen` with the parts and constants for this scene. The caller still chooses the parts `mask` and `count`.
    #[must_use]
    pub fn specialise(&self, chosen: Specialisation) -> Specialisation {
        let level = match self.level {
            Level::One => "shared/level/single",
            Level::Flat(_) => "shared/level/flat",
            Level::Two(Instances { motions: None, .. }) => "shared/level/instances",
            Level::Two(_) => "shared/level/moving",
        };
        let kinds = if self.is_aligned { "shared/node_kinds/aligned" } else { "shared/node_kinds/any" };
        let chosen = chosen.part("level", level).part("node_kinds", kinds).part("traverse", self.traversal.file());
        let chosen = chosen.number("MAX_ITERATIONS", self.max_iterations);
        if self.traversal == Traversal::Stack { chosen.number("STACK_SIZE", self.depth.max(1)) } else { chosen }
    }

    /// Size in device memory, in bytes.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        let level = match &self.level {
            Level::One => 0,
            Level::Flat(first) => first.n_bytes(),
            Level::Two(Instances { instances, order, motions }) => {
                instances.n_bytes() + order.n_bytes() + motions.as_ref().map_or(0, Buffer::n_bytes)
            }
        };
        let links = self.links.as_ref().map_or(0, Buffer::n_bytes);
        self.nodes.n_bytes() + self.halves.n_bytes() + self.bvhs.n_bytes() + links + level
    }

    /// The same scene with another iteration limit, to test incomplete traversal.
    #[doc(hidden)]
    #[must_use]
    pub fn with_max_iterations(self, max_iterations: u32) -> Self {
        Self { max_iterations, ..self }
    }
}

/// Iteration limit on a driver that ended a loop of `REQUESTED_ITERATIONS` after `counted` iterations.
fn iteration_limit(counted: u32) -> u32 {
    if counted < REQUESTED_ITERATIONS { counted / LANES } else { MAX_ITERATIONS }
}

fn too_deep(depth: u32, most: u32) -> GpuError {
    GpuError::Limit {
        what: "the stack of a ray".to_owned(),
        need: depth.into(),
        limit: "levels of nodes",
        most: most.into(),
        remedy: "use another --builder or --device cpu",
    }
}

impl Start {
    /// Start of the BVH after one with these words.
    #[expect(clippy::cast_possible_truncation, reason = "a buffer of more than 2^32 quads is rejected by its size")]
    fn after(self, words: &RawBvh<'_>) -> Self {
        Self {
            node: self.node.wrapping_add((words.nodes.len() / 4) as u32),
            block: self.block.wrapping_add((words.blocks.len() / 4) as u32),
        }
    }
}

/// The words of all BVHs, concatenated.
fn joined(gpu: &Gpu, what: &str, parts: &[&[u32]]) -> Result<Buffer<Quad>, GpuError> {
    match parts {
        [one] => gpu.buffer(what, quads(one)),
        _ => gpu.buffer(what, &parts.iter().flat_map(|part| quads(part)).copied().collect::<Vec<Quad>>()),
    }
}

/// Words in groups of four. Lines and blocks contain whole quads.
fn quads<T: Pod>(words: &[T]) -> &[Quad] {
    bytemuck::cast_slice(words)
}

#[cfg(test)]
mod tests {
    use canted_fixtures::or_skip;
    use canted_trace::Watertight;

    use super::*;
    use crate::Choice;

    #[test]
    fn iteration_limit_is_shared_by_the_lanes_of_a_vector() {
        assert_eq!(iteration_limit(65_535), 8_191);
        assert_eq!(iteration_limit(REQUESTED_ITERATIONS - 1), (REQUESTED_ITERATIONS - 1) / LANES);
        assert_eq!([iteration_limit(0), iteration_limit(LANES - 1)], [0, 0]);
        assert_eq!(iteration_limit(REQUESTED_ITERATIONS), MAX_ITERATIONS);
    }

    /// On every driver the iteration limit ends traversal before the driver would.
    #[test]
    fn iteration_limit_is_below_the_drivers() {
        let test = "iteration_limit_is_below_the_drivers";
        let Some(gpu) = or_skip(test, Gpu::open(&Choice::Best)) else { return };
        let bvh = TriangleBvh::<Watertight>::build(&[], &[], &canted_wide::Config::default()).unwrap();
        let scene = TracedScene::single_level(&gpu, &bvh, &[0]).unwrap();
        let counted = loop_iterations(&gpu, 100_000).unwrap();
        let fits = if counted == 100_000 {
            scene.max_iterations == MAX_ITERATIONS
        } else {
            scene.max_iterations * LANES <= counted
        };
        assert!(fits, "limit {}, where a loop takes {counted}", scene.max_iterations);
        assert_eq!(scene.max_iterations, iteration_limit(counted));
    }
}
