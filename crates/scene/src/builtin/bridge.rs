//! A cable-stayed bridge along x: lattice girder, inclined pylons, stay cables, piers.

use canted_obb::vector::{Vector as Vec3, sub};

use super::{
    mesh_builder::{MeshBuilder, lerp, square_rings},
    palette::Paint,
    scene_builder::{SceneBuilder, affine, tilted, upright},
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

/// Adds the bridge.
pub(super) fn place(builder: &mut SceneBuilder) {
    let panel = builder.mesh(panel());
    let n_panels = 66;
    for i in 0..n_panels {
        let x = -HALF_LENGTH + PANEL * f64::from(i);
        builder.place(panel, upright([x, DECK_HEIGHT, 0.0], 0.0, [1.0; 3]));
    }
    let leg = builder.mesh(leg());
    let stays = builder.mesh(stays());
    let footing = builder.mesh(footing());
    let beam = builder.mesh(beam());
    for x in [-1.0, 1.0] {
        for z in [-1.0, 1.0] {
            let mirror = affine([[x, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, z], [0.0; 3]]);
            let mirrored = |p: Vec3| [x * p[0], p[1], z * p[2]];
            let upward = sub(mirrored(LEG[1]), mirrored(LEG[0]));
            builder.place(leg, tilted(mirrored(LEG[0]), upward, 0.0, [1.0; 3]));
            builder.place(stays, mirror);
            builder.place(footing, upright([x * LEG[0][0], 0.0, z * LEG[0][2]], 0.0, [1.0; 3]));
        }
        for height in [0.20, 0.52, 0.74] {
            let [px, py, pz] = lerp(LEG[0], LEG[1], height);
            builder.place(beam, upright([x * px, py, 0.0], 0.0, [1.0, 1.0, pz]));
        }
    }
    let pier = builder.mesh(pier());
    for x in [-320.0, -265.0, -210.0, 210.0, 265.0, 320.0] {
        builder.place(pier, upright([x, DECK_HEIGHT - GIRDER[1], 0.0], 0.0, [1.0; 3]));
    }
}

/// One panel of the girder starting at `x = 0`, with the road at `y = 0`.
fn panel() -> Mesh {
    let [half, height] = GIRDER;
    let ring = |x: f64| [[x, -height, -half], [x, -height, half], [x, -0.4, half], [x, -0.4, -half]];
    let mut mesh = MeshBuilder::default();
    mesh.lattice(&[ring(0.0), ring(PANEL)], [0.55, 0.32], |_| Paint::Steel);
    mesh.block(Paint::Concrete, [0.0, -0.45, -half - 0.9], [PANEL, -0.02, half + 0.9]);
    mesh.block(Paint::Asphalt, [0.0, -0.1, -half + 0.8], [PANEL, 0.05, half - 0.8]);
    for z in [-half - 0.7, half + 0.7] {
        for height in [0.6, 1.2] {
            mesh.bar(Paint::Cable, [0.0, height, z], [PANEL, height, z], 0.09);
        }
        for post in 0..4 {
            let x = PANEL * (f64::from(post) + 0.5) / 4.0;
            mesh.bar(Paint::Cable, [x, 0.0, z], [x, 1.2, z], 0.12);
        }
    }
    mesh.finish("girder panel")
}

/// A pylon leg, straight up along y.
fn leg() -> Mesh {
    let [x, y, z] = sub(LEG[1], LEG[0]);
    let height = (x * x + y * y + z * z).sqrt();
    let mut mesh = MeshBuilder::default();
    mesh.lattice(&square_rings([4.0, 1.3], height, 30), [0.8, 0.34], |_| Paint::Steel);
    mesh.block(Paint::Steel, [-1.6, height, -1.6], [1.6, height + 1.2, 1.6]);
    mesh.finish("pylon leg")
}

/// A lattice beam along z from -1 to 1, scaled to connect two legs.
fn beam() -> Mesh {
    let n_bays = 8;
    let ring = |i: i32| {
        let z = f64::from(i) / 4.0 - 1.0;
        [[-1.2, -1.2, z], [1.2, -1.2, z], [1.2, 1.2, z], [-1.2, 1.2, z]]
    };
    let mut mesh = MeshBuilder::default();
    mesh.lattice(&(0..=n_bays).map(ring).collect::<Vec<_>>(), [0.45, 0.25], |_| Paint::Steel);
    mesh.finish("cross beam")
}

/// The stay cables of the leg at positive x and z, in world space: one fan towards the river and one towards the bank.
fn stays() -> Mesh {
    let n_stays = 22;
    let mut mesh = MeshBuilder::default();
    let at_deck = LEG[0][0] + 9.0;
    for reach in [5.0 - at_deck, HALF_LENGTH - 5.0 - at_deck] {
        for stay in 1..=n_stays {
            let fraction = f64::from(stay) / f64::from(n_stays);
            let head = lerp(LEG[0], LEG[1], 0.60 + 0.39 * fraction);
            let anchor = [at_deck + reach * (0.08 + 0.92 * fraction), DECK_HEIGHT, GIRDER[0] + 0.4];
            mesh.cable(Paint::Cable, anchor, head, 0.36);
        }
    }
    mesh.finish("stays")
}

/// The foundation of a leg.
fn footing() -> Mesh {
    let mut mesh = MeshBuilder::default();
    mesh.block(Paint::Concrete, [-9.0, -10.0, -8.0], [9.0, 2.2, 8.0]);
    mesh.block(Paint::Concrete, [-6.5, 2.2, -6.0], [6.5, 4.6, 6.0]);
    mesh.finish("footing")
}

/// A pier below the girder, its top at `y = 0`.
fn pier() -> Mesh {
    let mut mesh = MeshBuilder::default();
    mesh.block(Paint::Concrete, [-2.0, -2.0, -8.6], [2.0, 0.0, 8.6]);
    for z in [-5.0, 5.0] {
        mesh.block(Paint::Concrete, [-1.3, -40.0, z - 1.5], [1.3, -2.0, z + 1.5]);
    }
    mesh.finish("pier")
}
