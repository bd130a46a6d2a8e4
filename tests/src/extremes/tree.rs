//! Binary trees over inputs that codes cannot separate: each primitive once, parents contain children, bounded depth.
//!
//! Not covered: time, which grows no faster than the scene (`degenerate.rs`); the device's trees (`built`).

use canted_fixtures::{Mesh, equal_centroids, identical, outlier, soup};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Tree, VolumeConfig};
use canted_obb::Aabb;
use canted_sah::{Builder, PlocConfig, TopDownConfig, build};

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
