//! Real models, one tree per mesh: all stages, end to end, and boxes of every kind. Ignored where there are no models.

use canted_fixtures::Mesh;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::build::STRATEGIES;
use canted_lbvh::Bits;
use canted_tests::scenes as models;

use crate::{
    compare::assert_equal,
    setup::{BOTH, gpu, twins},
    volumes::assert_contained,
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(the_bunny_is_built_as_on_the_cpu).unless(models::missing()),
        needs_device(sponza_is_built_as_on_the_cpu).unless(models::missing()),
        needs_device(the_kitchen_is_built_as_on_the_cpu).unless(models::missing()),
    ]
}

/// Compares a model with the CPU: integers for codes of both lengths, oriented boxes with what is below them.
fn look_at(file: &str) {
    let (folder, gpu) = (models::folder(), gpu());
    let scene = canted_scene::read(&folder.join(file)).unwrap();
    let meshes: Vec<Mesh> =
        scene.meshes.into_iter().map(|mesh| Mesh { positions: mesh.positions, triangles: mesh.triangles }).collect();
    for bits in BOTH {
        assert_equal(&gpu, &twins(&meshes, bits), bits, file);
    }
    let twins = twins(&meshes, Bits::B63);
    for strategy in &STRATEGIES[1..] {
        assert_contained(&gpu, &twins, *strategy, file);
    }
}

fn the_bunny_is_built_as_on_the_cpu() {
    look_at("stanford/bunny.ply");
}

fn sponza_is_built_as_on_the_cpu() {
    look_at("sponza/sponza.obj");
}

fn the_kitchen_is_built_as_on_the_cpu() {
    look_at("kitchen/country_kitchen.glb");
}
