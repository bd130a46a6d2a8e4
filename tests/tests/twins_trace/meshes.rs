//! Generated meshes: 0, 1, 2, equal and degenerate triangles, flat boxes, scales from 1e-6 to 1e6, far from the origin.

use canted_fixtures::Mesh;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, SceneInput, TracedScene};
use canted_tests::{rays, scenes};
use canted_trace::{Intersect, Ray};
use canted_wide::Config;

use super::gpu;
use super::reference::{Tally, World, error_of_one_level};
use super::setup::{build, few_variants};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(grazing_rays_lose_no_hit),
        needs_device(rays_in_the_planes_of_faces_lose_no_hit),
        needs_device(the_comparison_detects_lost_moved_and_renumbered_triangles),
    ]
}

fn reach(mesh: &Mesh) -> f64 {
    mesh.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()))
}

/// Compares the device's BVH over `there` with the CPU's over `mesh`.
fn compared(gpu: &Gpu, mesh: &Mesh, there: &Mesh, config: &Config, rays: &[Ray]) -> Result<Tally, String> {
    let reach = reach(mesh);
    let world = World {
        corners: &|_, primitive| mesh.corners(primitive as usize),
        error: &|ray, _| error_of_one_level(ray, reach),
    };
    let scene = TracedScene::new(gpu, SceneInput::upload([&build(there, config)])).unwrap();
    let on_cpu = build(mesh, config);
    let mut tally = Tally::default();
    world.check_all(gpu, &scene, rays, |ray| on_cpu.closest_hit(ray), &mut tally)?;
    Ok(tally)
}

fn all_rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    [rays::of_all_classes(mesh, n, 20), rays::from_inside(mesh, 2 * n, 30), rays::from_afar(mesh, 1e3, n, 40)].concat()
}

fn add(all: &mut Tally, one: &Tally) {
    all.n_same += one.n_same;
    all.n_ties += one.n_ties;
    all.n_besides += one.n_besides;
    all.n_at_ends += one.n_at_ends;
    all.n_missed += one.n_missed;
    all.n_cut += one.n_cut;
    all.off = all.off.max(one.off);
}

fn grazing_rays_lose_no_hit() {
    let gpu = gpu();
    let variants = few_variants();
    let mut all = Tally::default();
    // Each mesh with one configuration, in turn; meshes that suit oriented boxes with all.
    for (case, (variant, config)) in scenes::cases().iter().zip(variants.iter().cycle()) {
        let tally = compared(&gpu, &case.mesh, &case.mesh, config, &all_rays(&case.mesh, 30));
        add(&mut all, &tally.unwrap_or_else(|error| panic!("{}, {variant}: {error}", case.name)));
    }
    for case in scenes::needles() {
        for (variant, config) in &variants {
            let tally = compared(&gpu, &case.mesh, &case.mesh, config, &all_rays(&case.mesh, 30));
            add(&mut all, &tally.unwrap_or_else(|error| panic!("{}, {variant}: {error}", case.name)));
        }
    }
    all.report("generated meshes");
}

fn rays_in_the_planes_of_faces_lose_no_hit() {
    let gpu = gpu();
    let mut all = Tally::default();
    for (case, (variant, config)) in scenes::cases().iter().step_by(2).zip(few_variants().iter().cycle()) {
        let mesh = rays::on_lattice(&case.mesh);
        let tally = compared(&gpu, &mesh, &mesh, config, &rays::in_planes(&mesh, 150, 40));
        add(&mut all, &tally.unwrap_or_else(|error| panic!("{}, {variant}: {error}", case.name)));
    }
    all.report("rays in planes");
}

fn the_comparison_detects_lost_moved_and_renumbered_triangles() {
    let gpu = gpu();
    let mesh = scenes::shapes().remove(0).mesh;
    let config = Config::default();
    let rays = all_rays(&mesh, 100);
    let fails = |change: &dyn Fn(&mut Mesh)| {
        let mut there = mesh.clone();
        change(&mut there);
        compared(&gpu, &mesh, &there, &config, &rays).expect_err("the change is not seen")
    };
    // Nothing hits a degenerate triangle.
    let lost = fails(&|there| there.triangles[7][1] = there.triangles[7][0]);
    assert!(lost.contains("lost"), "{lost}");
    let moved = fails(&|there| there.positions.iter_mut().for_each(|p| p[0] += 1e-3));
    assert!(moved.contains("off its triangle") || moved.contains("lost"), "{moved}");
    let renumbered = fails(&|there| there.triangles.swap(3, 4));
    assert!(renumbered.contains("off its triangle"), "{renumbered}");
}
