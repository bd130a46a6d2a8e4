//! A topology of less traversal cost than the radix tree: locally-ordered clustering.
//!
//! ```text
//! sorted leaves -> clusters -> partners -> merged                  while a tree has many clusters
//!                           -> all further iterations in one work-group       each tree
//!               -> first leaf of each node -> nodes, parents, leaves          as of the radix tree
//! ```
//!
//! The number of clusters stays on the device. As many iterations have dispatches as it usually takes until there are few clusters; the
//! device sizes each, and those that are not needed have no work-groups. A tree that still has many clusters then is finished by a
//! work-group all the same, which takes longer.

use bytemuck::{Pod, Zeroable};
use canted_shaders::{Number, wgsl};

use super::encoder::{PassSize, Slice};
use super::primitives::count;
use super::stages::Trees;
use super::{BuildEncoder, Primitives};
use crate::{Buffer, GpuError, NamedBinding, Variant};

/// Invocations of a work-group, its clusters in an iteration, and those of a tree that it merges without others: `FEW_CLUSTERS` of
/// `shared/build/ploc/scratch`.
const GROUP: u32 = 256;

/// Search radius, and first iterations with a small one, as in `PlocConfig::NEAR` of `canted-sah`; the radius is `REACH` of
/// `shared/build/ploc/scratch`.
const RADIUS: u32 = 14;
const N_NEAR: u32 = 3;

/// Clusters of a tree at which recorded iterations end. A work-group merges some more than it has invocations in about the time of a
/// dispatch.
const ENOUGH: u32 = 2 * GROUP;

/// `BLOCK` of `shared/build/ploc/states`: tiles whose kept clusters are also summed.
const BLOCK: u32 = 64;

/// Greatest height of a tree whose nodes are sorted by height, as oriented boxes are computed.
pub(super) const MAX_HEIGHT: u32 = 127;

/// `Cluster` of `shared/build.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Cluster {
    low: [f32; 3],
    number: u32,
    high: [f32; 3],
    word: u32,
}

/// As there.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Iteration {
    number: u32,
    radius: u32,
    n_near: u32,
    n_items: u32,
    n_recorded: u32,
    n_blocks: u32,
}

/// All clusters, before and after an iteration.
struct Clusters {
    clusters: [Buffer<Cluster>; 2],
    states: Buffer<u32>,
    scratch: Buffer<u32>,
    merges: Buffer<[u32; 4]>,
    links: Buffer<u32>,
    /// The first iteration.
    first: Iteration,
}

/// Iterations with dispatches of their own, where no tree has more than `longest` leaves. In meshes each keeps three fifths to two thirds
/// of the clusters, the first ones, with a small radius, somewhat more.
fn n_recorded(longest: u32) -> u32 {
    if longest <= GROUP { 0 } else { 2 * longest.div_ceil(ENOUGH).next_power_of_two().ilog2() }
}

/// Builds a tree for each range of `primitives` by locally-ordered clustering. `leaves` are the primitives in the order of the Morton
/// codes. Returns the primitives in the order of the leaves, and the trees, still without heights and depth. The topology is that of
/// `canted_sah`'s `ploc`. Nothing is read back: whether a tree has more than [`MAX_HEIGHT`] levels, as degenerate input may give, is known
/// when [`Built::depth`](super::Built::depth) is read.
///
/// # Errors
/// Out of memory, or device lost.
pub(super) fn ploc(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
) -> Result<(Buffer<u32>, Trees), GpuError> {
    let all = Clusters::new(build, primitives, leaves)?;
    all.merge(build, primitives)?;
    all.renumbered(build, primitives, leaves)
}

impl Clusters {
    fn new(build: &mut BuildEncoder<'_>, primitives: &Primitives, leaves: &Buffer<u32>) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        let n = primitives.len() as usize;
        let longest = primitives.ranges().iter().map(|range| range.count).max().unwrap_or(0);
        let (n_tiles, n_recorded) = (primitives.len().div_ceil(GROUP), n_recorded(longest));
        let n_blocks = n_tiles.div_ceil(BLOCK);
        let first =
            Iteration { number: 0, radius: RADIUS, n_near: N_NEAR, n_items: primitives.len(), n_recorded, n_blocks };
        let n_states = 4 * primitives.ranges().len() + (2 + n_recorded * (1 + n_blocks)) as usize;
        let all = Self {
            clusters: [gpu.zeroed("clusters", n)?, gpu.zeroed("clusters, second buffer", n)?],
            states: gpu.zeroed("clusters of trees", n_states)?,
            scratch: gpu.zeroed("partners of clusters", n + n_tiles as usize)?,
            merges: gpu.zeroed("merged pairs", n)?,
            links: gpu.zeroed("links of merged pairs", 2 * n)?,
            first,
        };
        let uniform = gpu.uniform("iteration", &first)?;
        let more: [NamedBinding<'_>; 2] = [("leaves", leaves), ("iteration", &uniform)];
        let bound = [&all.bound(primitives, false)[..], &more].concat();
        build.stage("tree", |dispatches| {
            dispatches.items(&*gpu.kernel(wgsl::build::ploc::START, &primitives.part())?, &bound, first.n_items)
        })?;
        Ok(all)
    }

    /// The bindings of all kernels, with the buffers of clusters in the order of an iteration.
    fn bound<'a>(&'a self, primitives: &'a Primitives, is_odd: bool) -> Vec<NamedBinding<'a>> {
        let [even, odd] = &self.clusters;
        let (from, to) = if is_odd { (odd, even) } else { (even, odd) };
        primitives.bound(&[
            ("clusters", from),
            ("clusters_out", to),
            ("states", &self.states),
            ("scratch", &self.scratch),
            ("merges", &self.merges),
            ("links", &self.links),
        ])
    }

    /// All iterations.
    fn merge(&self, build: &mut BuildEncoder<'_>, primitives: &Primitives) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let chosen = Variant::none().number(Number::Group, GROUP);
        let all = gpu.uniform("slice", &Slice::ALL)?;
        let n_tiles = self.first.n_items.div_ceil(GROUP);
        build.stage("tree", |dispatches| {
            let mut size: Option<Buffer<PassSize>> = None;
            for number in 0..self.first.n_recorded {
                let iteration = gpu.uniform("iteration", &Iteration { number, ..self.first })?;
                let next = PassSize::buffer(gpu, 0)?;
                let mut bound = self.bound(primitives, number % 2 == 1);
                let more: [NamedBinding<'_>; 2] = [("iteration", &iteration), ("pass_out", &next)];
                bound.extend(more);
                for kernel in [wgsl::build::ploc::PARTNERS, wgsl::build::ploc::MERGE] {
                    let kernel = gpu.kernel(kernel, &chosen)?;
                    match &size {
                        None => dispatches.tiles(&kernel, &bound, [0, n_tiles])?,
                        Some(size) => {
                            let with_slice = [&bound[..], &[("slice", &all)]].concat();
                            dispatches.work.dispatch_indirect(&kernel, &with_slice, size, 0)?;
                        }
                    }
                }
                size = Some(next);
            }
            let iteration = gpu.uniform("iteration", &self.first)?;
            let bound = [&self.bound(primitives, false)[..], &[("iteration", &iteration)]].concat();
            let n_trees = if self.first.n_items == 0 { 0 } else { count(primitives.ranges().len()) };
            dispatches.tiles(&*gpu.kernel(wgsl::build::ploc::FINISH, &chosen)?, &bound, [0, n_trees])
        })
    }

    /// The trees in the form of the radix tree.
    fn renumbered(
        &self,
        build: &mut BuildEncoder<'_>,
        primitives: &Primitives,
        leaves: &Buffer<u32>,
    ) -> Result<(Buffer<u32>, Trees), GpuError> {
        let gpu = build.gpu();
        let n = primitives.len() as usize;
        let trees = Trees::empty(gpu, n, MAX_HEIGHT, true)?;
        let leaves_out = gpu.zeroed("leaves", n)?;
        let firsts = gpu.zeroed::<u32>("first leaves", n)?;
        let bound = primitives.bound(&[
            ("merges", &self.merges),
            ("links", &self.links),
            ("firsts", &firsts),
            ("leaves", leaves),
            ("nodes", &trees.nodes),
            ("parents", &trees.parents),
            ("leaves_out", &leaves_out),
        ]);
        build.stage("tree", |dispatches| {
            dispatches.items(&*gpu.kernel(wgsl::build::ploc::RANGES, &Variant::none())?, &bound, primitives.len())?;
            dispatches.items(&*gpu.kernel(wgsl::build::ploc::NODES, &Variant::none())?, &bound, primitives.len())
        })?;
        Ok((leaves_out, trees))
    }
}
