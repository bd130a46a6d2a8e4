//! Meshes small enough for a loop over all triangles, and ugly.

use canted_fixtures::{
    Mesh, Rotation, coplanar_quads, displaced_icosphere, fan, grid, icosphere, identical, outlier, slivers, soup,
    thin_box, torus,
};

/// A mesh, and where it stands.
pub struct Case {
    /// For messages.
    pub name: String,
    /// The mesh.
    pub mesh: Mesh,
}

/// Shapes at their natural size, each a few hundred triangles.
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

/// Each shape as it is, turned, scaled to 1e-6 and 1e6, and far from the origin.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = vec![];
    for Case { name, mesh } in shapes() {
        let mut add = |how: &str, change: &dyn Fn([f32; 3]) -> [f32; 3]| {
            let positions = mesh.positions.iter().map(|&p| change(p)).collect();
            let triangles = mesh.triangles.clone();
            cases.push(Case { name: format!("{name}, {how}"), mesh: Mesh { positions, triangles } });
        };
        let turn = Rotation::turn();
        add("as it is", &|p| p);
        add("turned", &|p| turn.apply_f32(p));
        add("at 1e-6", &|p| p.map(|x| x * 1e-6));
        add("at 1e6, turned", &|p| turn.apply_f32(p).map(|x| x * 1e6));
        add("at 1e7", &|p| [p[0] * 50.0 + 1e7, p[1] * 50.0 - 1e7, p[2] * 50.0 + 1e7]);
    }
    cases
}
