//! Every structure over triangles: builds, camera rays and bytes, all in turn on one thread.

use anyhow::{Result, ensure};
use canted_bih::{Bih, LeafSize};
use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::Mesh;
use canted_kdtree::{KdTree, Traversal};
use canted_lbvh::Leaf;
use canted_obb::Aabb;
use canted_sah::{Builder, TopDownConfig};
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Costs, Preset, TriangleBvh};

use super::passes::one_thread;
use crate::clock;
use crate::models::Model;
use crate::report::{effort::Effort, samples::Samples};
use crate::wide::{alternate, engine::Engine, sets};

/// A structure and how it is built.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// With at most this many triangles per leaf; 0 chooses.
    Bih(u32),
    KdTree(Traversal),
    Binary(Builder),
    Wide(Preset),
    /// The preset `fast` with at most this many triangles per leaf.
    WideLeaf(usize),
}

pub(super) const SWEPT: Kind = Kind::Binary(Builder::TopDown(TopDownConfig::SWEEP, None));

impl Kind {
    pub(super) fn name(self) -> String {
        match self {
            Self::Bih(0) => "BIH, leaves chosen".to_owned(),
            Self::Bih(n) => format!("BIH, leaves of {n}"),
            Self::KdTree(Traversal::Stack) => "kd-tree with a stack".to_owned(),
            Self::KdTree(Traversal::Ropes) => "kd-tree with ropes".to_owned(),
            Self::Binary(Builder::Lbvh) => "Bvh2, radix tree".to_owned(),
            Self::Binary(_) => "Bvh2, full SAH sweep".to_owned(),
            Self::Wide(preset) => format!("WideBvh, {preset:?}").to_lowercase().replace("widebvh", "WideBvh"),
            Self::WideLeaf(n) => format!("WideBvh, fast, leaves of {n}"),
        }
    }

    fn build(self, mesh: &Mesh) -> Result<Box<dyn Structure>> {
        let (positions, triangles) = (&mesh.positions[..], &mesh.triangles[..]);
        Ok(match self {
            Self::Bih(n) => {
                let leaf_size = if n == 0 { LeafSize::Auto } else { LeafSize::AtMost(n) };
                let config = canted_bih::Config { leaf_size, ..canted_bih::Config::default() };
                Box::new(Bih::<Watertight>::build(positions, triangles, &config)?)
            }
            Self::KdTree(traversal) => {
                let config = canted_kdtree::Config { traversal, ..canted_kdtree::Config::default() };
                Box::new(KdTree::<Watertight>::build(positions, triangles, &config)?)
            }
            Self::Binary(builder) => {
                let (corners, bounds) = canted_lbvh::triangle_corners(positions, triangles)?;
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                let tree = canted_sah::build(&boxes, &bounds, &builder);
                Box::new(Bvh2::<Watertight>::over(tree, &corners, &bounds, &BuildConfig::default()))
            }
            Self::Wide(preset) => {
                Box::new(TriangleBvh::<Watertight>::build(positions, triangles, &Config::preset(preset))?)
            }
            Self::WideLeaf(max_leaf) => {
                let usual = Config::preset(Preset::Fast);
                let config = Config { costs: Costs { max_leaf, ..usual.costs }, ..usual };
                Box::new(TriangleBvh::<Watertight>::build(positions, triangles, &config)?)
            }
        })
    }
}

/// A built structure.
trait Structure: Engine + Send {
    /// Bytes of nodes, references and triangles.
    fn bytes(&self) -> [usize; 3];
    fn engine(self: Box<Self>) -> Box<dyn Engine>;
}

/// Structures have queries of the same names, but no common trait.
macro_rules! structure {
    ($structure:ty, |$of:ident| $bytes:expr) => {
        impl Engine for $structure {
            fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
                self.closest_hits(rays, hits);
            }

            fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
                self.occluded_many(rays, occluded);
            }
        }

        structure!(bytes $structure, |$of| $bytes);
    };
    (bytes $structure:ty, |$of:ident| $bytes:expr) => {
        impl Structure for $structure {
            fn bytes(&self) -> [usize; 3] {
                let $of = self;
                $bytes
            }

            fn engine(self: Box<Self>) -> Box<dyn Engine> {
                self
            }
        }
    };
}

structure!(Bih<Watertight>, |of| {
    let memory = of.memory();
    [memory.nodes, memory.references, memory.triangles]
});
structure!(KdTree<Watertight>, |of| {
    let memory = of.memory();
    [memory.nodes + memory.ropes, memory.references, memory.triangles]
});
structure!(Bvh2<Watertight>, |of| {
    let (nodes, references) = (of.pairs().n_bytes(), 4 * of.n_triangles());
    [nodes, references, of.n_bytes() - nodes - references]
});
// The numbers of the triangles are in their blocks.
structure!(bytes TriangleBvh<Watertight>, |of| {
    let (nodes, references) = (of.sizes().node_bytes, 4 * of.n_primitives());
    [nodes, references, of.sizes().leaf_bytes - references]
});

/// The measurements of one structure.
pub(super) struct Took {
    pub(super) kind: Kind,
    /// Milliseconds.
    pub(super) build: Samples,
    /// Milliseconds of all camera rays.
    pub(super) picture: Samples,
    /// Nodes, references, triangles.
    pub(super) bytes: [usize; 3],
}

impl Took {
    pub(super) fn both(&self) -> Samples {
        self.build.with(&self.picture, |build, picture| build + picture)
    }
}

/// Builds and traces every structure on one thread, in turn. All must have the same hits.
pub(super) fn measure(model: &Model, kinds: &[Kind], effort: Effort) -> Result<Vec<Took>> {
    one_thread(|| measure_here(model, kinds, effort))?
}

fn measure_here(model: &Model, kinds: &[Kind], effort: Effort) -> Result<Vec<Took>> {
    // Four views together have the pixels of one picture of twice the width and height.
    let rays = sets::camera(model, effort.pick(16, 128, 128));
    let rounds = effort.pick(2, 3, 5);
    let mut built = vec![];
    let mut builds = vec![vec![]; kinds.len()];
    for round in 0..=rounds {
        for (kind, builds) in kinds.iter().zip(&mut builds) {
            let (structure, took) = clock::time(|| kind.build(&model.mesh));
            let structure = structure?;
            if round > 0 {
                builds.push(took.cpu * 1e3);
            } else {
                built.push(structure);
            }
        }
    }
    let bytes: Vec<[usize; 3]> = built.iter().map(|structure| structure.bytes()).collect();
    let engines: Vec<Box<dyn Engine>> = built.into_iter().map(Structure::engine).collect();
    let (seconds, hits) = alternate::closest(&engines, &rays, rounds);
    for (kind, hits_of_kind) in kinds.iter().zip(&hits) {
        let n = hits_of_kind.iter().zip(&hits[0]).filter(|(a, b)| a != b).count();
        ensure!(n == 0, "{n} hits of '{}' differ from those of '{}'", kind.name(), kinds[0].name());
    }
    let took = kinds.iter().zip(builds).zip(seconds).zip(bytes).map(|(((&kind, build), seconds), bytes)| Took {
        kind,
        build: build.into(),
        picture: seconds.iter().map(|seconds| seconds.cpu * 1e3).collect::<Vec<_>>().into(),
        bytes,
    });
    Ok(took.collect())
}
