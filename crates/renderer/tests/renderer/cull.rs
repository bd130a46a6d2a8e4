//! Back faces of single-sided materials: outlines as inverted hulls, rooms seen from outside, solids as without culling.

use canted_film::Film;
use canted_obb::Affine;
use canted_renderer::{Cull, HitFilter, Integrator, Levels, Settings, Surfaces, View};
use canted_scene::{Camera, Light, Material, Projection, Scene};
use canted_trace::Intersect;

use crate::common::{
    camera, cuboid, film_of, floor, gray, inside_out, place, prepared, scene, settings, sphere, under,
};

const IDENTITY: [[f32; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];

fn single_sided(material: Material) -> Material {
    Material { double_sided: false, ..material }
}

/// Without and with a mirror.
fn poses() -> [Affine; 2] {
    let mut mirror = IDENTITY;
    mirror[0][0] = -1.0;
    [Affine { columns: IDENTITY }, Affine { columns: mirror }]
}

/// Meshes that are symmetric in x, all in one pose. glTF winds the triangles of a mirroring node clockwise, so both poses look the same.
fn posed(mut scene: Scene, pose: Affine) -> Scene {
    for instance in &mut scene.instances {
        instance.world_from_object = pose;
    }
    scene
}

/// A white ball with a black, inverted hull a tenth larger, under a white sky.
fn outlined(hull: Material) -> Scene {
    let meshes = vec![sphere([0.0; 3], 1.0, 4, 0), inside_out(sphere([0.0; 3], 1.1, 4, 1))];
    under([1.0; 3], scene(meshes, vec![single_sided(gray(0.8)), hull]))
}

fn red(film: &Film, [x, y]: [u32; 2]) -> f64 {
    film.pixels()[(y * film.width() + x) as usize].mean()[0]
}

fn cameras() -> [Camera; 2] {
    let perspective = camera([0.0, 0.0, 8.0], [0.0; 3], 20.0);
    [perspective, Camera { projection: Projection::Orthographic { height: 2.8 }, ..perspective }]
}

/// The ball is as bright as without its hull, the rim is black, and the sky is white: at one level and two, mirrored or not, by both
/// integrators and both kinds of cameras. Without culling the hull hides the ball.
#[test]
fn an_inverted_hull_is_an_outline() {
    for (pose, levels) in poses().into_iter().flat_map(|pose| [Levels::One, Levels::Two].map(|levels| (pose, levels))) {
        let outlined = posed(outlined(single_sided(gray(0.0))), pose);
        let bvh = prepared(&outlined, levels);
        for (view, integrator) in cameras().into_iter().flat_map(|view| Integrator::ALL.map(|kind| (view, kind))) {
            let of = |cull, samples| {
                let settings = Settings { integrator, cull, ..settings(28, 28, samples, 4) };
                film_of(&outlined, &bvh, &view, &settings)
            };
            let what = format!("{pose:?} {levels:?} {integrator:?} {:?}", view.projection);
            let film = of(Cull::Auto, 64);
            // The ball reaches to 10 pixels from the center, its hull to 11.
            for (at, want) in [([14, 14], 0.8), ([20, 14], 0.8), ([14, 8], 0.8), ([0, 0], 1.0)] {
                assert!((red(&film, at) - want).abs() < 0.02, "{what} {at:?}: {}", red(&film, at));
            }
            assert!(red(&film, [24, 14]) < 0.4 && red(&film, [3, 14]) < 0.4, "{what}: no rim");
            assert_eq!(red(&of(Cull::Off, 4), [14, 14]), 0.0, "{what}");
        }
    }
}

/// What is single-sided in the file is so with `auto` only, all is with `back`, and glass never.
#[test]
fn materials_and_the_option_decide() {
    let glass = Material { transmission: 1.0, specular: 1.0, roughness: 0.0, ior: 1.0, ..gray(1.0) };
    for (hull, culled) in [
        (gray(0.0), [false, false, true]),
        (single_sided(gray(0.0)), [true, false, true]),
        (single_sided(glass.clone()), [false; 3]),
        (glass, [false; 3]),
    ] {
        let scene = outlined(hull);
        let bvh = prepared(&scene, Levels::Auto);
        let surfaces = Surfaces::new(&scene);
        let view = View::new(&camera([0.0, 0.0, 8.0], [0.0; 3], 20.0), 3, 3).unwrap();
        for (cull, culled) in Cull::ALL.into_iter().zip(culled) {
            let mut filter = HitFilter::new(&surfaces).culling(cull, &view);
            let hit = bvh.closest_hit_with(&view.ray([1.5, 1.5]), &mut filter).unwrap();
            assert_eq!(hit.instance.0 == 0, culled, "{cull:?} {:?}", scene.materials[1]);
        }
    }
}

/// A room whose walls face inwards is seen from outside, and lit through the walls that are not seen.
#[test]
fn a_room_is_seen_and_lit_from_outside() {
    let room = inside_out(cuboid([-2.0, 0.0, -2.0], [2.0, 2.0, 2.0], 0));
    let room = under([1.0; 3], scene(vec![room], vec![single_sided(gray(0.5))]));
    let bvh = prepared(&room, Levels::Auto);
    let outside = camera([5.0, 6.0, 7.0], [0.0, 0.5, 0.0], 20.0);
    for integrator in Integrator::ALL {
        let at_center = |view: &Camera, cull| {
            let settings = Settings { integrator, cull, ..settings(3, 3, 400, 16) };
            red(&film_of(&room, &bvh, view, &settings), [1, 1])
        };
        // The floor sees the sky through the roof and two walls, and two other walls that do the same.
        let lit = at_center(&outside, Cull::Auto);
        assert!((0.3..0.5).contains(&lit), "{integrator:?}: {lit}");
        // From inside, the walls are closed.
        let inside = camera([1.5, 1.5, 1.5], [0.0; 3], 20.0);
        assert_eq!(at_center(&inside, Cull::Auto), 0.0, "{integrator:?}");
    }
}

/// Closed solids look and shadow the same, bit for bit: a box on a slab, lit by a sun and a sky.
#[test]
fn closed_solids_do_not_change() {
    let meshes = vec![cuboid([-4.0, -0.5, -4.0], [4.0, 0.0, 4.0], 0), cuboid([-1.0, 0.125, -1.0], [1.0, 1.5, 0.5], 1)];
    let materials = vec![single_sided(gray(0.8)), single_sided(gray(0.5))];
    let mut stage = under([0.3, 0.4, 0.6], scene(meshes, materials));
    stage.lights = vec![Light::Sun { direction: [-0.6, -0.8, 0.3], irradiance: [2.0; 3] }];
    let bvh = prepared(&stage, Levels::Auto);
    let view = camera([3.0, 3.0, 4.0], [0.0, 0.5, 0.0], 50.0);
    for integrator in Integrator::ALL {
        let [auto, off] = [Cull::Auto, Cull::Off].map(|cull| {
            let settings = Settings { integrator, cull, ..settings(32, 32, 4, 8) };
            film_of(&stage, &bvh, &view, &settings).picture()
        });
        assert!(auto == off, "{integrator:?}");
    }
}

/// A floor with its front up lets no light through, and casts a shadow from either side.
#[test]
fn floors_block_light() {
    let mut stage = under([0.0; 3], scene(vec![floor(4.0, 0.0, 0), floor(1.0, 1.0, 0)], vec![single_sided(gray(0.8))]));
    let view = camera([4.0, 3.0, 0.0], [0.0; 3], 10.0);
    for (direction, is_lit) in [([0.0, -1.0, 0.0], false), ([0.0, 1.0, 0.0], false), ([-0.8, -0.6, 0.0], true)] {
        stage.lights = vec![Light::Sun { direction, irradiance: [2.0; 3] }];
        let bvh = prepared(&stage, Levels::Auto);
        let film = film_of(&stage, &bvh, &view, &settings(3, 3, 16, 0));
        assert_eq!(red(&film, [1, 1]) > 0.0, is_lit, "{direction:?}");
    }
}

/// Mirrors show what the camera would see in their place: not the back of a wall.
#[test]
fn mirrors_do_not_see_back_faces() {
    let mirror = Material { metallic: 1.0, roughness: 0.0, ..gray(1.0) };
    // Seen in the floor, from below and behind.
    let meshes = vec![floor(4.0, 0.0, 0), floor(4.0, 2.0, 1)];
    let stage = under([1.0; 3], scene(meshes, vec![mirror, single_sided(gray(0.25))]));
    let bvh = prepared(&stage, Levels::Auto);
    let view = camera([0.0, 1.0, 1.0], [0.0; 3], 5.0);
    for (cull, want) in [(Cull::Auto, 1.0..=1.0), (Cull::Off, 0.0..=0.5)] {
        let settings = Settings { integrator: Integrator::Path, cull, ..settings(1, 1, 64, 4) };
        let seen = red(&film_of(&stage, &bvh, &view, &settings), [0, 0]);
        assert!(want.contains(&seen), "{cull:?}: {seen}");
    }
}

/// The side of a hit is that in object space, however many levels there are and whether the instance mirrors.
#[test]
fn sides_of_hits_do_not_depend_on_levels() {
    for pose in poses() {
        let ball = Scene { instances: vec![place(0, pose)], ..outlined(gray(0.0)) };
        let ray = canted_trace::Ray::new([0.1, 0.2, 8.0], [0.0, 0.0, -1.0]);
        let sides = [Levels::One, Levels::Two].map(|levels| prepared(&ball, levels).closest_hit(&ray).unwrap().side);
        assert_eq!(sides[0], sides[1], "{pose:?}");
    }
}
