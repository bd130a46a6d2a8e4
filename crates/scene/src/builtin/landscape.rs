//! The river with its valley and trees; crane barges, sailing boats and reeds.

use std::f64::consts::TAU;

use canted_obb::vector::Vector as Vec3;

use super::build::{MeshBuilder, Paint, SceneBuilder, hills, lerp, noise, random, tilted, upright};
use crate::{Mesh, MeshId};

/// Half the width of the river.
const HALF_RIVER: f64 = 185.0;
/// Side of a water tile.
const TILE: f64 = 160.0;
/// Cells along a side of a water tile.
const TILE_CELLS: u32 = 48;
/// Cells of the terrain along x and z.
const TERRAIN_CELLS: [u32; 2] = [140, 120];

/// Adds terrain, water and trees.
pub(super) fn place(builder: &mut SceneBuilder) {
    let terrain = builder.mesh(terrain());
    builder.place(terrain, upright([0.0; 3], 0.0, [1.0; 3]));
    let water = builder.mesh(water());
    for row in -12..4 {
        for column in -3..12 {
            let [x, z] = [column, row].map(|k| TILE * f64::from(k));
            if has_water(x, z) {
                builder.place(water, upright([x, 0.0, z], 0.0, [1.0; 3]));
            }
        }
    }
    place_trees(builder);
}

/// Whether any sample point of the tile from `(x, z)` towards positive x and negative z is near the river.
fn has_water(x: f64, z: f64) -> bool {
    let steps = || (0..=8).map(|k| TILE * f64::from(k) / 8.0);
    steps().any(|along| steps().any(|across| inland(x + along, z - across) < 0.1 * TILE))
}

/// x of the river center: straight under the bridge, bending to the right upstream.
fn river_center(z: f64) -> f64 {
    let upstream = (-120.0 - z).max(0.0);
    upstream * upstream / (upstream + 500.0)
}

/// Approximate distance from the waterline; negative in the river.
fn inland(x: f64, z: f64) -> f64 {
    // In the bend the distance along x overestimates the distance across the river.
    let upstream = (-120.0 - z).max(0.0);
    let slope = 1.0 - (500.0 / (upstream + 500.0)).powi(2);
    let distance = (x - river_center(z)).abs() / (1.0 + slope * slope).sqrt();
    distance - HALF_RIVER + 14.0 * hills(x / 90.0, z / 90.0, 40)
}

fn smoothstep(from: f64, to: f64, x: f64) -> f64 {
    let s = ((x - from) / (to - from)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Height of the ground above the water.
pub(super) fn ground(x: f64, z: f64) -> f64 {
    let inland = inland(x, z);
    if inland < 0.0 {
        return (0.25 * inland).max(-12.0);
    }
    let far = (x * x + z * z).sqrt();
    let bank = 29.0 * smoothstep(10.0, 125.0, inland) + 0.03 * inland.min(60.0);
    let hilly = smoothstep(120.0, 700.0, inland) * (70.0 + 110.0 * hills(x / 420.0, z / 420.0, 50));
    let mountains = smoothstep(900.0, 2600.0, far) * smoothstep(100.0, 900.0, inland);
    bank + 2.5 * hills(x / 40.0, z / 40.0, 60) * smoothstep(0.0, 40.0, inland)
        + hilly
        + mountains * (260.0 + 330.0 * hills(x / 800.0, z / 800.0, 70))
}

/// The ground; cell size grows with distance from the bridge.
fn terrain() -> Mesh {
    let x_at = |i: u32| {
        let u = -0.7 + 1.7 * f64::from(i) / f64::from(TERRAIN_CELLS[0]);
        450.0 * u + 2500.0 * u * u * u
    };
    let z_at = |j: u32| {
        let v = -0.5 + 1.5 * f64::from(j) / f64::from(TERRAIN_CELLS[1]);
        -60.0 - (420.0 * v + 2800.0 * v * v * v)
    };
    let mut mesh = MeshBuilder::default();
    for j in 0..=TERRAIN_CELLS[1] {
        for i in 0..=TERRAIN_CELLS[0] {
            let [x, z] = [x_at(i), z_at(j)];
            mesh.vertex([x, ground(x, z), z]);
        }
    }
    let row = TERRAIN_CELLS[0] + 1;
    for j in 0..TERRAIN_CELLS[1] {
        for i in 0..TERRAIN_CELLS[0] {
            let corner = j * row + i;
            let paint = paint_at(0.5 * (x_at(i) + x_at(i + 1)), 0.5 * (z_at(j) + z_at(j + 1)));
            mesh.quad(paint, [corner, corner + 1, corner + row + 1, corner + row]);
        }
    }
    mesh.finish("terrain")
}

/// Material by distance from the bridge, with irregular borders, and by slope nearby.
fn paint_at(x: f64, z: f64) -> Paint {
    let inland = inland(x, z);
    let far = (x * x + z * z).sqrt() * (1.0 + 0.15 * hills(x / 200.0, z / 200.0, 80));
    let step = 4.0;
    let rise = (ground(x + step, z) - ground(x - step, z)).hypot(ground(x, z + step) - ground(x, z - step));
    if inland < 16.0 {
        Paint::Sand
    } else if far > 2500.0 {
        Paint::Haze
    } else if far > 1600.0 {
        Paint::Mountains
    } else if far > 800.0 {
        Paint::Hills
    } else if rise > 0.75 * 2.0 * step {
        Paint::Rock
    } else {
        Paint::Grass
    }
}

/// A tileable square of waves.
fn water() -> Mesh {
    let n = TILE_CELLS;
    let height = |i: u32, j: u32| {
        let octave = |period: i32, amplitude: f64| {
            let at = |k: u32| f64::from(k % n) / f64::from(n) * f64::from(period);
            amplitude * noise(at(i), at(j), period, 90)
        };
        octave(8, 0.45) + octave(15, 0.32) + octave(24, 0.22)
    };
    let mut mesh = MeshBuilder::default();
    let place = |k: u32| TILE * (f64::from(k) / f64::from(n));
    for j in 0..=n {
        for i in 0..=n {
            mesh.vertex([place(i), height(i, j), -place(j)]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let corner = j * (n + 1) + i;
            mesh.quad(Paint::Water, [corner, corner + 1, corner + n + 2, corner + n + 1]);
        }
    }
    mesh.finish("water")
}

/// Adds trees on the slopes, fewer near the river, none at the building sites.
fn place_trees(builder: &mut SceneBuilder) {
    let trees = [builder.mesh(conifer()), builder.mesh(broadleaf())];
    let spacing = 17.0;
    for j in -120..30 {
        for i in -60..120 {
            let draw = |seed: u32| random([i, j], seed);
            let x = spacing * (f64::from(i) + draw(1));
            let z = spacing * (f64::from(j) + draw(2));
            let inland = inland(x, z);
            let density =
                0.75 * smoothstep(-0.25, 0.35, hills(x / 260.0, z / 260.0, 20)) * smoothstep(30.0, 190.0, inland);
            if draw(3) >= density || is_clearing(x, z) || !is_near_view(x, z) {
                continue;
            }
            let kind = usize::from(hills(x / 120.0, z / 120.0, 30) + 0.7 * draw(4) > 0.62);
            let width = 0.8 + 0.7 * draw(5);
            let height = width * (0.85 + 0.4 * draw(9));
            let upward = [0.1 * (draw(6) - 0.5), 1.0, 0.1 * (draw(7) - 0.5)];
            let root = [x, ground(x, z) - 0.5, z];
            builder.place(trees[kind], tilted(root, upward, TAU * draw(8), [width, height, width]));
        }
    }
}

/// The road and the building sites.
fn is_clearing(x: f64, z: f64) -> bool {
    z.abs() < 26.0 || (x.abs() < 420.0 && (-140.0..340.0).contains(&z))
}

/// Whether a tree is close enough to the camera to matter.
fn is_near_view(x: f64, z: f64) -> bool {
    (x + 240.0).hypot(z - 230.0) < 1500.0
}

fn conifer() -> Mesh {
    let mut mesh = MeshBuilder::default();
    mesh.frustum(Paint::Wood, [[0.0; 3], [0.0, 4.0, 0.0]], [0.9, 0.7], 3);
    for (base, tip, width) in [(2.0, 9.0, 7.6), (5.5, 12.5, 5.8), (9.0, 16.5, 3.8)] {
        mesh.frustum(Paint::Needles, [[0.0, base, 0.0], [0.0, tip, 0.0]], [width, 0.0], 7);
    }
    mesh.finish("conifer")
}

fn broadleaf() -> Mesh {
    let mut mesh = MeshBuilder::default();
    mesh.frustum(Paint::Wood, [[0.0; 3], [0.0, 5.0, 0.0]], [0.9, 0.6], 3);
    let rings = [(2.6, 3.0), (4.2, 7.2), (7.4, 8.2), (10.2, 5.8)];
    for (lower, upper) in rings.iter().zip(&rings[1..]) {
        mesh.frustum(Paint::Leaves, [[0.0, lower.0, 0.0], [0.0, upper.0, 0.0]], [lower.1, upper.1], 7);
    }
    mesh.frustum(Paint::Leaves, [[0.0, 10.2, 0.0], [0.0, 11.6, 0.0]], [5.8, 0.0], 7);
    mesh.finish("broad-leaved tree")
}

/// Adds barges with a `crane` each, boats and reeds.
pub(super) fn place_river(builder: &mut SceneBuilder, crane: MeshId) {
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
