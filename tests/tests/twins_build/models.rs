//! Real models, one tree per mesh: all stages, end to end, and boxes of every kind. Missing models are skipped with a message.

use canted_fixtures::Mesh;
use canted_gpu::build::STRATEGIES;
use canted_lbvh::Bits;
use canted_tests::scenes::models;

use crate::{
    compare::assert_equal,
    setup::{BOTH, gpu, twins},
    volumes::assert_contained,
};

/// Compares a model with the CPU: integers for codes of both lengths, oriented boxes with what is below them.
fn look_at(test: &str, file: &str) {
    let (Some(folder), Some(gpu)) = (models(test), gpu(test)) else { return };
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

#[test]
fn the_bunny_is_built_as_on_the_cpu() {
    look_at("the_bunny_is_built_as_on_the_cpu", "stanford/bunny.ply");
}

#[test]
fn sponza_is_built_as_on_the_cpu() {
    look_at("sponza_is_built_as_on_the_cpu", "sponza/sponza.obj");
}

#[test]
fn the_kitchen_is_built_as_on_the_cpu() {
    look_at("the_kitchen_is_built_as_on_the_cpu", "kitchen/country_kitchen.glb");
}
