//! Binary trees over inputs that codes cannot separate: each primitive once, parents contain children, bounded depth. The same trees
//! built on a device: the CPU's integers, and boxes that contain everything below them. Inputs above the limits: an error with the
//! count, before the input is read.
//!
//! Not covered: time, which grows no faster than the scene (`hits/degenerate.rs`); each stage of a device on the CPU's previous output, many
//! meshes at once, and a second level (`twins_build`); inputs just at the limits, and above those of 2^30 triangles in memory and of
//! 2^26 instances, which need too much memory; the crates' own tests use smaller limits.

use std::fmt::Display;

use canted_fixtures::{Mesh, equal_centroids, identical, outlier, soup};
use canted_gpu::{
    Choice, Gpu, block_on,
    build::{BuildConfig, BuildEncoder, Built, Node, Primitives, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Corners, Domain, Strategy, Tree, VolumeConfig};
use canted_obb::{Aabb, Affine, Obb};
use canted_renderer::{BvhKind, Levels, SceneBvh, SceneBvhConfig, flatten};
use canted_sah::{Builder, PlocConfig, TopDownConfig, build};
use canted_scene::{Instance, MeshId, Scene};
use canted_trace::ScaledRay;
use canted_wide::{MAX_PRIMITIVES, MAX_TRIANGLES, Primitive, PrimitiveHit, TriangleBvh, WideBvh};
use rayon::prelude::*;

use super::{Oracle, Promise, Row};

/// A builder by name.
type Method = (&'static str, fn(&[Corners], &Aabb) -> Tree);

const METHODS: [Method; 4] = [
    ("lbvh, 30 bits", |corners, bounds| radix(corners, bounds, Bits::B30)),
    ("lbvh, 63 bits", |corners, bounds| radix(corners, bounds, Bits::B63)),
    ("ploc", |corners, bounds| of_boxes(corners, bounds, &Builder::Ploc(PlocConfig::NEAR, None))),
    ("top down", |corners, bounds| of_boxes(corners, bounds, &Builder::TopDown(TopDownConfig::BINNED, None))),
];

fn radix(corners: &[Corners], bounds: &Aabb, bits: Bits) -> Tree {
    lbvh::radix(lbvh::sort_by_code(&lbvh::morton_codes(&Domain::new(bounds, 3, bits), corners), bits))
}

fn of_boxes(corners: &[Corners], bounds: &Aabb, builder: &Builder) -> Tree {
    let boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::from_points(*corners)).collect();
    build(&boxes, bounds, builder)
}

/// Kinds of input, each with several numbers of triangles.
pub(super) fn cases() -> Vec<(&'static str, Vec<Mesh>)> {
    vec![
        ("0, 1, 2 triangles", (0..3).map(|n| soup(3, n)).collect()),
        ("2^k and 2^k ± 1 triangles", [3, 4, 5, 255, 256, 257, 4095, 4096, 4097].map(|n| soup(4, n)).into()),
        ("20,000 equal triangles", vec![identical(20_000)]),
        ("20,000 equal centroids", vec![equal_centroids(20_000)]),
        ("equal triangles among others", vec![soup(5, 2_000).joined(&identical(2_000))]),
        ("all on the x axis", vec![soup(6, 2_000).placed(|[x, _, _]| [x, 0.0, 0.0])]),
        ("in one plane", vec![soup(7, 2_000).placed(|[x, y, _]| [x, y, 0.25])]),
        ("one far outlier, 1e7", vec![outlier(20_000)]),
        ("denormal extent", vec![soup(8, 500).placed(|p| p.map(|x| x * 1e-40))]),
        (
            "scale ratio 1e12",
            vec![soup(9, 500).placed(|p| p.map(|x| x * 1e-6)).joined(&soup(10, 500).placed(|p| p.map(|x| x * 1e6)))],
        ),
    ]
}

pub(super) fn rows() -> Vec<Row> {
    let mut rows = vec![];
    for (case, meshes) in cases() {
        let sound = Promise::none(
            "tree",
            case,
            "each primitive once, inside all its ancestors",
            Oracle::Structure,
            "invalid trees",
        );
        let trees =
            METHODS.map(|(name, method)| (name, meshes.iter().map(|mesh| check(mesh, method)).collect::<Vec<_>>()));
        for (name, checked) in &trees {
            rows.push(sound.count(*name, checked.len(), checked.iter().filter(|(flawed, _)| *flawed).count()));
        }
        for ((name, checked), n_bits) in trees.iter().zip([30.0, 63.0]) {
            let deep = Promise {
                stage: "tree",
                case,
                promise: "depth at most code bits + ⌈log2 n⌉ + 1",
                oracle: Oracle::Structure,
                bound: 1.0,
                unit: "of bits + ⌈log2 n⌉ + 1",
            };
            let of_bound = |(mesh, (_, depth)): (&Mesh, &(bool, u32))| {
                let n_bits_of_count = mesh.triangles.len().max(1).next_power_of_two().trailing_zeros();
                f64::from(*depth) / (n_bits + f64::from(n_bits_of_count) + 1.0)
            };
            rows.push(deep.row(*name, checked.len(), meshes.iter().zip(checked).map(of_bound).fold(0.0, f64::max)));
        }
    }
    [rows, cells()].concat()
}

/// Whether the tree is invalid, and its depth.
fn check(mesh: &Mesh, method: fn(&[Corners], &Aabb) -> Tree) -> (bool, u32) {
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).expect("finite vertices");
    let tree = method(&corners, &bounds);
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    let volumes = lbvh::volumes(&tree, &sorted, &VolumeConfig::default());
    (lbvh::check(&tree, &volumes, &sorted).is_err(), tree.depth)
}

/// Cells at the ends of the grid, and of zeros of either sign.
fn cells() -> Vec<Row> {
    const LAST: Promise =
        Promise::none("cells", "greatest coordinate", "the last cell, not the first", Oracle::Known, "wrong cells");
    const ZEROS: Promise = Promise::none("cells", "-0.0", "the same cell as +0.0", Oracle::Same, "codes differ");
    let both = [("30 bits", Bits::B30), ("63 bits", Bits::B63)];
    let mut rows = vec![];
    for (name, bits) in both {
        let wrong = |extent: &&f32| {
            let domain = Domain::new(&Aabb { min: [0.0; 3], max: [**extent; 3] }, 3, bits);
            domain.cell(0, 3.0 * **extent) != (1 << bits.per_axis()) - 1 || domain.cell(0, 0.0) != 0
        };
        let extents = [1.0, 0.1, 1e-20, 1e15, 3.7e5];
        rows.push(LAST.count(name, extents.len(), extents.iter().filter(wrong).count()));
    }
    for (name, bits) in both {
        let at = |zero: f32| {
            let corners = [[[zero, -1.0, 0.5], [zero, 0.3, zero], [zero; 3]], [[-1.0; 3], [1.0; 3], [zero; 3]]];
            let bounds = Aabb::from_points(corners.iter().flatten().copied());
            lbvh::morton_codes(&Domain::new(&bounds, 3, bits), &corners)
        };
        let differ = at(0.0).iter().zip(at(-0.0)).filter(|&(&a, b)| a != b).count();
        rows.push(ZEROS.count(name, 2, differ));
    }
    rows
}

/// Devices promise nothing for this case: they may flush subnormal numbers to zero.
const BELOW_NORMAL: &str = "denormal extent";

const STAGE_ON_DEVICE: &str = "tree on a device";

/// Why there are no rows if there is no adapter.
pub(super) fn not_tried() -> Option<String> {
    let there_is_none = block_on(Gpu::open(&Choice::Best)).is_err();
    there_is_none.then(|| format!("the stage \"{STAGE_ON_DEVICE}\" and instances on a device: no device"))
}

/// Rows of the best adapter; empty without an adapter.
pub(super) fn rows_of_device() -> Vec<Row> {
    let Ok(gpu) = block_on(Gpu::open(&Choice::Best)) else { return vec![] };
    cases().iter().flat_map(|(case, meshes)| of_case(&gpu, case, meshes)).collect()
}

fn of_case(gpu: &Gpu, case: &'static str, meshes: &[Mesh]) -> Vec<Row> {
    let of = |promise, oracle, unit| {
        let promise = Promise::none(STAGE_ON_DEVICE, case, promise, oracle, unit);
        if case == BELOW_NORMAL { promise.reported() } else { promise }
    };
    let same = of("the CPU's leaves and nodes", Oracle::Same, "trees differ");
    let contains = of("contains every vertex below a node", Oracle::Exact, "vertices outside");
    let twins: Vec<Twin> = meshes.iter().map(Twin::of).collect();
    let mut rows = vec![];
    for strategy in STRATEGIES {
        let built: Vec<Built> = twins.iter().map(|twin| twin.built(gpu, strategy)).collect();
        if strategy == Strategy::Aabb {
            let n_others = twins.iter().zip(&built).filter(|(twin, built)| twin.differs(gpu, built)).count();
            rows.push(same.count("device, 63 bits", twins.len(), n_others));
        } else {
            let counts = twins.iter().zip(&built).map(|(twin, built)| twin.outside(gpu, built));
            let [n_outside, n] = counts.fold([0; 2], |[a, b], [c, d]| [a + c, b + d]);
            rows.push(contains.count_certain(format!("device, {strategy:?}"), n, n_outside));
        }
    }
    rows
}

/// A mesh and the tree that the CPU builds over it.
struct Twin {
    corners: Vec<Corners>,
    tree: Tree,
}

impl Twin {
    fn of(mesh: &Mesh) -> Self {
        let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).expect("finite vertices");
        let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
        Self { corners, tree: lbvh::radix(lbvh::sort_by_code(&codes, Bits::B63)) }
    }

    fn built(&self, gpu: &Gpu, strategy: Strategy) -> Built {
        let items = Primitives::triangles(gpu, [&self.corners[..]]).expect("a small mesh");
        let config = BuildConfig { bits: Bits::B63, strategy };
        Built::new(&mut BuildEncoder::new(gpu), items, config).expect("a small tree")
    }

    /// Whether the device's leaves or nodes differ from the CPU's.
    fn differs(&self, gpu: &Gpu, built: &Built) -> bool {
        let leaves = block_on(gpu.read(&built.leaves)).expect("leaves come back");
        let nodes = block_on(gpu.read(&built.trees.nodes)).expect("nodes come back");
        let own: Vec<u32> = self.tree.leaves.iter().map(|leaf| leaf.0).collect();
        let same = self.tree.nodes.iter().map(node_of_device).eq(nodes.into_iter().take(self.tree.nodes.len()));
        leaves != own || !same
    }

    /// How many vertices lie outside a box above them, and how many were checked.
    fn outside(&self, gpu: &Gpu, built: &Built) -> [usize; 2] {
        let obbs: Vec<Obb> =
            built.obbs.as_ref().map_or_else(Vec::new, |obbs| block_on(gpu.read(obbs)).expect("boxes come back"));
        let sorted = lbvh::in_leaf_order(&self.corners, &self.tree.leaves);
        let of_node = |(node_of_device, obb): (&lbvh::Node, &Obb)| {
            let below = sorted[node_of_device.first as usize..=node_of_device.last as usize].as_flattened();
            [below.iter().filter(|&&vertex| !obb.contains(vertex)).count(), below.len()]
        };
        let sum = |[a, b]: [usize; 2], [c, d]: [usize; 2]| [a + c, b + d];
        self.tree.nodes.par_iter().zip(&obbs).map(of_node).reduce(|| [0; 2], sum)
    }
}

/// A CPU node in the device's layout.
fn node_of_device(node_of_device: &lbvh::Node) -> Node {
    let child = |child: Child| match child.kind() {
        ChildKind::Leaf(position) => position | 1 << 31,
        ChildKind::Inner(id) => id.0,
    };
    Node {
        left: child(node_of_device.left),
        right: child(node_of_device.right),
        first: node_of_device.first,
        last: node_of_device.last,
    }
}

/// A zero-sized shape, so that any number of them fits in memory; its bounds are invalid, so reading one is an error.
#[derive(Clone, Copy)]
struct Flawed;

impl Primitive for Flawed {
    fn bounds(&self) -> Aabb {
        Aabb::EMPTY
    }

    fn intersect(&self, _: &ScaledRay, _: f32) -> Option<PrimitiveHit> {
        None
    }
}

/// Number of triangles in the mesh of [`scene`].
const OF_MESH: usize = 1 << 14;

/// A mesh instanced so often that there are more than `n` triangles; it has no vertices, so reading it is an error.
fn scene(n: usize) -> Scene {
    let instance = Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    };
    let mesh = canted_scene::Mesh { triangles: vec![[7, 8, 9]; OF_MESH], ..canted_scene::Mesh::default() };
    Scene { meshes: vec![mesh], instances: vec![instance; n / OF_MESH + 1], ..Scene::default() }
}

/// Whether the error message starts with the count.
fn is_reported<T>(built: Result<T, impl Display>, n: usize) -> bool {
    built.is_err_and(|error| error.to_string().starts_with(&format!("{n} ")))
}

pub(super) fn rows_of_limits() -> Vec<Row> {
    const REPORTED: Promise = Promise::none(
        "limits",
        "above the limits: 2^27 triangles, 2^26 shapes, 2^30 triangles in a binary BVH",
        "an error with the count, before the input is read",
        Oracle::Known,
        "inputs accepted",
    );
    let mut rows = vec![];
    let mut row = |routine: &str, is_reported: bool| rows.push(REPORTED.count(routine, 1, usize::from(!is_reported)));
    // The system maps zero pages lazily, so the memory is never touched.
    let triangles = vec![[0u32; 3]; MAX_TRIANGLES + 1];
    row("TriangleBvh::build", is_reported(TriangleBvh::build::<[f32; 3], u32>(&[], &triangles), triangles.len()));
    let shapes = vec![Flawed; MAX_PRIMITIVES + 1];
    row("WideBvh::over", is_reported(WideBvh::over(shapes), MAX_PRIMITIVES + 1));
    let one = SceneBvhConfig { levels: Levels::One, ..SceneBvhConfig::default() };
    let crowd = scene(MAX_TRIANGLES);
    row("SceneBvh::build, one level", is_reported(SceneBvh::build(&crowd, &one), crowd.n_placed_triangles()));
    let crowd = scene(canted_lbvh::MAX_PRIMITIVES);
    let binary = SceneBvhConfig { kind: BvhKind::Bvh2, volumes: Strategy::Dop, ..one };
    row("SceneBvh::build, one binary level", is_reported(SceneBvh::build(&crowd, &binary), crowd.n_placed_triangles()));
    row("flatten", is_reported(flatten(&crowd), crowd.n_placed_triangles()));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_detects_success_and_a_missing_count() {
        assert!(is_reported(Err::<(), _>("9 triangles exceed the limit"), 9));
        assert!(!is_reported(Ok::<_, String>(()), 9));
        for error in ["99 triangles are too many", "triangle 9 has no vertices"] {
            assert!(!is_reported(Err::<(), _>(error), 9), "{error}");
        }
    }
}
