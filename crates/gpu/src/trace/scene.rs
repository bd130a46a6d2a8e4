//! A scene's trees in the device's memory.

use bytemuck::Pod;
use canted_obb::Aabb;
use canted_tlas::Instance;
use canted_wide::{LaneKernel, RawBvh, TriangleBvh};

use super::coordinates::check_reach;
use super::layout::{BvhHeader, HitError, InstanceData, Quad, Start};
use super::motion::MotionData;
use super::top_level::TopLevel;
use super::traversal::{ParentLink, Traversal, is_aligned, links};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation, loop_iterations};

/// Most entries of the stack in an invocation's own memory: trees of ours have about ten levels.
const MOST_STACK: u32 = 128;

/// Levels whose waiting children four words hold, eight bits each.
const MOST_BITS: u32 = 16;

/// Turns of loops that are asked for, to see whether the driver leaves loops early.
const WANTED_TURNS: u32 = 100_000;

/// Most turns of an invocation where it does not: about a second of the slowest devices, far more than rays need.
const MOST_TURNS: u32 = 1 << 18;

/// Invocations that share one count of turns where the driver leaves loops early: those of one vector.
const SHARING: u32 = 8;

/// Trees of a scene, ready for kernels that trace rays: `trace/closest`, `trace/occluded`, and all that use `shared/trace`.
///
/// The device walks the nodes and triangles that the CPU walks. Its triangle test hits whatever
/// [`Watertight`](canted_trace::Watertight) hits, and what comes within [`HIT_ERROR`](crate::HIT_ERROR) of a ray besides, so a
/// first hit may be another than the CPU's by that much.
pub struct TracedScene {
    nodes: Buffer<Quad>,
    halves: Buffer<Quad>,
    trees: Buffer<BvhHeader>,
    level: Level,
    walk: Traversal,
    /// Ways up the trees, where the walk needs them.
    links: Option<Buffer<ParentLink>>,
    /// Whether no node leans.
    is_aligned: bool,
    /// Nodes on the longest way down.
    depth: u32,
    turns: u32,
}

/// What stands above the trees of meshes.
enum Level {
    /// Nothing: one instance.
    One,
    /// First triangles of all instances, whose triangles are under one tree.
    Flat(Buffer<u32>),
    /// Instances under a tree.
    Two(Instances),
}

/// Instances in the device's memory.
struct Instances {
    places: Buffer<InstanceData>,
    /// Their numbers in the order of the outer tree.
    order: Buffer<u32>,
    /// Ways of those that move, where any does.
    motions: Option<Buffer<MotionData>>,
}

impl TracedScene {
    /// Uploads one tree over the triangles of all instances, in world space; `first_triangles` has the number of each
    /// instance's first, in order.
    ///
    /// # Errors
    /// Coordinates above [`MAX_COORDINATE`](crate::MAX_COORDINATE), more than the device's limits allow, or a device that is lost.
    pub fn single_level<K: LaneKernel>(
        gpu: &Gpu,
        tree: &TriangleBvh<K>,
        first_triangles: &[u32],
    ) -> Result<Self, GpuError> {
        let words = tree.words();
        check_reach(|| "the tree over all instances".to_owned(), words.reach.into())?;
        let level = if first_triangles.len() > 1 {
            Level::Flat(gpu.buffer("first triangles of instances", first_triangles)?)
        } else {
            Level::One
        };
        let error = HitError::of_triangles(words.reach);
        Self::new(gpu, &[(words, error)], level, words.depth)
    }

    /// Uploads a tree a mesh and the instances that place them, with a tree over these.
    ///
    /// # Errors
    /// As [`TracedScene::single_level`], of coordinates in the world, too; instances that no bottom level belongs to, or whose transform is
    /// nearer to singular, anywhere on its way, than the arithmetic of kernels allows
    /// ([`MotionPolynomials::norm_of_inverse`](crate::MotionPolynomials::norm_of_inverse)).
    pub fn two_level<K: LaneKernel>(
        gpu: &Gpu,
        meshes: &[&TriangleBvh<K>],
        instances: &[Instance],
    ) -> Result<Self, GpuError> {
        let words: Vec<(RawBvh<'_>, Aabb)> = meshes.iter().map(|mesh| (mesh.words(), mesh.aabb())).collect();
        let outer = TopLevel::new(&words, instances)?;
        let motions = Some(&outer.motions).filter(|motions| !motions.is_empty());
        let level = Level::Two(Instances {
            places: gpu.buffer("instances", &outer.places)?,
            order: gpu.buffer("instances in the order of their tree", &outer.instances)?,
            motions: motions.map(|motions| gpu.buffer("motions of instances", motions)).transpose()?,
        });
        let deepest = words.iter().map(|(words, _)| words.depth).max().unwrap_or(0);
        let (outer_words, _) = outer.tree.words();
        let trees: Vec<_> = std::iter::once((outer_words, outer.error))
            .chain(words.iter().map(|(words, _)| (*words, HitError::of_triangles(words.reach))))
            .collect();
        Self::new(gpu, &trees, level, outer_words.depth + deepest)
    }

    fn new(gpu: &Gpu, trees: &[(RawBvh<'_>, HitError)], level: Level, depth: u32) -> Result<Self, GpuError> {
        if depth > MOST_STACK {
            return Err(too_deep(depth, MOST_STACK));
        }
        let nodes: Vec<&[u32]> = trees.iter().map(|(words, _)| words.nodes).collect();
        let blocks: Vec<&[u32]> = trees.iter().map(|(words, _)| words.blocks).collect();
        let mut start = Start::default();
        let headers = trees.iter().map(|(words, error)| {
            let header = BvhHeader::new(words, start, *error);
            start = start.after(words);
            header
        });
        let headers: Vec<BvhHeader> = headers.collect();
        let turns = turns_of(loop_iterations(gpu, WANTED_TURNS)?);
        Ok(Self {
            nodes: joined(gpu, "nodes", &nodes)?,
            halves: joined(gpu, "blocks of triangles", &blocks)?,
            trees: gpu.buffer("trees", &headers)?,
            level,
            walk: Traversal::Stack,
            links: None,
            is_aligned: trees.iter().all(|(words, _)| is_aligned(quads(words.nodes), words.root)),
            depth,
            turns,
        })
    }

    /// The same scene, in which rays find their way back otherwise.
    ///
    /// # Errors
    /// Trees too deep for the walk, or a device that is lost.
    pub fn with_traversal(self, gpu: &Gpu, walk: Traversal) -> Result<Self, GpuError> {
        if walk == Traversal::Bits && self.depth > MOST_BITS {
            return Err(too_deep(self.depth, MOST_BITS));
        }
        let links = match walk {
            Traversal::Stack => None,
            Traversal::Bits | Traversal::Links => {
                let (nodes, trees) = (gpu.read(&self.nodes)?, gpu.read(&self.trees)?);
                Some(gpu.buffer("ways up", &links(&nodes, &trees))?)
            }
        };
        Ok(Self { walk, links, ..self })
    }

    /// The same scene with links that lead nowhere: to see that tests see it.
    ///
    /// # Errors
    /// A device that is lost.
    #[doc(hidden)]
    pub fn without_parent_links(self, gpu: &Gpu) -> Result<Self, GpuError> {
        let n = self.links.as_ref().map_or(0, Buffer::len);
        Ok(Self { links: Some(gpu.buffer("ways up", &vec![ParentLink::NOWHERE; n])?), ..self })
    }

    /// Everything that kernels which trace rays bind, by the names of their variables.
    #[must_use]
    pub fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound: Vec<NamedBinding<'_>> =
            vec![("nodes", &self.nodes), ("triangle_blocks", &self.halves), ("bvhs", &self.trees)];
        bound.extend(self.links.as_ref().map(|links| -> NamedBinding<'_> { ("links", links) }));
        match &self.level {
            Level::One => {}
            Level::Flat(first) => bound.push(("first_triangles", first)),
            Level::Two(Instances { places, order, motions }) => {
                bound.push(("instances", places));
                bound.push(("instance_order", order));
                bound.extend(motions.as_ref().map(|motions| -> NamedBinding<'_> { ("motions", motions) }));
            }
        }
        bound
    }

    /// `chosen` with the parts and numbers that the scene's kind needs. The caller still chooses the parts `mask` and `count`.
    #[must_use]
    pub fn specialise(&self, chosen: Specialisation) -> Specialisation {
        let level = match self.level {
            Level::One => "shared/level/single",
            Level::Flat(_) => "shared/level/flat",
            Level::Two(Instances { motions: None, .. }) => "shared/level/instances",
            Level::Two(_) => "shared/level/moving",
        };
        let kinds = if self.is_aligned { "shared/node_kinds/aligned" } else { "shared/node_kinds/any" };
        let chosen = chosen.part("level", level).part("node_kinds", kinds).part("traverse", self.walk.file());
        let chosen = chosen.number("MAX_ITERATIONS", self.turns);
        if self.walk == Traversal::Stack { chosen.number("STACK_SIZE", self.depth.max(1)) } else { chosen }
    }

    /// Bytes in the device's memory.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        let level = match &self.level {
            Level::One => 0,
            Level::Flat(first) => first.n_bytes(),
            Level::Two(Instances { places, order, motions }) => {
                places.n_bytes() + order.n_bytes() + motions.as_ref().map_or(0, Buffer::n_bytes)
            }
        };
        let links = self.links.as_ref().map_or(0, Buffer::n_bytes);
        self.nodes.n_bytes() + self.halves.n_bytes() + self.trees.n_bytes() + links + level
    }

    /// The same scene whose walks end after this many turns of loops: to see what becomes of rays that are cut short.
    #[doc(hidden)]
    #[must_use]
    pub fn with_max_iterations(self, turns: u32) -> Self {
        Self { turns, ..self }
    }
}

/// Turns that a walk may take where the driver let a loop of `WANTED_TURNS` take `counted`.
fn turns_of(counted: u32) -> u32 {
    if counted < WANTED_TURNS { counted / SHARING } else { MOST_TURNS }
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
    /// The start of the tree that follows one.
    #[expect(clippy::cast_possible_truncation, reason = "a buffer of more than 2^32 quads is refused by its size")]
    fn after(self, words: &RawBvh<'_>) -> Self {
        Self {
            node: self.node.wrapping_add((words.nodes.len() / 4) as u32),
            block: self.block.wrapping_add((words.blocks.len() / 4) as u32),
        }
    }
}

/// Words of all trees, one after another.
fn joined(gpu: &Gpu, what: &str, parts: &[&[u32]]) -> Result<Buffer<Quad>, GpuError> {
    match parts {
        [one] => gpu.buffer(what, quads(one)),
        _ => gpu.buffer(what, &parts.iter().flat_map(|part| quads(part)).copied().collect::<Vec<Quad>>()),
    }
}

/// Words in fours; lines and blocks are made of whole ones.
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
    fn a_driver_that_leaves_loops_early_leaves_each_of_a_vector_its_share() {
        assert_eq!(turns_of(65_535), 8_191);
        assert_eq!(turns_of(WANTED_TURNS - 1), (WANTED_TURNS - 1) / SHARING);
        assert_eq!([turns_of(0), turns_of(SHARING - 1)], [0, 0]);
        assert_eq!(turns_of(WANTED_TURNS), MOST_TURNS);
    }

    /// Whatever the driver does, the count of a walk ends it before the driver would.
    #[test]
    fn walks_may_take_what_the_driver_lets_loops_take() {
        let test = "walks_may_take_what_the_driver_lets_loops_take";
        let Some(gpu) = or_skip(test, Gpu::open(&Choice::Best)) else { return };
        let tree = TriangleBvh::<Watertight>::build(&[], &[], &canted_wide::Config::default()).unwrap();
        let scene = TracedScene::single_level(&gpu, &tree, &[0]).unwrap();
        let counted = loop_iterations(&gpu, 100_000).unwrap();
        let fits = if counted == 100_000 { scene.turns == MOST_TURNS } else { scene.turns * SHARING <= counted };
        assert!(fits, "{} turns of a walk, where a loop takes {counted}", scene.turns);
        assert_eq!(scene.turns, turns_of(counted));
    }
}
