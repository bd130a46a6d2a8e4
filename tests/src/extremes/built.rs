//! Trees built on a device for the cases of `tree`: the CPU's integers, and boxes that contain everything below them.
//!
//! Not covered: each stage on the CPU's previous output, many meshes at once, and a second level (`twins_build`).

use canted_fixtures::Mesh;
use canted_gpu::{
    Choice, Gpu,
    build::{BuildConfig, BuildEncoder, Built, Node, Primitives, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Corners, Domain, Strategy, Tree};
use canted_obb::Obb;
use rayon::prelude::*;

use super::{Oracle, Promise, Row, tree};

/// Devices promise nothing for this case: they may flush subnormal numbers to zero.
const BELOW_NORMAL: &str = "denormal extent";

const STAGE: &str = "tree on a device";

/// Why there are no rows if there is no adapter.
pub(super) fn not_tried() -> Option<String> {
    let there_is_none = Gpu::open(&Choice::Best).is_err();
    there_is_none.then(|| format!("the stage \"{STAGE}\" and instances on a device: no device"))
}

/// Rows of the best adapter; empty without an adapter.
pub(super) fn rows() -> Vec<Row> {
    let Ok(gpu) = Gpu::open(&Choice::Best) else { return vec![] };
    tree::cases().iter().flat_map(|(case, meshes)| of_case(&gpu, case, meshes)).collect()
}

fn of_case(gpu: &Gpu, case: &'static str, meshes: &[Mesh]) -> Vec<Row> {
    let of = |promise, oracle, unit| {
        let promise = Promise::none(STAGE, case, promise, oracle, unit);
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
        let primitives = Primitives::triangles(gpu, [&self.corners[..]]).expect("a small mesh");
        let config = BuildConfig { bits: Bits::B63, strategy };
        Built::new(&mut BuildEncoder::new(gpu), primitives, config).expect("a small tree")
    }

    /// Whether the device's leaves or nodes differ from the CPU's.
    fn differs(&self, gpu: &Gpu, built: &Built) -> bool {
        let leaves = gpu.read(&built.leaves).expect("leaves come back");
        let nodes = gpu.read(&built.trees.nodes).expect("nodes come back");
        let own: Vec<u32> = self.tree.leaves.iter().map(|leaf| leaf.0).collect();
        let same = self.tree.nodes.iter().map(node).eq(nodes.into_iter().take(self.tree.nodes.len()));
        leaves != own || !same
    }

    /// How many vertices lie outside a box above them, and how many were checked.
    fn outside(&self, gpu: &Gpu, built: &Built) -> [usize; 2] {
        let obbs: Vec<Obb> = built.obbs.as_ref().map_or_else(Vec::new, |obbs| gpu.read(obbs).expect("boxes come back"));
        let sorted = lbvh::in_leaf_order(&self.corners, &self.tree.leaves);
        let of_node = |(node, obb): (&lbvh::Node, &Obb)| {
            let below = sorted[node.first as usize..=node.last as usize].as_flattened();
            [below.iter().filter(|&&vertex| !obb.contains(vertex)).count(), below.len()]
        };
        let sum = |[a, b]: [usize; 2], [c, d]: [usize; 2]| [a + c, b + d];
        self.tree.nodes.par_iter().zip(&obbs).map(of_node).reduce(|| [0; 2], sum)
    }
}

/// A CPU node in the device's layout.
fn node(node: &lbvh::Node) -> Node {
    let child = |child: Child| match child.kind() {
        ChildKind::Leaf(position) => position | 1 << 31,
        ChildKind::Inner(id) => id.0,
    };
    Node { left: child(node.left), right: child(node.right), first: node.first, last: node.last }
}
