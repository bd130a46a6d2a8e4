//! Grazing rays: every shape, build configuration, SIMD path and kernel.

use canted_fixtures::{Mesh, coplanar_quads, thin_box};
use canted_tests::{rays, scenes};
use canted_trace::{BaldwinWeber, MollerTrumbore, Ray, Watertight};
use canted_wide::{Config, SimdPath};

use super::setup::{agrees, build, every_variant, few_variants, paths, single_kind_variants};

/// Rays of every class, and from inside.
fn all_rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    [rays::of_all_classes(mesh, n, 20), rays::from_inside(mesh, 2 * n, 30)].concat()
}

#[test]
fn watertight_loses_no_hit() {
    for case in scenes::cases().iter().chain(&scenes::needles()) {
        agrees::<Watertight>(&case.name, &case.mesh, &every_variant(), &all_rays(&case.mesh, 20));
    }
}

#[test]
fn moller_trumbore_loses_no_hit() {
    for case in scenes::cases().iter().chain(&scenes::needles()) {
        agrees::<MollerTrumbore>(&case.name, &case.mesh, &few_variants(), &all_rays(&case.mesh, 10));
    }
}

#[test]
fn baldwin_weber_loses_no_hit() {
    for case in scenes::cases().iter().chain(&scenes::needles()) {
        agrees::<BaldwinWeber>(&case.name, &case.mesh, &few_variants(), &all_rays(&case.mesh, 10));
    }
}

#[test]
fn rays_exactly_in_the_planes_of_faces_lose_no_hit() {
    for case in scenes::cases().iter().chain(&scenes::needles()) {
        let mesh = rays::on_lattice(&case.mesh);
        let rays = rays::in_planes(&mesh, 150, 40);
        agrees::<Watertight>(&case.name, &mesh, &few_variants(), &rays);
        agrees::<MollerTrumbore>(&case.name, &mesh, &few_variants()[..2], &rays);
    }
}

/// Rotated flat boxes and rotated rooms.
fn rotated() -> Vec<scenes::Case> {
    let case = |name: &str, mesh: canted_fixtures::Mesh| scenes::Case { name: name.to_owned(), mesh: mesh.off_axis() };
    vec![
        case("rotated quads", coplanar_quads(12)),
        case("rotated flat box", thin_box(0.0)),
        case("rotated room", scenes::room(3, 60)),
    ]
}

#[test]
fn rotated_meshes_lose_no_hit_in_local_frames() {
    let mut n_rotated = 0;
    for case in rotated() {
        agrees::<Watertight>(&case.name, &case.mesh, &every_variant(), &all_rays(&case.mesh, 60));
        agrees::<MollerTrumbore>(&case.name, &case.mesh, &few_variants(), &all_rays(&case.mesh, 20));
        for (_, config) in few_variants() {
            let tree = build::<Watertight>(&case.mesh, &config);
            let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            n_rotated += usize::from(tree.frame() != rows && tree.sizes().nodes[0] > 0);
        }
    }
    assert!(n_rotated > 0, "no BVH has aligned nodes in a local frame");
}

/// The tests above cover every node kind that builds produce, on every SIMD path.
#[test]
#[expect(clippy::print_stderr, reason = "unavailable paths are reported")]
fn every_node_kind_is_tested() {
    let (there, missing) = paths();
    assert!(there.contains(&SimdPath::Scalar) && there.len() + missing.len() == 4);
    for name in missing {
        eprintln!("not tested: {name} is not available");
    }
    // First nodes of each requested kind, then those of each kind in the BVHs of the presets.
    let (mut asked, mut preset) = ([0; 2], [0; 2]);
    for case in scenes::needles() {
        for (i, (_, config)) in single_kind_variants().iter().enumerate() {
            asked[i] += build::<Watertight>(&case.mesh, config).sizes().nodes[i];
        }
        let nodes = build::<Watertight>(&case.mesh, &Config::default()).sizes().nodes;
        preset = [0, 1].map(|i| preset[i] + nodes[i]);
    }
    assert!(asked.iter().all(|&n| n > 100), "{asked:?}");
    assert!(preset[1] > 0, "node kinds of the presets: {preset:?}");
}

#[test]
fn enough_rays_hit_and_enough_miss() {
    for case in scenes::needles() {
        let rays = all_rays(&case.mesh, 20);
        let tree = build::<Watertight>(&case.mesh, &Config::default());
        let n_hits = rays.iter().filter(|ray| tree.occluded(ray)).count();
        assert!(n_hits > 20 && rays.len() - n_hits > 5, "{}: {n_hits} of {} rays hit", case.name, rays.len());
    }
}
