//! Sets of points to fit boxes to: clusters of a known shape, and the contents of BVH nodes.

use canted_fixtures::{Hair, Mesh, SplitMix64, Strand, displaced_icosphere, hair, scaffold_of, truss};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain};
use canted_tests::clouds::{placed, random_rotation};

/// Sets of one kind.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) sets: Vec<Set>,
}

/// Triangle corners in order, three per triangle.
pub(super) struct Set {
    pub(super) points: Vec<[f32; 3]>,
    /// The number of leading points that belong to the first child; the rest belong to the second.
    pub(super) split: usize,
}

impl Set {
    /// Indices of the triangles.
    pub(super) fn triangles(&self) -> Vec<[u32; 3]> {
        let n = u32::try_from(self.points.len() / 3).unwrap_or(0);
        (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()
    }
}

/// Triangles of a synthetic cluster.
const N_TRIANGLES: usize = 24;

/// Number of triangles of a sampled node.
const NODE_TRIANGLES: std::ops::RangeInclusive<u32> = 8..=64;

/// `n` sets of each kind.
pub(super) fn kinds(n: usize) -> Vec<Kind> {
    let mut rng = SplitMix64::new(2026);
    let shapes: [(&'static str, [f64; 3]); 4] = [
        ("needle", [1.0, 0.01, 0.01]),
        ("plate", [1.0, 0.8, 0.01]),
        ("brick", [1.0, 0.6, 0.3]),
        ("cube", [1.0, 1.0, 1.0]),
    ];
    let mut kinds: Vec<Kind> = shapes
        .iter()
        .map(|&(name, half)| Kind { name, sets: (0..n).map(|_| cluster(&mut rng, half, |x| x)).collect() })
        .collect();
    let on_sphere = |x: [f64; 3]| {
        let length = x.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-3);
        x.map(|c| c / length)
    };
    kinds.push(Kind { name: "sphere", sets: (0..n).map(|_| cluster(&mut rng, [1.0; 3], on_sphere)).collect() });
    let any = |rng: &mut SplitMix64| [0; 3].map(|_: u8| 10.0f64.powf(-2.0 * rng.unit()));
    kinds.push(Kind {
        name: "random",
        sets: (0..n)
            .map(|_| {
                let half = any(&mut rng);
                cluster(&mut rng, half, |x| x)
            })
            .collect(),
    });
    let strands = Hair { n_strands: 60, n_segments: 12, width: 0.002, strand: Strand::Ribbon };
    for (name, mesh) in [
        ("nodes of a scaffold", scaffold_of(1, true, 4)),
        ("nodes of a truss", truss(4)),
        ("nodes of hair", hair(3, &strands)),
        ("nodes of a bumpy sphere", displaced_icosphere(3, 4).off_axis()),
    ] {
        kinds.push(Kind { name, sets: nodes(&mesh, n) });
    }
    kinds
}

/// Triangles with random vertices in a rotated box, mapped through `shape` first; half of them lie in each half of the
/// box.
fn cluster(rng: &mut SplitMix64, half: [f64; 3], shape: impl Fn([f64; 3]) -> [f64; 3]) -> Set {
    let rotation = random_rotation(rng);
    let points = (0..3 * N_TRIANGLES).map(|i| {
        let mut x = rng.signed3();
        x[0] = 0.5 * (x[0] + if i < 3 * N_TRIANGLES / 2 { -1.0 } else { 1.0 });
        placed(&rotation, half, [0.0; 3], shape(x))
    });
    Set { points: points.collect(), split: 3 * N_TRIANGLES / 2 }
}

/// The contents of `n` nodes of the radix tree, evenly from all nodes of suitable size.
pub(super) fn nodes(mesh: &Mesh, n: usize) -> Vec<Set> {
    let Ok((corners, bounds)) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles) else { return vec![] };
    let tree =
        lbvh::radix(lbvh::sort_by_code(&lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners), Bits::B63));
    let sorted: Vec<Corners> = lbvh::in_leaf_order(&corners, &tree.leaves);
    let fit: Vec<&lbvh::Node> = tree.nodes.iter().filter(|node| NODE_TRIANGLES.contains(&node.n_leaves())).collect();
    let step = (fit.len() / n).max(1);
    let set = |node: &&lbvh::Node| {
        let range = node.first as usize..=node.last as usize;
        let n_left = match node.left.kind() {
            lbvh::ChildKind::Leaf(_) => 1,
            lbvh::ChildKind::Inner(id) => tree.nodes[id.index()].n_leaves() as usize,
        };
        Set { points: sorted[range].as_flattened().to_vec(), split: 3 * n_left }
    };
    fit.iter().step_by(step).take(n).map(set).collect()
}
