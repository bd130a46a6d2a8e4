//! `canted tree` against codes and topology computed from their definitions.

use std::collections::HashSet;

use crate::{
    random::Random,
    support::{Folder, SMALL, rows},
};

/// The bits of the cell of a coordinate sum on one axis.
fn cell(sum: f32, three_m: f32, scale: f32, k: i32) -> u64 {
    let cell = f64::from((sum - three_m) * scale).floor();
    let last = 2f64.powi(k) - 1.0;
    // NaN is the product of 0 and infinity, and belongs to the first cell.
    let cell = if cell.is_nan() { 0.0 } else { cell.clamp(0.0, last) };
    (0..k).filter(|bit| (cell / 2f64.powi(*bit)).floor() % 2.0 == 1.0).map(|bit| 1 << bit).sum()
}

/// Morton codes in the order of the triangles.
fn codes(triangles: &[[[f32; 3]; 3]], k: i32) -> Vec<u64> {
    let corners = || triangles.iter().flatten();
    let least: [f32; 3] = std::array::from_fn(|axis| corners().map(|p| p[axis]).fold(f32::INFINITY, f32::min));
    let greatest: [f32; 3] = std::array::from_fn(|axis| corners().map(|p| p[axis]).fold(f32::NEG_INFINITY, f32::max));
    let extent = (0..3).map(|axis| greatest[axis] - least[axis]).fold(0.0, f32::max);
    let scale = 2f32.powi(k) / (3.0 * extent);
    let scale = if scale.is_finite() { scale } else { 0.0 };
    let code = |[a, b, c]: &[[f32; 3]; 3]| {
        let cells: [u64; 3] =
            std::array::from_fn(|axis| cell((a[axis] + b[axis]) + c[axis], 3.0 * least[axis], scale, k));
        // From the highest bit down, x before y before z.
        (0..k).rev().flat_map(|bit| cells.map(|cell| cell >> bit & 1)).fold(0, |code, bit| code << 1 | bit)
    };
    triangles.iter().map(code).collect()
}

/// Nodes `[left, right, first, last]`, by splitting ranges top-down at the highest differing bit.
fn nodes(codes: &[u64]) -> Vec<Vec<i64>> {
    let n = codes.len();
    let mut nodes = vec![vec![]; n.saturating_sub(1)];
    let mut open = if n > 1 { vec![(0, 0, n - 1)] } else { vec![] };
    let number = |i: usize| i64::try_from(i).unwrap();
    while let Some((node, first, last)) = open.pop() {
        // Equal codes are split by position.
        let key = |i: usize| u128::from(codes[i]) << 64 | i as u128;
        let highest = 127 - (key(first) ^ key(last)).leading_zeros();
        let split = (first..last).rfind(|&i| key(i) >> highest & 1 == 0).unwrap();
        let mut child = |first: usize, last: usize, inner: usize| {
            if first == last {
                return -number(first) - 1;
            }
            open.push((inner, first, last));
            number(inner)
        };
        nodes[node] = vec![child(first, split, split), child(split + 1, last, split + 1), number(first), number(last)];
    }
    nodes
}

fn obj(triangles: &[[[f32; 3]; 3]]) -> String {
    let vertex = |[x, y, z]: &[f32; 3]| format!("v {x} {y} {z}\n");
    let face = |i: usize| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3);
    let vertices: String = triangles.iter().flatten().map(vertex).collect();
    vertices + &(0..triangles.len()).map(face).collect::<String>()
}

#[track_caller]
fn assert_tree(name: &str, obj: &str, triangles: &[[[f32; 3]; 3]]) {
    let folder = Folder::new();
    folder.write("scene.obj", obj);
    for (bits, k) in [(30, 10), (63, 21)] {
        folder.run(&format!("tree scene.obj --bits {bits} --codes codes.csv --nodes nodes.csv")).done();
        let of_prim = codes(triangles, k);
        let mut want: Vec<(u64, usize)> = of_prim.iter().copied().zip(0..).collect();
        want.sort_unstable();
        let got: Vec<Vec<u64>> = rows(&folder.text("codes.csv"), "code,prim");
        let want_rows: Vec<Vec<u64>> = want.iter().map(|&(code, prim)| vec![code, prim as u64]).collect();
        assert_eq!(got, want_rows, "{name}, {bits} bits");
        let sorted: Vec<u64> = want.iter().map(|&(code, _)| code).collect();
        let got: Vec<Vec<i64>> = rows(&folder.text("nodes.csv"), "left,right,first,last");
        assert_eq!(got, nodes(&sorted), "{name}, {bits} bits");
    }
}

/// Triangles with corners `center + size * integers`, of which every tenth is a duplicate.
fn soup(n: usize, center: f32, size: f32) -> Vec<[[f32; 3]; 3]> {
    let mut random = Random(3);
    let mut triangles: Vec<[[f32; 3]; 3]> = vec![];
    while triangles.len() < n {
        let base = random.point(1000);
        let mut corner = || {
            let near = random.point(20);
            std::array::from_fn(|k| center + size * f32::from(i16::try_from(base[k] + near[k]).unwrap()))
        };
        let triangle =
            if triangles.len() % 10 == 9 { triangles[triangles.len() / 2] } else { [corner(), corner(), corner()] };
        let distinct: HashSet<[u32; 3]> = triangle.iter().map(|p| p.map(f32::to_bits)).collect();
        if distinct.len() == 3 {
            triangles.push(triangle);
        }
    }
    triangles
}

#[test]
fn random_triangles_of_all_sizes_and_positions() {
    for (name, center, size) in [
        ("as they are", 0.0, 1.0),
        ("tiny", 0.0, 1e-15),
        ("large", 0.0, 1e10),
        ("far away", 1e7, 8.0),
        ("inexact", 0.1, 0.3),
    ] {
        let triangles = soup(300, center, size);
        assert_tree(name, &obj(&triangles), &triangles);
    }
}

#[test]
fn one_two_and_equal_triangles() {
    let one = soup(1, 0.0, 1.0);
    assert_tree("one", &obj(&one), &one);
    let two = soup(2, 0.0, 1.0);
    assert_tree("two", &obj(&two), &two);
    let equal = vec![one[0]; 77];
    assert_tree("equal", &obj(&equal), &equal);
}

#[test]
fn prim_numbers_the_triangles_of_polygons_across_groups() {
    let triangles = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]],
    ];
    assert_tree("small", SMALL, &triangles);
}

#[test]
fn unused_vertices_do_not_change_the_codes() {
    let triangles = soup(50, 0.0, 1.0);
    assert_tree("unused vertex", &(obj(&triangles) + "v 1e6 -1e6 1e6\n"), &triangles);
}

#[test]
fn the_oracle_detects_changes() {
    let triangles = soup(100, 0.0, 1.0);
    let mut moved = triangles.clone();
    moved[42] = moved[42].map(|[x, y, z]| [x, y + 100.0, z]);
    assert_ne!(codes(&triangles, 21), codes(&moved, 21));
    let mut sorted = codes(&triangles, 21);
    sorted.sort_unstable();
    // Equal codes are split by position.
    assert_ne!(nodes(&sorted), nodes(&[0; 100]));
}
