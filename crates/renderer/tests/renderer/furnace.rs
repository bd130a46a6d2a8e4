//! Energy conservation of the hybrid integrator at every depth.

use canted_obb::Affine;
use canted_scene::Material;

use crate::common::{camera, cuboid, film, grey, inside_out, place, scene, settings, sphere};

/// All pixels of an image that is filled by a surface.
fn pixels(scene: &canted_scene::Scene, eye: [f32; 3], target: [f32; 3], fov: f32, bounces: u32) -> Vec<[f64; 3]> {
    let film = film(scene, &camera(eye, target, fov), &settings(12, 12, 6, bounces));
    assert_eq!(film.n_dropped(), 0);
    film.pixels().iter().map(canted_film::Pixel::mean).collect()
}

/// From a convex object every bounce escapes: each sample equals the albedo, at any depth.
#[test]
fn convex_object_in_a_white_furnace_shows_its_albedo() {
    for (object, name) in [(sphere([0.0; 3], 1.0, 3, 0), "sphere"), (cuboid([-1.0; 3], [1.0; 3], 0), "cube")] {
        let mut furnace = scene(vec![object], vec![grey(0.625)]);
        furnace.environment = Some([1.0; 3].into());
        for bounces in [0, 1, 3] {
            for pixel in pixels(&furnace, [2.0, 3.0, 4.0], [0.0; 3], 15.0, bounces) {
                assert_eq!(pixel, [0.625; 3], "{name}, {bounces} bounces");
            }
        }
    }
}

/// Inside a closed object that emits 1 and reflects `a`, depth `d` gives `1 + a + ... + a^d`; no sample may leak.
#[test]
fn closed_emitter_gives_the_geometric_series() {
    let glowing = Material { emission: [1.0; 3], ..grey(0.5) };
    for shell in [inside_out(sphere([0.0; 3], 1.0, 3, 0)), cuboid([-1.0; 3], [1.0, 2.0, 3.0], 0)] {
        // The environment would be visible through any leak.
        let mut room = scene(vec![shell], vec![glowing.clone()]);
        room.environment = Some([100.0; 3].into());
        for (bounces, expected) in [(0, 1.0), (1, 1.5), (2, 1.75), (5, 1.968_75)] {
            for pixel in pixels(&room, [0.1, 0.2, 0.3], [0.5, 0.1, -0.4], 100.0, bounces) {
                assert_eq!(pixel, [expected; 3], "{bounces} bounces");
            }
        }
    }
}

/// The ambient term never adds energy, for open and closed scenes and every radius.
#[test]
fn white_furnace_never_exceeds_one() {
    let bodies = vec![
        crate::common::floor(5.0, 0.0, 0),
        cuboid([-1.0, 0.0, -1.0], [0.0, 2.0, 0.0], 0),
        sphere([1.0, 0.5, 0.5], 0.5, 2, 0),
    ];
    let mut furnace = scene(bodies, vec![grey(1.0)]);
    furnace.environment = Some([1.0; 3].into());
    let view = camera([4.0, 3.0, 5.0], [0.0, 0.5, 0.0], 40.0);
    for bounces in 0..3 {
        let mut means = Vec::new();
        for radius in [0.01, 1.0, 100.0, f32::INFINITY] {
            let film = film(
                &furnace,
                &view,
                &canted_renderer::Settings { ao_radius: Some(radius), ..settings(24, 24, 4, bounces) },
            );
            for pixel in film.pixels() {
                assert!(pixel.mean().iter().all(|&x| (0.0..=1.0).contains(&x)), "radius {radius}: {:?}", pixel.mean());
            }
            means.push(film.pixels().iter().map(|pixel| pixel.mean()[0]).sum::<f64>() / 576.0);
        }
        // A smaller radius is brighter; with infinite radius, occluded light stays dark.
        assert!(means.windows(2).all(|pair| pair[0] > pair[1]) && means[3] < 0.99, "{means:?}");
    }
}

/// Shading normals that differ from the geometric normals lose no energy and let no ray into the object.
#[test]
fn smooth_normals_conserve_energy() {
    let mut object = sphere([0.0; 3], 1.0, 1, 0);
    object.normals = Some(object.positions.clone());
    let mut furnace = scene(vec![object], vec![grey(0.75)]);
    furnace.environment = Some([1.0; 3].into());
    for pixel in pixels(&furnace, [2.0, 3.0, 4.0], [0.0; 3], 10.0, 2) {
        assert_eq!(pixel, [0.75; 3]);
    }
}

/// Under a mirroring, shearing and stretching transform, a convex object is still convex and the result still exact.
#[test]
fn instances_conserve_energy() {
    let sheared = Affine { columns: [[-2.0, 0.3, 0.0], [0.5, 0.7, 0.2], [0.0, -0.4, 1.5], [10.0, 20.0, -30.0]] };
    assert!(sheared.determinant() < 0.0);
    let mut furnace = scene(vec![sphere([0.0; 3], 1.0, 3, 0)], vec![grey(0.625)]);
    furnace.instances = vec![place(0, sheared)];
    furnace.environment = Some([1.0; 3].into());
    for pixel in pixels(&furnace, [10.0, 24.0, -22.0], [10.0, 20.0, -30.0], 4.0, 2) {
        assert_eq!(pixel, [0.625; 3]);
    }
}
