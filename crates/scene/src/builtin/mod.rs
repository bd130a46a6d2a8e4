//! The built-in scene: a cable-stayed bridge over a river at low sun (lattice girder, inclined pylons, stay cables, piers), with cranes,
//! scaffolds, concrete shells and masts on the banks.
//!
//! Units are meters, y is up, the water is at `y = 0`. Most geometry is long, thin and diagonal, and instanced many times.

mod build;
mod landscape;

use std::f64::consts::{FRAC_PI_2, TAU};

use build::{MeshBuilder, Paint, SceneBuilder, affine, lerp, square_rings, tilted, upright};
use canted_obb::vector::{Vector as Vec3, sub, to_f32};
use landscape::ground;

use crate::{Camera, Light, Mesh, MeshId, Scene};

/// Generates the built-in scene: one camera, a sun, a constant sky, Lambertian materials, no textures.
///
/// Every call gives the same bits on one platform. Across platforms the last bit of a vertex may differ, by the sine function.
#[must_use]
pub fn builtin() -> Scene {
    let mut builder = build::SceneBuilder::default();
    landscape::place(&mut builder);
    place_bridge(&mut builder);
    let crane = builder.mesh(crane());
    place_site(&mut builder, crane);
    landscape::place_river(&mut builder, crane);

    let mut scene = builder.scene;
    scene.materials = build::Paint::materials();
    scene.lights =
        vec![Light::Sun { direction: to_f32(build::unit([0.78, -0.40, 0.48])), irradiance: [4.6, 3.45, 2.2] }];
    scene.environment = Some([0.36, 0.50, 0.72].into());
    scene.cameras = vec![Camera::pinhole([-300.0, 40.0, 250.0], [30.0, 48.0, 0.0], [0.0, 1.0, 0.0], 42.0)];
    scene.camera_names = vec![String::new()];
    scene
}

/// Height of the road above the water.
const DECK_HEIGHT: f64 = 34.0;
/// Half the length of the girder.
const HALF_LENGTH: f64 = 330.0;
/// Length of one panel of the girder.
const PANEL: f64 = 10.0;
/// Half the width of the girder and its height.
const GIRDER: [f64; 2] = [8.0, 5.5];
/// Foot and head of the pylon leg at positive x and z; the other three mirror it.
const LEG: [Vec3; 2] = [[112.0, -4.0, 19.0], [144.0, 138.0, 2.6]];

/// Adds the bridge.
fn place_bridge(builder: &mut SceneBuilder) {
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

/// Height of a crane's jib.
const JIB_HEIGHT: f64 = 52.0;

/// Adds everything on the banks; `crane` is also used elsewhere.
fn place_site(builder: &mut SceneBuilder, crane: MeshId) {
    for (x, z, heading_rad, size) in
        [(262.0, 78.0, 2.5, 1.0), (318.0, 128.0, 0.6, 1.2), (300.0, -70.0, 3.9, 1.1), (-205.0, -75.0, 0.5, 1.0)]
    {
        builder.place(crane, upright(on_ground(x, z), heading_rad, [size; 3]));
    }
    let mast = builder.mesh(mast());
    for (x, z, size) in [(-226.0, 112.0, 0.8), (420.0, -160.0, 1.3), (560.0, 60.0, 1.5)] {
        builder.place(mast, upright(on_ground(x, z), 0.4, [size; 3]));
    }
    let shell = builder.mesh(shell());
    let scaffold = builder.mesh(scaffold());
    for (x, z, heading_rad) in
        [(-216.0, 172.0, 1.05), (238.0, 58.0, 0.35), (282.0, 100.0, 0.1), (240.0, 120.0, 0.6), (270.0, -52.0, -0.2)]
    {
        builder.place(shell, upright(on_ground(x, z), heading_rad, [1.0; 3]));
        for (along, across, turn_rad) in
            [(0.0, 9.4, 0.0), (0.0, -9.4, 0.0), (-9.4, 0.0, FRAC_PI_2), (9.4, 0.0, FRAC_PI_2)]
        {
            let (sin, cos) = f64::sin_cos(heading_rad);
            let position = on_ground(x + cos * along + sin * across, z - sin * along + cos * across);
            let upward = [-0.004 * along, 1.0, 0.003 * across];
            builder.place(scaffold, tilted(position, upward, heading_rad + turn_rad, [1.0; 3]));
        }
    }
    for (x, z, upward, heading_rad) in [(-204.0, 108.0, [0.10, 1.0, 0.06], 0.7), (-196.0, 74.0, [-0.08, 1.0, 0.1], 0.2)]
    {
        builder.place(scaffold, tilted(on_ground(x, z), upward, heading_rad, [1.0; 3]));
    }
}

fn on_ground(x: f64, z: f64) -> Vec3 {
    [x, ground(x, z) - 0.6, z]
}

/// A tower crane with its jib along x.
fn crane() -> Mesh {
    const TOP: f64 = JIB_HEIGHT;
    const JIB: f64 = 46.0;
    let mut mesh = MeshBuilder::default();
    mesh.block(Paint::Concrete, [-3.0, -1.0, -3.0], [3.0, 1.2, 3.0]);
    mesh.lattice(&square_rings([1.1, 1.1], TOP, 22), [0.28, 0.14], |_| Paint::Yellow);
    mesh.lattice(&jib(1.0, JIB, 22), [0.22, 0.11], |_| Paint::Yellow);
    mesh.lattice(&jib(-1.0, 16.0, 8), [0.22, 0.11], |_| Paint::Yellow);
    mesh.block(Paint::Concrete, [-16.5, TOP - 2.6, -1.3], [-12.5, TOP + 0.6, 1.3]);
    mesh.block(Paint::White, [1.2, TOP - 2.4, 1.2], [3.2, TOP, 3.0]);
    let apex = [0.0, TOP + 9.0, 0.0];
    for [x, z] in [[-1.1, -1.1], [1.1, -1.1], [1.1, 1.1], [-1.1, 1.1]] {
        mesh.bar(Paint::Yellow, [x, TOP, z], apex, 0.22);
    }
    for x in [-15.0, 0.45 * JIB, 0.85 * JIB] {
        mesh.cable(Paint::Cable, apex, [x, TOP + 1.8, 0.0], 0.16);
    }
    let trolley = 0.62 * JIB;
    mesh.cable(Paint::Cable, [trolley, TOP, 0.0], [trolley, TOP - 24.0, 0.0], 0.14);
    mesh.block(Paint::Red, [trolley - 0.7, TOP - 26.0, -0.7], [trolley + 0.7, TOP - 24.0, 0.7]);
    mesh.finish("tower crane")
}

/// Triangular rings of a jib from the crane's top, in the direction `sign` along x.
fn jib(sign: f64, length: f64, n_bays: u32) -> Vec<[Vec3; 3]> {
    let ring = |i: u32| {
        let x = sign * (1.1 + (length - 1.1) * f64::from(i) / f64::from(n_bays));
        [[x, JIB_HEIGHT, -0.9], [x, JIB_HEIGHT, 0.9], [x, JIB_HEIGHT + 1.8, 0.0]]
    };
    (0..=n_bays).map(ring).collect()
}

/// A guyed radio mast with three legs, 78 m high, with red and white bands.
fn mast() -> Mesh {
    const HEIGHT: f64 = 78.0;
    let n_bays = 40;
    let corner = |k: u32, radius: f64, y: f64| {
        let (sin, cos) = (TAU * f64::from(k) / 3.0).sin_cos();
        [radius * cos, y, radius * sin]
    };
    let ring = |i: u32| [0, 1, 2].map(|k| corner(k, 1.1, HEIGHT * f64::from(i) / f64::from(n_bays)));
    let rings: Vec<_> = (0..=n_bays).map(ring).collect();
    let mut mesh = MeshBuilder::default();
    mesh.lattice(&rings, [0.3, 0.16], |bay| if bay / 5 % 2 == 0 { Paint::Red } else { Paint::White });
    mesh.cable(Paint::White, [0.0, HEIGHT, 0.0], [0.0, HEIGHT + 9.0, 0.0], 0.3);
    for k in 0..3 {
        for (height, reach) in [(0.42, 26.0), (0.72, 40.0), (0.98, 40.0)] {
            mesh.cable(Paint::Cable, corner(k, 1.1, HEIGHT * height), corner(k, reach, -3.0), 0.13);
        }
    }
    mesh.finish("radio mast")
}

/// A scaffold of tubes with planks: 6 bays along x, one deep, 9 levels.
fn scaffold() -> Mesh {
    const BAY: f64 = 2.6;
    const DEPTH: f64 = 1.3;
    const LEVEL: f64 = 2.3;
    let (n_bays, n_levels) = (6, 9);
    let point = |bay: i32, level: i32, side: f64| {
        [BAY * (f64::from(bay) - 0.5 * f64::from(n_bays)), LEVEL * f64::from(level), side * DEPTH]
    };
    let mut mesh = MeshBuilder::default();
    let mut tube = |from: Vec3, to: Vec3| mesh.bar(Paint::Zinc, from, to, 0.13);
    for side in [-0.5, 0.5] {
        for bay in 0..=n_bays {
            tube(point(bay, -1, side), lerp(point(bay, n_levels, side), point(bay, n_levels + 1, side), 0.5));
        }
        for level in 1..=n_levels {
            tube(point(0, level, side), point(n_bays, level, side));
            for bay in 0..n_bays {
                let [from, to] = if (bay + level) % 2 == 0 { [bay, bay + 1] } else { [bay + 1, bay] };
                tube(point(from, level - 1, side), point(to, level, side));
            }
        }
    }
    for level in 1..=n_levels {
        for bay in 0..=n_bays {
            tube(point(bay, level, -0.5), point(bay, level, 0.5));
        }
    }
    for level in 1..=n_levels {
        let [min, max] = [point(0, level, -0.45), point(n_bays, level, 0.45)];
        mesh.block(Paint::Wood, [min[0], min[1] + 0.08, min[2]], [max[0], max[1] + 0.16, max[2]]);
    }
    mesh.finish("scaffold")
}

/// The concrete shell of a building: six slabs with 16 columns each and a core.
fn shell() -> Mesh {
    const HALF: f64 = 8.0;
    const FLOOR: f64 = 3.5;
    let mut mesh = MeshBuilder::default();
    for floor in 0..=5 {
        let y = FLOOR * f64::from(floor);
        mesh.block(Paint::Concrete, [-HALF, y, -HALF], [HALF, y + 0.35, HALF]);
    }
    for floor in 0..5 {
        let [foot, head] = [0.35, FLOOR].map(|y| y + FLOOR * f64::from(floor));
        for column in 0..16 {
            let [x, z] = [column % 4, column / 4].map(|k| (HALF - 0.5) * (f64::from(k) / 1.5 - 1.0));
            mesh.block(Paint::Concrete, [x - 0.25, foot, z - 0.25], [x + 0.25, head, z + 0.25]);
        }
    }
    mesh.block(Paint::Concrete, [-2.0, 0.0, -2.5], [2.0, 24.0, 2.5]);
    mesh.finish("shell")
}

#[cfg(test)]
mod tests {
    //! The built-in scene is valid, within its triangle budget, and fills the image.

    use canted_obb::vector::{Vector as Vec3, cross, dot, length, sub};

    use super::{
        build::{MeshBuilder, Paint, unit},
        builtin,
        landscape::ground,
    };
    use crate::flaw::{flaw, is_numbered};
    use crate::{Light, Mesh, Scene};

    /// Unit roundoff of `f32`.
    const U: f64 = 0.5 * f32::EPSILON as f64;

    fn corners(mesh: &Mesh, triangle: usize) -> [Vec3; 3] {
        mesh.triangles[triangle].map(|index| mesh.positions[index as usize].map(f64::from))
    }

    /// Number of triangles with their centroid in a 16:9 image of the first camera.
    fn n_in_view(scene: &Scene) -> usize {
        let camera = scene.cameras[0];
        let crate::Projection::Perspective { fov_degrees } = camera.projection else {
            panic!("{:?}", camera.projection)
        };
        let eye = camera.eye.map(f64::from);
        let forward = unit(sub(camera.target.map(f64::from), eye));
        let right = unit(cross(forward, camera.up.map(f64::from)));
        let up = cross(right, forward);
        let half_height = (0.5 * f64::from(fov_degrees)).to_radians().tan();
        let in_view = |centroid: Vec3| {
            let from_eye = sub(centroid, eye);
            let depth = dot(from_eye, forward);
            let [across, height] = [right, up].map(|axis| dot(from_eye, axis).abs() / depth);
            depth > 0.0 && height < half_height && across < half_height * 16.0 / 9.0
        };
        let of_instance = |instance: &crate::Instance| {
            let mesh = &scene.meshes[instance.mesh.0 as usize];
            let centroid = |triangle: usize| {
                let [a, b, c] = corners(mesh, triangle);
                let mean = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
                instance.world_from_object.point_f64(mean)
            };
            (0..mesh.triangles.len()).filter(|&triangle| in_view(centroid(triangle))).count()
        };
        scene.instances.iter().map(of_instance).sum()
    }

    #[test]
    fn scene_is_valid() {
        let scene = builtin();
        assert_eq!(flaw(&scene), None);
        assert!(is_numbered(&scene));
        let [Light::Sun { direction, .. }] = scene.lights[..] else { panic!("one sun: {:?}", scene.lights) };
        assert!((length(direction.map(f64::from)) - 1.0).abs() <= 2.0 * U && direction[1] < 0.0);
    }

    #[test]
    fn triangle_counts_are_within_budget() {
        let scene = builtin();
        assert!(scene.n_unique_triangles() <= 60_000, "{}", scene.n_unique_triangles());
        assert!(scene.n_placed_triangles() >= 300_000, "{}", scene.n_placed_triangles());
        assert!(n_in_view(&scene) >= 100_000, "{}", n_in_view(&scene));
        let [x, y, z] = scene.cameras[0].eye.map(f64::from);
        assert!(y > ground(x, z) + 2.0, "camera above ground");
    }

    #[test]
    fn generation_is_deterministic() {
        let [first, second] = [builtin(), builtin()];
        assert_eq!(first.instances, second.instances);
        for (a, b) in first.meshes.iter().zip(&second.meshes) {
            assert_eq!((&a.positions, &a.triangles, &a.parts), (&b.positions, &b.triangles, &b.parts), "{}", a.name);
        }
    }

    #[test]
    fn triangles_are_not_degenerate() {
        for mesh in &builtin().meshes {
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = corners(mesh, triangle);
                assert!(length(cross(sub(b, a), sub(c, a))) > 0.0, "{} {triangle}", mesh.name);
            }
        }
    }

    #[test]
    fn water_covers_the_visible_river() {
        let scene = builtin();
        let is_water = |i: usize| scene.meshes[i].name == "water";
        let tiles: Vec<[f32; 3]> = scene
            .instances
            .iter()
            .filter(|instance| is_water(instance.mesh.0 as usize))
            .map(|instance| instance.world_from_object.columns[3])
            .collect();
        let under_water = |x: f64, z: f64| {
            tiles.iter().any(|tile| {
                (0.0..=160.0).contains(&(x - f64::from(tile[0]))) && (0.0..=160.0).contains(&(f64::from(tile[2]) - z))
            })
        };
        for x in (-480..1700).step_by(10).map(f64::from) {
            for z in (-1900..480).step_by(10).map(f64::from) {
                assert!(ground(x, z) >= 0.0 || under_water(x, z), "dry at ({x}, {z})");
            }
        }
    }

    #[test]
    fn normals_point_outward() {
        let mut block = MeshBuilder::default();
        block.block(Paint::Wood, [1.0, 2.0, 3.0], [2.0, 5.0, 7.0]);
        let mesh = block.finish("block");
        let cone = |i: usize| {
            let [a, b, c] = corners(&mesh, i);
            dot(a, cross(b, c)) / 6.0
        };
        assert_eq!((0..12).map(cone).sum::<f64>(), 12.0);

        for (axis, widths) in
            [([0.0, 3.0, 0.0], [2.0, 1.0]), ([0.0, -3.0, 0.0], [2.0, 0.0]), ([1.0, 2.0, -1.0], [1.0, 1.0])]
        {
            let mut frustum = MeshBuilder::default();
            frustum.frustum(Paint::Wood, [[0.0; 3], axis], widths, 5);
            let mesh = frustum.finish("frustum");
            for i in 0..mesh.triangles.len() {
                let [a, b, c] = corners(&mesh, i);
                let normal = cross(sub(b, a), sub(c, a));
                // Relative to the axis, the centroid lies on the side of the normal.
                let centroid: Vec3 = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
                let foot = axis.map(|x| x * dot(centroid, axis) / dot(axis, axis));
                assert!(dot(normal, sub(centroid, foot)) > 0.0, "{axis:?} {i}");
            }
        }
    }

    #[test]
    fn terrain_and_water_face_up() {
        for mesh in builtin().meshes.iter().filter(|mesh| ["terrain", "water"].contains(&mesh.name.as_str())) {
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = corners(mesh, triangle);
                assert!(cross(sub(b, a), sub(c, a))[1] > 0.0, "{} {triangle}", mesh.name);
            }
        }
    }
}
