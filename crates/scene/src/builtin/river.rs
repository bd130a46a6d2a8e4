//! Crane barges, sailing boats and reeds.

use std::f64::consts::TAU;

use canted_obb::vector::Vector as Vec3;

use super::{
    land::{ground, inland},
    mesh_builder::{MeshBuilder, lerp},
    noise::random,
    palette::Paint,
    scene_builder::{SceneBuilder, tilted, upright},
};
use crate::{Mesh, MeshId};

/// Adds barges with a `crane` each, boats and reeds.
pub(super) fn place(builder: &mut SceneBuilder, crane: MeshId) {
    let barge = builder.mesh(barge());
    for (x, z, heading_rad, crane_rad) in [(-48.0, 116.0, 0.5, -0.7), (52.0, -46.0, -0.3, 0.9)] {
        builder.place(barge, upright([x, 0.0, z], heading_rad, [1.0; 3]));
        builder.place(crane, tilted([x, 2.0, z], [0.02, 1.0, 0.015], crane_rad, [0.95; 3]));
    }
    let boat = builder.mesh(boat());
    for (x, z, heading_rad, list) in [
        (-136.0, 176.0, 0.9, 0.16),
        (20.0, 168.0, 0.6, 0.20),
        (96.0, 108.0, 0.3, 0.18),
        (10.0, 42.0, 0.8, 0.15),
        (60.0, -150.0, 0.7, 0.14),
    ] {
        builder.place(boat, tilted([x, 0.2, z], [list, 1.0, 0.5 * list], heading_rad, [1.2; 3]));
    }
    place_reeds(builder);
}

/// A pontoon with rails; its deck is 2 m above the water.
fn barge() -> Mesh {
    let [length, width] = [19.0, 7.5];
    let mut mesh = MeshBuilder::default();
    mesh.block(Paint::Red, [-length, -1.0, -width], [length, 1.3, width]);
    mesh.block(Paint::Wood, [-length - 0.3, 1.3, -width - 0.3], [length + 0.3, 2.0, width + 0.3]);
    mesh.block(Paint::White, [-16.5, 2.0, -4.0], [-9.5, 5.2, 4.0]);
    mesh.block(Paint::White, [-15.0, 5.2, -3.0], [-11.0, 7.4, 3.0]);
    for i in 0..3 {
        let x = 7.0 + 3.2 * f64::from(i);
        mesh.block(Paint::Steel, [x, 2.0, -5.5], [x + 2.4, 4.6, 0.6]);
    }
    for z in [-width, width] {
        mesh.bar(Paint::White, [-length, 3.2, z], [length, 3.2, z], 0.12);
        for post in 0..=12 {
            let x = length * (f64::from(post) / 6.0 - 1.0);
            mesh.bar(Paint::White, [x, 2.0, z], [x, 3.2, z], 0.12);
        }
    }
    mesh.finish("barge")
}

/// A sailing boat pointing along x.
fn boat() -> Mesh {
    let mut mesh = MeshBuilder::default();
    let [bow, stern] = [[5.2, 0.9, 0.0], [-4.4, 0.8, 0.0]];
    let keel = mesh.vertex([-0.3, -0.9, 0.0]);
    let gunwale: Vec<u32> =
        [bow, [1.5, 0.7, -1.5], [-4.2, 0.7, -1.1], [-4.2, 0.7, 1.1], [1.5, 0.7, 1.5]].map(|p| mesh.vertex(p)).into();
    for k in 0..5 {
        let next = (k + 1) % 5;
        mesh.triangle(Paint::White, [keel, gunwale[next], gunwale[k]]);
        if (1..4).contains(&k) {
            mesh.triangle(Paint::Wood, [gunwale[0], gunwale[k], gunwale[next]]);
        }
    }
    let [foot, head] = [[0.8, 0.7, 0.0], [0.6, 13.0, 0.0]];
    mesh.bar(Paint::Wood, foot, head, 0.16);
    mesh.cable(Paint::Cable, bow, head, 0.05);
    mesh.cable(Paint::Cable, stern, head, 0.05);
    let sails = [
        [lerp(foot, head, 0.1), [-4.0, 2.0, 0.5], lerp(foot, head, 0.98)],
        [[4.8, 1.3, 0.0], [1.2, 1.7, 0.6], lerp(foot, head, 0.85)],
    ];
    for sail in sails {
        let corners = sail.map(|p| mesh.vertex(p));
        mesh.triangle(Paint::White, corners);
    }
    mesh.finish("boat")
}

/// Adds reeds along the near shore and grass behind them.
fn place_reeds(builder: &mut SceneBuilder) {
    let reeds = builder.mesh(tuft("reeds", Paint::Reed));
    let grass = builder.mesh(tuft("grass", Paint::Meadow));
    let spacing = 2.2;
    for j in 10..120 {
        for i in -140..-60 {
            let draw = |seed: u32| random([i, j], 100 + seed);
            let [x, z] = [spacing * (f64::from(i) + draw(1)), spacing * (f64::from(j) + draw(2))];
            let inland = inland(x, z);
            let (kind, density, size) = match inland {
                -4.0..9.0 => (reeds, 0.55, 0.7),
                20.0.. => (grass, 0.12, 0.25),
                _ => continue,
            };
            if draw(3) < density {
                let size = size * (1.0 + draw(4));
                builder.place(kind, upright([x, ground(x, z).max(-1.0), z], TAU * draw(5), [size; 3]));
            }
        }
    }
}

/// A tuft of thin blades.
fn tuft(name: &str, paint: Paint) -> Mesh {
    let mut mesh = MeshBuilder::default();
    for blade in 0..14 {
        let draw = |seed: u32| random([blade, 0], 200 + seed);
        let root: Vec3 = [1.6 * (draw(1) - 0.5), -0.3, 1.6 * (draw(2) - 0.5)];
        let tip = [root[0] + 1.6 * (draw(3) - 0.5), 2.2 + 1.6 * draw(4), root[2] + 1.6 * (draw(5) - 0.5)];
        mesh.frustum(paint, [root, tip], [0.13, 0.0], 3);
    }
    mesh.finish(name)
}
