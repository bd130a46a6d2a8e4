//! Picking and collision of moving meshes through the ECS of Bevy, without a window: a box falls onto a floor, and a ray picks it.
//!
//! `cargo run --manifest-path examples/bevy-pick/Cargo.toml`. In a game, add [`scene::CollisionPlugin`] to the app, and a [`scene::Collider`] to each entity with a mesh.

#![forbid(unsafe_code)]

mod scene;

use std::sync::Arc;

use bevy_app::{App, Update};
use bevy_ecs::prelude::*;
use bevy_math::Vec3;
use bevy_transform::plugins::TransformPlugin;
use bevy_transform::prelude::{GlobalTransform, Transform};
use canted::TriangleBvh;

use crate::scene::{Collider, CollisionPlugin, CollisionScene};

/// Seconds of a frame.
const FRAME: f32 = 1.0 / 60.0;

/// Meters a second.
#[derive(Component)]
struct Velocity(Vec3);

fn fall(mut bodies: Query<(&mut Transform, &Velocity)>) {
    for (mut transform, velocity) in &mut bodies {
        transform.translation += FRAME * velocity.0;
    }
}

/// A closed box around the origin.
fn cuboid([x, y, z]: [f32; 3]) -> Arc<TriangleBvh> {
    let corners: Vec<[f32; 3]> = (0..8)
        .map(|i| [if i & 1 == 0 { -x } else { x }, if i & 2 == 0 { -y } else { y }, if i & 4 == 0 { -z } else { z }])
        .collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Arc::new(TriangleBvh::build(&corners, &triangles).expect("all corners are finite"))
}

/// An app with a floor, whose top is at 0, and a box of side 1 that falls from 2 m above it at 3 m/s.
fn app() -> (App, [Entity; 2]) {
    let mut app = App::new();
    app.add_plugins((TransformPlugin, CollisionPlugin { meshes: vec![cuboid([5.0, 0.5, 5.0]), cuboid([0.5; 3])] }));
    app.add_systems(Update, fall);
    let at = |y: f32| (Transform::from_xyz(0.0, y, 0.0), GlobalTransform::default());
    let floor = app.world_mut().spawn((Collider(0), at(-0.5))).id();
    let body = app.world_mut().spawn((Collider(1), at(2.5), Velocity(Vec3::new(0.0, -3.0, 0.0)))).id();
    (app, [floor, body])
}

fn main() {
    let (mut app, [floor, body]) = app();
    let name = |entity: Entity| if entity == floor { "the floor" } else { "the box" };
    for frame in 1..=60 {
        app.update();
        let scene = app.world().resource::<CollisionScene>();
        if frame % 15 == 0
            && let Some((entity, t)) = scene.pick([0.25, 8.0, 0.25], [0.0, -1.0, 0.0])
        {
            println!("frame {frame}: the ray from above hits {} after {t:.2} m", name(entity));
        }
        for [a, b] in &scene.begun {
            println!("frame {frame}: {} touches {}", name(*a), name(*b));
        }
        if !scene.touching(body).is_empty() {
            app.world_mut().entity_mut(body).remove::<Velocity>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The box is 2 m above the floor and falls 5 cm a frame: it touches in the 40th frame, give or take a rounding.
    #[test]
    fn a_box_falls_onto_a_floor_and_is_picked() {
        let (mut app, [floor, body]) = app();
        let mut both = [floor, body];
        both.sort_unstable();
        let mut touched = None;
        for frame in 1..=45 {
            app.update();
            let scene = app.world().resource::<CollisionScene>();
            let (entity, t) = scene.pick([0.25, 8.0, 0.25], [0.0, -1.0, 0.0]).expect("the box is below");
            let top = 3.0 - 0.05 * frame as f32;
            assert!(entity == body && (t - (8.0 - top)).abs() < 1e-4, "frame {frame}: {t}");
            assert_eq!(scene.pick([3.0, 8.0, 3.0], [0.0, -1.0, 0.0]), Some((floor, 8.0)));
            if !scene.begun.is_empty() {
                assert_eq!(scene.begun, [both]);
                touched = Some(frame);
            }
        }
        assert!(matches!(touched, Some(40 | 41)), "{touched:?}");
        // What is gone neither touches nor is picked.
        app.world_mut().entity_mut(body).despawn();
        app.update();
        let scene = app.world().resource::<CollisionScene>();
        assert_eq!(scene.ended, [both]);
        assert!(scene.touching(floor).is_empty());
        assert_eq!(scene.pick([0.25, 8.0, 0.25], [0.0, -1.0, 0.0]), Some((floor, 8.0)));
    }
}
