//! Pictures compared with references by an independent renderer, Mitsuba 3.
//!
//! `tests/oracle/README.md` describes how the references were made. Only flat triangles are compared, because renderers treat
//! shading normals differently where they disagree with the triangle; textures use bilinear lookups at full size in both. Missing
//! models are skipped with a message. Not covered here: noise of few samples, and materials that only one renderer has.

use super::agree::{Disagreement, agree};
use super::shots::{
    BLUE, Shot, checker, cornell_env, cornell_lamp, cornell_paths, cornell_point, cornell_sun, kitchen_ball,
    kitchen_sky, kitchen_sun, lens, penumbra, sponza_ball, sponza_blue_sky, sponza_image_sky, sponza_sun,
    sponza_sun_paths, spot,
};

fn check(shot: Option<Shot>) {
    let Some(shot) = shot else { return };
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert_eq!(verdict, Ok(()), "{}", shot.name);
}

#[test]
fn sky_in_the_cornell_box() {
    check(cornell_env("sky_in_the_cornell_box"));
}

#[test]
fn sky_in_the_cornell_box_after_bounces() {
    for (name, n_segments) in [("cornell-env-3", 3), ("cornell-env-4", 4)] {
        check(cornell_env("sky_in_the_cornell_box_after_bounces").map(|shot| Shot {
            name,
            n_segments: Some(n_segments),
            ..shot
        }));
    }
}

#[test]
fn sun_in_the_cornell_box() {
    check(cornell_sun("sun_in_the_cornell_box"));
}

#[test]
fn lamp_in_the_cornell_box() {
    check(cornell_point("lamp_in_the_cornell_box"));
}

#[test]
fn a_sphere_light_and_its_penumbra() {
    check(Some(penumbra()));
}

#[test]
fn a_spot_on_a_floor() {
    check(Some(spot()));
}

/// A sphere light that is two per cent larger.
#[test]
fn a_larger_sphere_light_is_detected() {
    let mut shot = penumbra();
    for light in &mut shot.scene.lights {
        if let canted_scene::Light::Sphere { radius, .. } = light {
            *radius *= 1.02;
        }
    }
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert!(matches!(verdict, Err(Disagreement::Mean { ratio, .. }) if ratio > 1.01), "{verdict:?}");
}

#[test]
fn bilinear_texels_of_a_wall() {
    check(Some(checker()));
}

/// A texture upside down.
#[test]
fn a_texture_upside_down_is_detected() {
    let mut shot = checker();
    for [_, v] in shot.scene.meshes[0].uvs.iter_mut().flatten() {
        *v = 1.0 - *v;
    }
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert!(matches!(verdict, Err(Disagreement::Block { .. })), "{verdict:?}");
}

#[test]
fn sun_over_sponza() {
    check(sponza_sun("sun_over_sponza"));
}

#[test]
fn paths_in_the_cornell_box() {
    for shot in cornell_paths("paths_in_the_cornell_box").into_iter().flatten() {
        check(Some(shot));
    }
}

#[test]
fn the_box_lit_by_its_own_lamp() {
    check(cornell_lamp("the_box_lit_by_its_own_lamp"));
}

#[test]
fn paths_in_sponza_by_the_sun() {
    check(sponza_sun_paths("paths_in_sponza_by_the_sun"));
}

#[test]
fn paths_in_sponza_by_a_sphere_light() {
    check(sponza_ball("paths_in_sponza_by_a_sphere_light"));
}

#[test]
fn paths_in_sponza_under_a_blue_sky() {
    check(sponza_blue_sky("paths_in_sponza_under_a_blue_sky"));
}

#[test]
fn paths_in_sponza_under_an_image_of_the_sky() {
    check(sponza_image_sky("paths_in_sponza_under_an_image_of_the_sky"));
}

#[test]
fn glass_and_metal_in_the_kitchen_under_its_sky() {
    check(kitchen_sky("glass_and_metal_in_the_kitchen_under_its_sky"));
}

#[test]
fn glass_and_metal_in_the_kitchen_by_a_sphere_light() {
    check(kitchen_ball("glass_and_metal_in_the_kitchen_by_a_sphere_light"));
}

#[test]
fn the_sun_on_the_floor_of_the_kitchen() {
    check(kitchen_sun("the_sun_on_the_floor_of_the_kitchen"));
}

#[test]
fn a_lens_blurs_the_floor() {
    check(Some(lens()));
}

/// A lens that is a tenth wider.
#[test]
fn a_wider_lens_is_detected() {
    let mut shot = lens();
    shot.camera.lens = shot.camera.lens.map(|lens| canted_scene::Lens { radius: 1.1 * lens.radius, ..lens });
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert!(matches!(verdict, Err(Disagreement::Block { .. })), "{verdict:?}");
}

/// Paths with one bounce less lack light.
#[test]
fn paths_cut_short_are_detected() {
    let Some([sky, ..]) = cornell_paths("paths_cut_short_are_detected") else { return };
    let short = Shot { n_segments: Some(5), ..sky };
    let verdict = agree(&short.ours(), &short.theirs());
    assert!(verdict.is_err(), "{verdict:?}");
}

/// Two per cent more light from the environment.
#[test]
fn a_brighter_sky_is_detected() {
    let Some(mut shot) = cornell_env("a_brighter_sky_is_detected") else { return };
    shot.scene.environment = Some(BLUE.map(|x| 1.02 * x).into());
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert!(matches!(verdict, Err(Disagreement::Mean { ratio, .. }) if ratio > 1.01), "{verdict:?}");
}

/// Boxes that are four per cent darker.
#[test]
fn a_wrong_albedo_is_detected() {
    let Some(mut shot) = cornell_env("a_wrong_albedo_is_detected") else { return };
    for material in shot.scene.materials.iter_mut().filter(|material| material.name == "Khaki") {
        material.base_color = material.base_color.map(|x| 0.96 * x);
    }
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert!(verdict.is_err(), "{verdict:?}");
}

/// Swapping two blocks keeps the mean.
#[test]
fn another_picture_is_detected() {
    let Some(shot) = cornell_env("another_picture_is_detected") else { return };
    let mut ours = shot.ours();
    ours.swap(5, 6);
    let verdict = agree(&ours, &shot.theirs());
    assert!(matches!(verdict, Err(Disagreement::Block { block: 5, .. })), "{verdict:?}");
}

/// A picture that is too noisy proves nothing and is rejected.
#[test]
fn a_noisy_picture_is_rejected() {
    let Some(mut shot) = cornell_env("a_noisy_picture_is_rejected") else { return };
    shot.samples = 2;
    let verdict = agree(&shot.ours(), &shot.theirs());
    assert!(matches!(verdict, Err(Disagreement::Noise { .. })), "{verdict:?}");
}
