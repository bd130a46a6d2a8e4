//! A cable-stayed bridge along x: lattice girder, leaning pylons, fans of stays, piers.

use super::{
    draft::{Draft, Vec3, between, square_rings, sub},
    palette::Paint,
    stage::{Stage, affine, leaning, upright},
};
use crate::Mesh;

/// Height of the road above the water.
pub(super) const DECK_HEIGHT: f64 = 34.0;
/// Half the length of the girder.
pub(super) const HALF_LENGTH: f64 = 330.0;
/// Length of one panel of the girder.
const PANEL: f64 = 10.0;
/// Half the width of the girder and its height.
const GIRDER: [f64; 2] = [8.0, 5.5];
/// Foot and head of the pylon leg at positive x and z; the other three mirror it.
const LEG: [Vec3; 2] = [[112.0, -4.0, 19.0], [144.0, 138.0, 2.6]];

/// Places the whole bridge.
pub(super) fn place(stage: &mut Stage) {
    let panel = stage.mesh(panel());
    let n_panels = 66;
    for i in 0..n_panels {
        let x = -HALF_LENGTH + PANEL * f64::from(i);
        stage.place(panel, upright([x, DECK_HEIGHT, 0.0], 0.0, [1.0; 3]));
    }
    let leg = stage.mesh(leg());
    let stays = stage.mesh(stays());
    let footing = stage.mesh(footing());
    let beam = stage.mesh(beam());
    for x in [-1.0, 1.0] {
        for z in [-1.0, 1.0] {
            let mirror = affine([[x, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, z], [0.0; 3]]);
            let mirrored = |p: Vec3| [x * p[0], p[1], z * p[2]];
            let upward = sub(mirrored(LEG[1]), mirrored(LEG[0]));
            stage.place(leg, leaning(mirrored(LEG[0]), upward, 0.0, [1.0; 3]));
            stage.place(stays, mirror);
            stage.place(footing, upright([x * LEG[0][0], 0.0, z * LEG[0][2]], 0.0, [1.0; 3]));
        }
        for height in [0.20, 0.52, 0.74] {
            let [px, py, pz] = between(LEG[0], LEG[1], height);
            stage.place(beam, upright([x * px, py, 0.0], 0.0, [1.0, 1.0, pz]));
        }
    }
    let pier = stage.mesh(pier());
    for x in [-320.0, -265.0, -210.0, 210.0, 265.0, 320.0] {
        stage.place(pier, upright([x, DECK_HEIGHT - GIRDER[1], 0.0], 0.0, [1.0; 3]));
    }
}

/// One panel of the girder, its road at `y = 0`, from `x = 0` on.
fn panel() -> Mesh {
    let [half, height] = GIRDER;
    let ring = |x: f64| [[x, -height, -half], [x, -height, half], [x, -0.4, half], [x, -0.4, -half]];
    let mut draft = Draft::default();
    draft.lattice(&[ring(0.0), ring(PANEL)], [0.55, 0.32], |_| Paint::Steel);
    draft.block(Paint::Concrete, [0.0, -0.45, -half - 0.9], [PANEL, -0.02, half + 0.9]);
    draft.block(Paint::Asphalt, [0.0, -0.1, -half + 0.8], [PANEL, 0.05, half - 0.8]);
    for z in [-half - 0.7, half + 0.7] {
        for height in [0.6, 1.2] {
            draft.bar(Paint::Cable, [0.0, height, z], [PANEL, height, z], 0.09);
        }
        for post in 0..4 {
            let x = PANEL * (f64::from(post) + 0.5) / 4.0;
            draft.bar(Paint::Cable, [x, 0.0, z], [x, 1.2, z], 0.12);
        }
    }
    draft.finish("girder panel")
}

/// A pylon leg, straight up along y.
fn leg() -> Mesh {
    let [x, y, z] = sub(LEG[1], LEG[0]);
    let height = (x * x + y * y + z * z).sqrt();
    let mut draft = Draft::default();
    draft.lattice(&square_rings([4.0, 1.3], height, 30), [0.8, 0.34], |_| Paint::Steel);
    draft.block(Paint::Steel, [-1.6, height, -1.6], [1.6, height + 1.2, 1.6]);
    draft.finish("pylon leg")
}

/// A lattice beam along z from -1 to 1, to be stretched between two legs.
fn beam() -> Mesh {
    let n_bays = 8;
    let ring = |i: i32| {
        let z = f64::from(i) / 4.0 - 1.0;
        [[-1.2, -1.2, z], [1.2, -1.2, z], [1.2, 1.2, z], [-1.2, 1.2, z]]
    };
    let mut draft = Draft::default();
    draft.lattice(&(0..=n_bays).map(ring).collect::<Vec<_>>(), [0.45, 0.25], |_| Paint::Steel);
    draft.finish("cross beam")
}

/// The stays of the leg at positive x and z, in world space: a fan to the river's middle and one to the bank.
fn stays() -> Mesh {
    let n_stays = 22;
    let mut draft = Draft::default();
    let at_deck = LEG[0][0] + 9.0;
    for reach in [5.0 - at_deck, HALF_LENGTH - 5.0 - at_deck] {
        for stay in 1..=n_stays {
            let fraction = f64::from(stay) / f64::from(n_stays);
            let head = between(LEG[0], LEG[1], 0.60 + 0.39 * fraction);
            let anchor = [at_deck + reach * (0.08 + 0.92 * fraction), DECK_HEIGHT, GIRDER[0] + 0.4];
            draft.cable(Paint::Cable, anchor, head, 0.36);
        }
    }
    draft.finish("stays")
}

/// What a leg stands on, in the water.
fn footing() -> Mesh {
    let mut draft = Draft::default();
    draft.block(Paint::Concrete, [-9.0, -10.0, -8.0], [9.0, 2.2, 8.0]);
    draft.block(Paint::Concrete, [-6.5, 2.2, -6.0], [6.5, 4.6, 6.0]);
    draft.finish("footing")
}

/// A pier below the girder, its top at `y = 0`.
fn pier() -> Mesh {
    let mut draft = Draft::default();
    draft.block(Paint::Concrete, [-2.0, -2.0, -8.6], [2.0, 0.0, 8.6]);
    for z in [-5.0, 5.0] {
        draft.block(Paint::Concrete, [-1.3, -40.0, z - 1.5], [1.3, -2.0, z + 1.5]);
    }
    draft.finish("pier")
}
