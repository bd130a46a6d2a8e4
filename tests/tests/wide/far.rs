//! Far origins and coordinates, and scales: rounding is large relative to the geometry.

use canted_fixtures::{Grazing, Mesh};
use canted_tests::{
    rays,
    scenes::{self, Case},
};
use canted_trace::{MollerTrumbore, Watertight};

use super::setup::{agrees, build, every_variant, few_variants, first_difference, loop_over_all, paths};

/// Shapes of small and large extent, thin, flat, and not axis-parallel.
fn shapes() -> Vec<Case> {
    let case = |name: &str, mesh: Mesh| Case { name: name.to_owned(), mesh };
    let mut shapes = scenes::needles();
    shapes.push(case("soup", canted_fixtures::soup(7, 300)));
    shapes.push(case("torus", canted_fixtures::torus(24, 8)));
    shapes.push(case("rotated room", scenes::room(3, 40).off_axis()));
    shapes.push(case("rotated flat box", canted_fixtures::thin_box(0.0).off_axis()));
    shapes.push(case("displaced icosphere", canted_fixtures::displaced_icosphere(3, 2)));
    shapes
}

#[test]
fn rays_from_up_to_ten_thousand_sizes_away_lose_no_hit() {
    for Case { name, mesh } in shapes() {
        for (sizes, seed) in [(1e2, 50), (1e3, 51), (1e4, 52)] {
            let rays = rays::from_afar(&mesh, sizes, 300, seed);
            agrees::<Watertight>(&format!("{name}, from {sizes:e} sizes"), &mesh, &every_variant(), &rays);
            agrees::<MollerTrumbore>(&format!("{name}, from {sizes:e} sizes"), &mesh, &few_variants()[1..], &rays);
        }
    }
}

/// Enough rays from afar hit something, or the test above proves nothing.
#[test]
fn rays_from_afar_hit() {
    for Case { name, mesh } in shapes().iter().filter(|case| ["soup", "torus"].contains(&&*case.name)) {
        for sizes in [1e2, 1e3, 1e4] {
            let rays = rays::from_afar(mesh, sizes, 300, 50);
            let n_hits = loop_over_all::<Watertight>(mesh, &rays).iter().flatten().count();
            assert!(n_hits > 150, "{name}, from {sizes:e} sizes: {n_hits} hits");
        }
    }
}

#[test]
fn coordinates_of_1e7_lose_no_hit() {
    for Case { name, mesh } in shapes() {
        // Adjacent f32 values are 1 apart at 1e7, so small shapes are flat along one axis, or along all but one.
        let placements: [(&str, Mesh); 5] = [
            ("at 1e7", mesh.placed(|p| [p[0] * 50.0 + 1e7, p[1] * 50.0 - 1e7, p[2] * 50.0 + 1e7])),
            ("at 1e7 along x, 1e-3 across", mesh.placed(|p| [p[0] * 20.0 + 1e7, p[1] * 1e-3, p[2] * 1e-3])),
            ("at 1e7 along x and y, 1e-3 along z", mesh.placed(|p| [p[0] + 1e7, p[1] * 30.0 - 1e7, p[2] * 1e-3])),
            ("1e7 long, 1e-3 thick", mesh.placed(|p| [p[0] * 1e7, p[1] * 1e7, p[2] * 1e-3])),
            ("size 1e-3 near 1e7", mesh.placed(|p| p.map(|x| x * 1e-3)).joined(&mesh.placed(|p| p.map(|x| x * 1e7)))),
        ];
        for (placement, mesh) in placements {
            let classes = [Grazing::Vertices, Grazing::Edges, Grazing::Planes, Grazing::Axes];
            let mut rays = rays::of_classes(&mesh, &classes, 40, 60);
            rays.extend(rays::from_inside(&mesh, 150, 61));
            rays.extend(rays::from_afar(&mesh, 1e2, 60, 62));
            agrees::<Watertight>(&format!("{name}, {placement}"), &mesh, &few_variants(), &rays);
        }
    }
}

#[test]
fn scales_of_1e_6_and_1e6_lose_no_hit() {
    for Case { name, mesh } in shapes() {
        for scale in [1e-6, 1e6] {
            let mesh = mesh.placed(|p| p.map(|x| x * scale));
            let mut rays = rays::of_all_classes(&mesh, 60, 70);
            rays.extend(rays::from_inside(&mesh, 200, 71));
            agrees::<Watertight>(&format!("{name}, {scale:e}"), &mesh, &every_variant(), &rays);
        }
    }
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    // Small enough that rays at 2^60 start within the promised 2^62.
    let meshes =
        [canted_fixtures::soup(7, 300), canted_fixtures::scaffold_of(1, true, 3), scenes::room(3, 40).off_axis()];
    for mesh in meshes.map(|mesh| mesh.placed(|p| p.map(|x| x / 16.0))) {
        let classes = [Grazing::Vertices, Grazing::Edges, Grazing::Planes, Grazing::Axes];
        let rays = rays::of_classes(&mesh, &classes, 60, 80);
        let wants = loop_over_all::<Watertight>(&mesh, &rays);
        assert!(wants.iter().flatten().count() > 50);
        for exponent in (-60..=60).step_by(12) {
            let scale = 2.0f32.powi(exponent);
            let scaled = mesh.placed(|p| p.map(|x| x * scale));
            // Scales only the ray's origin; its target is then `scale` times as far, in units of the direction.
            let rays: Vec<_> = rays
                .iter()
                .map(|ray| canted_trace::Ray {
                    origin: ray.origin.map(|x| x * scale),
                    t_min: ray.t_min * scale,
                    t_max: ray.t_max * scale,
                    ..*ray
                })
                .collect();
            let wants: Vec<_> =
                wants.iter().map(|hit| hit.map(|hit| canted_trace::Hit { t: hit.t * scale, ..hit })).collect();
            for (variant, config) in few_variants() {
                let tree = build::<Watertight>(&scaled, &config);
                for path in paths().0 {
                    let difference = first_difference(&tree.clone().with_path(path), &rays, &wants);
                    assert_eq!(difference, None, "2^{exponent}, {variant}, {}", path.name());
                }
            }
        }
    }
}
