//! Inputs of tests: difficult meshes, models of others, trees of maximal depth and transforms of instances.

use std::path::PathBuf;

use canted_fixtures::{
    Hair, Mesh, Rotation, SplitMix64, Strand, coplanar_quads, displaced_icosphere, equal_centroids, fan, grid, hair,
    icosphere, identical, outlier, scaffold_of, skip, slivers, soup, thin_box, torus, truss,
};
use canted_lbvh::{Child, NodeId, Tree};
use canted_obb::Affine;
use canted_tlas::Instance;

/// A mesh with its name.
pub struct Case {
    /// Name for messages.
    pub name: String,
    /// The mesh.
    pub mesh: Mesh,
}

/// Shapes at their natural size, a few hundred triangles each.
#[must_use]
pub fn shapes() -> Vec<Case> {
    let case = |name: &str, mesh: Mesh| Case { name: name.to_owned(), mesh };
    vec![
        case("soup", soup(7, 300)),
        case("slivers", slivers(8, 200)),
        case("grid", grid(5, [12, 12])),
        case("icosphere", icosphere(2)),
        case("displaced icosphere", displaced_icosphere(3, 2)),
        case("torus", torus(24, 8)),
        case("thin box", thin_box(1e-4)),
        case("flat box", thin_box(0.0)),
        case("fan", fan(64)),
        case("coplanar quads", coplanar_quads(8)),
        case("identical", identical(100)),
        case("outlier", outlier(200)),
        case("one", soup(1, 1)),
        case("two", soup(2, 2)),
        case("none", soup(3, 0)),
    ]
}

/// Small meshes on which every hit is a tie, planes and vertices coincide, or scales differ by 1e11.
#[must_use]
pub fn ugly() -> Vec<Case> {
    let case = |name: &str, mesh: Mesh| Case { name: name.to_owned(), mesh };
    let mut doubled = soup(5, 120);
    doubled.triangles.extend_from_within(..);
    // Points and segments, some of them in one place, and a vertex of -0.0.
    let mut points = soup(11, 60);
    for (i, triangle) in points.triangles.iter_mut().enumerate() {
        match i % 3 {
            0 => triangle[1] = triangle[0],
            1 => *triangle = [triangle[0]; 3],
            _ => {}
        }
    }
    points.positions[0] = [-0.0; 3];
    // Flat quads along the axes: every plane is shared by many vertices.
    let mut quads = Mesh::default();
    for (x, y) in (0..64u8).map(|i| (f32::from(i / 8), f32::from(i % 8))) {
        let corners = [[x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 0.0], [x, y, 1.0], [x, y + 1.0, 1.0]];
        quads = quads.joined(&Mesh { positions: corners.into(), triangles: vec![[0, 1, 2], [0, 2, 3], [2, 3, 4]] });
    }
    let floor =
        Mesh { positions: vec![[-1e6, -1e6, -9.0], [1e6, -1e6, -9.0], [0.0, 1e6, -9.0]], triangles: vec![[0, 1, 2]] };
    let tiny = soup(8, 100).placed(|p| p.map(|x| 1e-5 * x + 0.3));
    vec![
        case("doubled", doubled),
        case("equal centroids", equal_centroids(80)),
        case("whole numbers", whole_numbers(1, 200)),
        case("points and segments", points),
        case("quads along the axes", quads),
        case("mixed scales", soup(6, 150).joined(&floor).joined(&tiny)),
    ]
}

/// Triangles whose vertices are whole numbers from -4 to 4: flats, needles, points, duplicates, shared planes, both zeros.
fn whole_numbers(seed: u64, n: u32) -> Mesh {
    let mut rng = SplitMix64::new(seed);
    let mut mesh = Mesh::default();
    for i in 0..n {
        let start: [f32; 3] = std::array::from_fn(|_| rng.below(9) as f32 - 4.0);
        for _ in 0..3 {
            mesh.positions.push(start.map(|x| {
                let moved = x + rng.below(3) as f32 - 1.0;
                if moved == 0.0 && rng.signed() < 0.0 { -0.0 } else { moved }
            }));
        }
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        if rng.below(4) == 0 {
            mesh.triangles.push(mesh.triangles[rng.below(mesh.triangles.len())]);
        }
    }
    mesh.triangles.truncate(n as usize);
    mesh
}

/// Each shape unchanged, rotated, scaled to 1e-6 and 1e6, and far from the origin.
#[must_use]
pub fn cases() -> Vec<Case> {
    placed(shapes())
}

/// Each mesh unchanged, rotated, scaled to 1e-6 and 1e6, and far from the origin.
#[must_use]
pub fn placed(shapes: Vec<Case>) -> Vec<Case> {
    let mut cases = vec![];
    for Case { name, mesh } in shapes {
        let mut add = |how: &str, change: &dyn Fn([f32; 3]) -> [f32; 3]| {
            cases.push(Case { name: format!("{name}, {how}"), mesh: mesh.placed(change) });
        };
        let turn = Rotation::off_axis();
        add("unchanged", &|p| p);
        add("rotated", &|p| turn.apply_f32(p));
        add("at 1e-6", &|p| p.map(|x| x * 1e-6));
        add("at 1e6, rotated", &|p| turn.apply_f32(p).map(|x| x * 1e6));
        add("at 1e7", &|p| [p[0] * 50.0 + 1e7, p[1] * 50.0 - 1e7, p[2] * 50.0 + 1e7]);
    }
    cases
}

/// Long thin shapes in all directions, which suit oriented boxes: struts, cables, hair, needles.
#[must_use]
pub fn needles() -> Vec<Case> {
    let case = |name: &str, mesh: Mesh| Case { name: name.to_owned(), mesh };
    let tubes = Hair { n_strands: 12, n_segments: 6, width: 0.0006, strand: Strand::Tube };
    let ribbons = Hair { n_strands: 30, n_segments: 8, strand: Strand::Ribbon, ..tubes };
    vec![
        case("scaffold", scaffold_of(1, true, 3)),
        case("truss", every(&truss(4), 12, 150)),
        case("tubes", hair(3, &tubes)),
        case("ribbons", hair(3, &ribbons)),
        case("needles", slivers(9, 300)),
    ]
}

/// One of `part` runs of `run` triangles, with the vertices that it uses.
#[must_use]
pub fn every(mesh: &Mesh, run: usize, part: usize) -> Mesh {
    let mut kept = Mesh::default();
    for triangle in mesh.triangles.chunks(run).step_by(part).flatten() {
        let first = u32::try_from(kept.positions.len()).expect("fewer vertices than the mesh has indices");
        kept.positions.extend(triangle.map(|index| mesh.positions[index as usize]));
        kept.triangles.push([first, first + 1, first + 2]);
    }
    kept
}

/// `n` axis-aligned boxes, flat along one axis, standing on each other's corners; tests rotate it.
#[must_use]
pub fn room(seed: u64, n: usize) -> Mesh {
    let mut rng = SplitMix64::new(seed);
    let cube = thin_box(1.0);
    let mut room = Mesh::default();
    for i in 0..n {
        let at: [f64; 3] = std::array::from_fn(|_| rng.below(8) as f64);
        let size: [f64; 3] = std::array::from_fn(|k| if k == i % 3 { 0.0 } else { 1.0 + rng.below(4) as f64 });
        let first = u32::try_from(room.positions.len()).expect("few vertices");
        let corner = |p: &[f32; 3]| std::array::from_fn(|k| (at[k] + f64::from(p[k]) * size[k]) as f32);
        room.positions.extend(cube.positions.iter().map(corner));
        room.triangles.extend(cube.triangles.iter().map(|t| t.map(|index| index + first)));
    }
    room
}

/// The folder of models: `CANTED_SCENES`, else `../shared/scenes` next to the workspace.
#[must_use]
pub fn folder() -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes");
    std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(default), PathBuf::from)
}

/// Why there are no models; `None` if there are.
#[must_use]
pub fn missing() -> Option<String> {
    let folder = folder();
    (!folder.is_dir()).then(|| format!("no folder {}", folder.display()))
}

/// The folder of models; `None`, with a message, if absent.
#[must_use]
pub fn models(test: &str) -> Option<PathBuf> {
    missing().map_or_else(|| Some(folder()), |reason| skip(test, reason))
}

/// A chain over `n` primitives in order: each node has one leaf and the rest below it; `is_left` chooses the leaf's side.
///
/// # Panics
/// Panics for fewer than two primitives.
#[must_use]
pub fn chain(n: u32, is_left: impl Fn(u32) -> bool) -> Tree {
    let children: Vec<_> = (0..n - 1)
        .map(|i| {
            let rest = if i + 2 < n { Child::inner(NodeId(i + 1)) } else { Child::leaf(n - 1) };
            if is_left(i) { [Child::leaf(i), rest] } else { [rest, Child::leaf(i)] }
        })
        .collect();
    Tree::from_children(&children).expect("each node has one parent")
}

/// The columns of a rotation times a diagonal matrix, then a translation.
#[must_use]
pub fn affine(turn: &Rotation, scale: [f64; 3], shift: [f32; 3]) -> Affine {
    let column = |j: usize| turn.rows.map(|row| (row[j] * scale[j]) as f32);
    Affine { columns: [column(0), column(1), column(2), shift] }
}

/// One transform of each kind, by name.
#[must_use]
pub fn transforms() -> Vec<(&'static str, Affine)> {
    let turn = Rotation::off_axis();
    let far = [1e7, -1e7, 3e6];
    let shear = Affine { columns: [[1.0, 0.0, 0.0], [0.7, 1.0, 0.0], [-0.4, 0.9, 1.0], [0.2, 0.1, -0.3]] };
    vec![
        ("identity", Affine::IDENTITY),
        ("rotation", affine(&turn, [1.0; 3], [0.3, -0.2, 0.5])),
        ("mirror", affine(&Rotation::IDENTITY, [-1.0, 1.0, 1.0], [0.1, 0.0, 0.0])),
        ("unequal scale", affine(&turn, [3.0, 0.2, 1.5], [-0.5, 0.4, 0.0])),
        ("shear", shear),
        ("scale 1e-3", affine(&turn, [1e-3; 3], [0.4, 0.4, 0.4])),
        ("scale 1e3, mirrored", affine(&turn, [1e3, 1e3, -1e3], [-300.0, -200.0, 100.0])),
        ("far", affine(&turn, [50.0, 60.0, 40.0], far)),
        ("far, large", affine(&Rotation::IDENTITY, [1e4, -1e4, 2e4], far)),
        ("far, sheared", Affine { columns: [[90.0, 10.0, 0.0], [50.0, 100.0, 0.0], [-40.0, 9.0, 80.0], far] }),
    ]
}

/// All kinds of transforms, and many small rotated copies that overlap.
#[must_use]
pub fn crowd() -> Vec<Affine> {
    let mut rng = SplitMix64::new(31);
    let mut placed: Vec<Affine> = transforms().into_iter().map(|(_, affine)| affine).collect();
    placed.extend((0..40).map(|_| {
        let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
        let scale = std::array::from_fn(|_| 0.3 + rng.unit());
        let shift = rng.signed3().map(|x| x as f32);
        affine(&turn, scale, shift)
    }));
    placed
}

/// The mesh in world space with rounded vertices; neighbors still share them.
#[must_use]
pub fn baked(mesh: &Mesh, world_from_object: &Affine) -> Mesh {
    let positions = mesh.positions.iter().map(|&p| world_from_object.point(p)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

/// An instance of the mesh, and a second one far away, so that a top level has more than one leaf.
#[must_use]
pub fn with_another(mesh: &Mesh, world_from_object: &Affine) -> [Instance; 2] {
    let far = 9.0 * baked(mesh, world_from_object).diagonal();
    let other = world_from_object.then(&Affine::translation([far as f32, 0.0, 0.0]));
    [*world_from_object, other].map(|world_from_object| Instance::new(0, world_from_object))
}

/// Whether a transform swaps inside and outside.
#[must_use]
pub fn mirrors(placement: &Affine) -> bool {
    placement.determinant() < 0.0
}
