//! A topology of less traversal cost than the radix tree: locally-ordered clustering.
//!
//! ```text
//! sorted leaves -> clusters -> partners -> kept -> prefix sums -> merged -> counted      while a tree has many clusters
//!                           -> all further iterations in one work-group       each tree
//!               -> first leaf of each node -> nodes, parents, leaves          as of the radix tree
//! ```

use bytemuck::{Pod, Zeroable};
use canted_shaders::{Number, ShaderName, wgsl};

use super::encoder::Dispatches;
use super::primitives::count;
use super::sort::prefix_sums;
use super::stages::{Trees, depths};
use super::{BuildEncoder, Primitives};
use crate::{Buffer, GpuError, Variant};

/// Clusters of a tree that a work-group merges on its own.
const GROUP: u32 = 256;

/// Search radius, and first iterations with a small one, as in `PlocConfig::NEAR` of `canted-sah`.
const RADIUS: u32 = 14;
const N_NEAR: u32 = 3;

/// Iterations per read-back.
const AT_ONCE: u32 = 3;

/// Most iterations: of two, one merges at least a sixteenth.
const MAX_ITERATIONS: u32 = 1 << 10;

/// Greatest height of a tree whose nodes are sorted by height, as oriented boxes are computed.
const MAX_HEIGHT: u32 = 127;

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
}

/// All clusters, before and after an iteration.
struct Clusters {
    n: u32,
    clusters: [Buffer<Cluster>; 2],
    states: [Buffer<[u32; 4]>; 2],
    partners: Buffer<u32>,
    kept: Buffer<u32>,
    prefixes: Buffer<u32>,
    /// Before each iteration: the number of clusters, and the most of a tree.
    remaining: Buffer<u32>,
    longest: Buffer<u32>,
    merges: Buffer<[u32; 4]>,
    links: Buffer<u32>,
}

/// Builds a tree for each range of `primitives` by locally-ordered clustering. `leaves` are the primitives in the order of the Morton
/// codes. Returns the primitives in the order of the leaves, and the trees. The topology is that of `canted_sah`'s `ploc`.
///
/// # Errors
/// A recorded build, because the number of clusters is read back; a tree of more than 127 levels, as degenerate input may give; out of
/// memory, or device lost.
pub(super) async fn ploc(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
) -> Result<(Buffer<u32>, Trees), GpuError> {
    if build.is_recorded() {
        let what = "a recorded build by clustering, which reads the number of clusters back".to_owned();
        return Err(GpuError::Unsupported { what });
    }
    let mut all = Clusters::new(build, primitives, leaves)?;
    let iteration = all.merge_many(build, primitives).await?;
    all.finish(build, primitives, iteration)?;
    all.renumbered(build, primitives, leaves).await
}

impl Clusters {
    fn new(build: &mut BuildEncoder<'_>, primitives: &Primitives, leaves: &Buffer<u32>) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        let n = primitives.len() as usize;
        let n_trees = primitives.ranges().len();
        let words = |what: &str| gpu.zeroed::<u32>(what, n);
        let all = Self {
            n: primitives.len(),
            clusters: [gpu.zeroed("clusters", n)?, gpu.zeroed("clusters, second buffer", n)?],
            states: [gpu.zeroed("clusters of trees", n_trees)?, gpu.zeroed("clusters of trees", n_trees)?],
            partners: words("partners of clusters")?,
            kept: words("kept clusters")?,
            prefixes: words("kept clusters before each")?,
            remaining: gpu.zeroed("numbers of clusters", MAX_ITERATIONS as usize + 1)?,
            longest: gpu.zeroed("greatest numbers of clusters", MAX_ITERATIONS as usize + 1)?,
            merges: gpu.zeroed("merged pairs", n)?,
            links: gpu.zeroed("links of merged pairs", 2 * n)?,
        };
        let bound = primitives.bound(&[
            ("leaves", leaves),
            ("clusters", &all.clusters[0]),
            ("states", &all.states[0]),
            ("remaining", &all.remaining),
        ]);
        build.stage("tree", |dispatches| {
            dispatches.items(&*gpu.kernel(wgsl::build::ploc::START, &primitives.part())?, &bound, all.n)
        })?;
        Ok(all)
    }

    /// Iterates until no tree has more clusters than a work-group merges. Returns the number of iterations.
    async fn merge_many(&mut self, build: &mut BuildEncoder<'_>, primitives: &Primitives) -> Result<u32, GpuError> {
        let gpu = build.gpu();
        let mut number = 0;
        let mut longest = primitives.ranges().iter().map(|range| range.count).max().unwrap_or(0);
        let mut n = self.n;
        while longest > GROUP {
            if number + AT_ONCE > MAX_ITERATIONS {
                return Err(GpuError::Invalid { message: "clustering does not end".to_owned() });
            }
            build.stage("tree", |dispatches| {
                for _ in 0..AT_ONCE {
                    self.iterate(dispatches, primitives, number, n)?;
                    self.clusters.swap(0, 1);
                    self.states.swap(0, 1);
                    number += 1;
                }
                Ok(())
            })?;
            n = gpu.read_at(&self.remaining, &[number]).await?[0];
            longest = gpu.read_at(&self.longest, &[number]).await?[0];
        }
        Ok(number)
    }

    /// An iteration over at most `n` clusters.
    fn iterate(
        &self,
        dispatches: &mut Dispatches<'_>,
        primitives: &Primitives,
        number: u32,
        n: u32,
    ) -> Result<(), GpuError> {
        let gpu = dispatches.gpu;
        let uniform = gpu.uniform("iteration", &Iteration { number, radius: RADIUS, n_near: N_NEAR })?;
        let [clusters, clusters_out] = &self.clusters;
        let [states, states_out] = &self.states;
        let bound = primitives.bound(&[
            ("clusters", clusters),
            ("clusters_out", clusters_out),
            ("states", states),
            ("states_out", states_out),
            ("partners", &self.partners),
            ("kept", &self.kept),
            ("prefixes", &self.prefixes),
            ("remaining", &self.remaining),
            ("longest", &self.longest),
            ("merges", &self.merges),
            ("links", &self.links),
            ("iteration", &uniform),
        ]);
        let kernel = |name: ShaderName| gpu.kernel(name, &Variant::none());
        dispatches.items(&*kernel(wgsl::build::ploc::PARTNERS)?, &bound, n)?;
        dispatches.items(&*kernel(wgsl::build::ploc::KEEP)?, &bound, n)?;
        prefix_sums(dispatches, &self.kept, &self.prefixes, [0, n])?;
        dispatches.items(&*kernel(wgsl::build::ploc::MERGE)?, &bound, n)?;
        dispatches.items(&*kernel(wgsl::build::ploc::STATES)?, &bound, count(primitives.ranges().len()))
    }

    /// All further iterations, after `number` iterations.
    fn finish(&self, build: &mut BuildEncoder<'_>, primitives: &Primitives, number: u32) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let uniform = gpu.uniform("iteration", &Iteration { number, radius: RADIUS, n_near: N_NEAR })?;
        let bound = primitives.bound(&[
            ("clusters", &self.clusters[0]),
            ("states", &self.states[0]),
            ("merges", &self.merges),
            ("links", &self.links),
            ("iteration", &uniform),
        ]);
        build.stage("tree", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::ploc::FINISH, &Variant::none().number(Number::Group, GROUP))?;
            let n_trees = if self.n == 0 { 0 } else { count(primitives.ranges().len()) };
            dispatches.tiles(&kernel, &bound, [0, n_trees])
        })
    }

    /// The trees in the form of the radix tree.
    async fn renumbered(
        &self,
        build: &mut BuildEncoder<'_>,
        primitives: &Primitives,
        leaves: &Buffer<u32>,
    ) -> Result<(Buffer<u32>, Trees), GpuError> {
        let gpu = build.gpu();
        let n = self.n as usize;
        let trees = Trees::empty(gpu, n, MAX_HEIGHT)?;
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
            dispatches.items(&*gpu.kernel(wgsl::build::ploc::RANGES, &Variant::none())?, &bound, self.n)?;
            dispatches.items(&*gpu.kernel(wgsl::build::ploc::NODES, &Variant::none())?, &bound, self.n)
        })?;
        depths(build, primitives, &trees)?;
        let depth = gpu.read(&trees.depth).await?[0];
        if depth > MAX_HEIGHT {
            return Err(GpuError::Unsupported {
                what: format!("a clustered tree of {depth} levels, more than {MAX_HEIGHT}"),
            });
        }
        Ok((leaves_out, trees))
    }
}
