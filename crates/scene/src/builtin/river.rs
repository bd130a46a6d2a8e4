//! What floats on the river and grows at its edge: crane barges, sailing boats, reeds.

use std::f64::consts::TAU;

use super::{
    draft::{Draft, Vec3, between},
    land::{ground, inland},
    noise::random,
    palette::Paint,
    stage::{Stage, leaning, upright},
};
use crate::{Mesh, MeshId};

/// Places barges, a `crane` on each, boats and reeds.
pub(super) fn place(stage: &mut Stage, crane: MeshId) {
    let barge = stage.mesh(barge());
    for (x, z, heading_rad, crane_rad) in [(-48.0, 116.0, 0.5, -0.7), (52.0, -46.0, -0.3, 0.9)] {
        stage.place(barge, upright([x, 0.0, z], heading_rad, [1.0; 3]));
        stage.place(crane, leaning([x, 2.0, z], [0.02, 1.0, 0.015], crane_rad, [0.95; 3]));
    }
    let boat = stage.mesh(boat());
    for (x, z, heading_rad, list) in [
        (-136.0, 176.0, 0.9, 0.16),
        (20.0, 168.0, 0.6, 0.20),
        (96.0, 108.0, 0.3, 0.18),
        (10.0, 42.0, 0.8, 0.15),
        (60.0, -150.0, 0.7, 0.14),
    ] {
        stage.place(boat, leaning([x, 0.2, z], [list, 1.0, 0.5 * list], heading_rad, [1.2; 3]));
    }
    place_reeds(stage);
}

/// A pontoon with rails; its deck lies 2 above the water.
fn barge() -> Mesh {
    let [length, width] = [19.0, 7.5];
    let mut draft = Draft::default();
    draft.block(Paint::Red, [-length, -1.0, -width], [length, 1.3, width]);
    draft.block(Paint::Wood, [-length - 0.3, 1.3, -width - 0.3], [length + 0.3, 2.0, width + 0.3]);
    draft.block(Paint::White, [-16.5, 2.0, -4.0], [-9.5, 5.2, 4.0]);
    draft.block(Paint::White, [-15.0, 5.2, -3.0], [-11.0, 7.4, 3.0]);
    for i in 0..3 {
        let x = 7.0 + 3.2 * f64::from(i);
        draft.block(Paint::Steel, [x, 2.0, -5.5], [x + 2.4, 4.6, 0.6]);
    }
    for z in [-width, width] {
        draft.bar(Paint::White, [-length, 3.2, z], [length, 3.2, z], 0.12);
        for post in 0..=12 {
            let x = length * (f64::from(post) / 6.0 - 1.0);
            draft.bar(Paint::White, [x, 2.0, z], [x, 3.2, z], 0.12);
        }
    }
    draft.finish("barge")
}

/// A sailing boat, its bow along x.
fn boat() -> Mesh {
    let mut draft = Draft::default();
    let [bow, stern] = [[5.2, 0.9, 0.0], [-4.4, 0.8, 0.0]];
    let keel = draft.vertex([-0.3, -0.9, 0.0]);
    let rim: Vec<u32> =
        [bow, [1.5, 0.7, -1.5], [-4.2, 0.7, -1.1], [-4.2, 0.7, 1.1], [1.5, 0.7, 1.5]].map(|p| draft.vertex(p)).into();
    for k in 0..5 {
        let next = (k + 1) % 5;
        draft.triangle(Paint::White, [keel, rim[next], rim[k]]);
        if (1..4).contains(&k) {
            draft.triangle(Paint::Wood, [rim[0], rim[k], rim[next]]);
        }
    }
    let [foot, head] = [[0.8, 0.7, 0.0], [0.6, 13.0, 0.0]];
    draft.bar(Paint::Wood, foot, head, 0.16);
    draft.cable(Paint::Cable, bow, head, 0.05);
    draft.cable(Paint::Cable, stern, head, 0.05);
    let sails = [
        [between(foot, head, 0.1), [-4.0, 2.0, 0.5], between(foot, head, 0.98)],
        [[4.8, 1.3, 0.0], [1.2, 1.7, 0.6], between(foot, head, 0.85)],
    ];
    for sail in sails {
        let corners = sail.map(|p| draft.vertex(p));
        draft.triangle(Paint::White, corners);
    }
    draft.finish("boat")
}

/// Reeds along the near shore, and grass of the same shape on the meadow behind it.
fn place_reeds(stage: &mut Stage) {
    let reeds = stage.mesh(tuft("reeds", Paint::Reed));
    let grass = stage.mesh(tuft("grass", Paint::Meadow));
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
                stage.place(kind, upright([x, ground(x, z).max(-1.0), z], TAU * draw(5), [size; 3]));
            }
        }
    }
}

/// A tuft of thin blades that fan out from the root.
fn tuft(name: &str, paint: Paint) -> Mesh {
    let mut draft = Draft::default();
    for blade in 0..14 {
        let draw = |seed: u32| random([blade, 0], 200 + seed);
        let root: Vec3 = [1.6 * (draw(1) - 0.5), -0.3, 1.6 * (draw(2) - 0.5)];
        let tip = [root[0] + 1.6 * (draw(3) - 0.5), 2.2 + 1.6 * draw(4), root[2] + 1.6 * (draw(5) - 0.5)];
        draft.frustum(paint, [root, tip], [0.13, 0.0], 3);
    }
    draft.finish(name)
}
