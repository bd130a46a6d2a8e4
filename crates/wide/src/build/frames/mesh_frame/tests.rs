use canted_fixtures::{self as fixtures, Mesh, Rotation};
use canted_lbvh::{Corners, triangle_corners};

use super::{MeshFrameConfig, candidates};
use crate::build::item::Item;

fn corners(mesh: &Mesh) -> Vec<Corners> {
    triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0
}

fn found(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
    let corners = corners(mesh);
    candidates(corners.len(), &|i| corners[i].edges(), &MeshFrameConfig::default())
}

/// Greatest angle, in degrees, between a row and the nearest image of an axis under `rotation`.
///
/// By the sine, as the cosine of a small angle is one.
fn angle_deg(rows: &[[f32; 3]; 3], rotation: &Rotation) -> f64 {
    let sine = |row: [f32; 3], axis: [f64; 3]| {
        let [x, y, z] = row.map(f64::from);
        let [a, b, c] = axis;
        let cross = [y * c - z * b, z * a - x * c, x * b - y * a];
        cross.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let axes = [0, 1, 2].map(|k| rotation.rows.map(|row| row[k]));
    let nearest = |row| axes.iter().map(|&axis| sine(row, axis)).fold(1.0, f64::min);
    rows.iter().map(|&row| nearest(row)).fold(0.0, f64::max).asin().to_degrees()
}

/// Rooms in a row, their floors and walls tessellated, and a few slanted roofs.
fn rooms() -> Mesh {
    let mut mesh = Mesh::default();
    let mut quad = |a: [f32; 3], u: [f32; 3], v: [f32; 3], cells: u8| {
        for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
            let n = f32::from(cells);
            let at = |i: u8, j: u8| std::array::from_fn(|k| a[k] + (u[k] * f32::from(i) + v[k] * f32::from(j)) / n);
            let base = u32::try_from(mesh.positions.len()).unwrap();
            mesh.positions.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            mesh.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
    };
    for room in 0..12u8 {
        let x = 5.0 * f32::from(room);
        quad([x, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 7.0, 0.0], 6);
        quad([x, 0.0, 0.0], [0.0, 7.0, 0.0], [0.0, 0.0, 3.0], 5);
        quad([x, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 0.0, 3.0], 4);
        quad([x, 0.0, 3.0], [5.0, 0.0, 0.0], [0.0, 3.5, 2.0], 3);
    }
    mesh
}

#[test]
fn the_frame_of_rotated_rooms_is_found_to_a_thousandth_of_a_degree() {
    let frames = found(&rooms().off_axis());
    assert_eq!(frames.len(), 1);
    let angle = angle_deg(&frames[0], &Rotation::off_axis());
    assert!(angle < 1e-3, "{angle}");
}

#[test]
fn the_frame_of_a_diagonal_lattice_is_found_though_no_strut_runs_along_it() {
    for thin in [false, true] {
        let frames = found(&fixtures::scaffold(1, thin));
        let angle = frames.iter().map(|rows| angle_deg(rows, &Rotation::off_axis())).fold(90.0, f64::min);
        // The nodes of the lattice are moved about, so its axes are known no better.
        assert!(angle < 0.5, "{thin}: {angle}");
    }
}

#[test]
fn nothing_is_found_where_the_axes_dominate_or_no_direction() {
    let points = Mesh { positions: vec![[3.0; 3]], triangles: vec![[0; 3]; 9] };
    let meshes = [
        ("points", points),
        ("rooms", rooms()),
        ("grid", fixtures::grid(5, [300, 300])),
        ("poles", fixtures::poles(2)),
        ("sphere", fixtures::displaced_icosphere(1, 5)),
        ("none", Mesh::default()),
    ];
    for (name, mesh) in meshes {
        assert_eq!(found(&mesh), Vec::<[[f32; 3]; 3]>::new(), "{name}");
    }
}

/// The same rooms, rotated as the measure must ignore: the rotation, not the rooms, makes a candidate.
#[test]
fn a_quarter_turn_changes_nothing() {
    let quarter = Rotation { rows: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] };
    assert!(found(&rooms().rotated(&quarter)).is_empty());
    assert!(!found(&rooms().rotated(&Rotation::euler(0.0, 0.0, 0.1))).is_empty());
}

#[test]
fn offsets_and_sizes_change_nothing() {
    let rooms = rooms().off_axis();
    for (scale, by) in [(1e-30f32, 0.0f32), (1e36, 0.0), (1.0, 1e5)] {
        let positions = rooms.positions.iter().map(|p| p.map(|x| x * scale + by)).collect();
        let frames = found(&Mesh { positions, triangles: rooms.triangles.clone() });
        assert_eq!(frames.len(), 1, "{scale}, {by}");
        // At the far offset coordinates are rounded to 1/128 of a unit, cells are about one unit large.
        let angle = angle_deg(&frames[0], &Rotation::off_axis());
        assert!(angle < if by > 0.0 { 0.1 } else { 1e-3 }, "{scale}, {by}: {angle}");
    }
}

#[test]
fn rows_are_unit_vectors_but_for_rounding() {
    for rows in found(&fixtures::truss(4)).into_iter().chain(found(&rooms().off_axis())).flatten() {
        let length = rows.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() <= 2.0 * f64::from(f32::EPSILON), "{length}");
    }
}
