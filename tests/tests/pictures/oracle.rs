//! Pictures compared with references by an independent renderer, Mitsuba 3.
//!
//! `tests/oracle/README.md` describes how the references were made. Only flat triangles are compared, because renderers treat
//! shading normals differently where they disagree with the triangle; textures use bilinear lookups at full size in both. Missing
//! models are skipped with a message. Not covered here: noise of few samples, and materials that only one renderer has.

use canted_film::{Film, Picture};

use crate::scenes::{
    BLUE, OraclePicture, checker, cornell_env, cornell_lamp, cornell_paths, cornell_point, cornell_sun, curves,
    kitchen_ball, kitchen_sky, kitchen_sun, lens, penumbra, sponza_ball, sponza_blue_sky, sponza_image_sky, sponza_sun,
    sponza_sun_paths, spot,
};

fn check(picture: Option<OraclePicture>) {
    let Some(picture) = picture else { return };
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert_eq!(verdict, Ok(()), "{}", picture.name);
}

#[test]
fn sky_in_the_cornell_box() {
    check(cornell_env("sky_in_the_cornell_box"));
}

#[test]
fn sky_in_the_cornell_box_after_bounces() {
    for (name, n_segments) in [("cornell-env-3", 3), ("cornell-env-4", 4)] {
        check(cornell_env("sky_in_the_cornell_box_after_bounces").map(|picture| OraclePicture {
            name,
            n_segments: Some(n_segments),
            ..picture
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

#[test]
fn curves_in_the_sun() {
    check(Some(curves(false)));
    check(Some(curves(true)));
}

/// Strands that are a tenth thicker.
#[test]
fn thicker_strands_are_detected() {
    let mut picture = curves(true);
    let curves = picture.scene.meshes.iter_mut().filter_map(|mesh| mesh.curves.as_mut());
    curves.flat_map(|curves| &mut curves.radii).for_each(|radius| *radius *= 1.1);
    assert!(agree(&picture.ours(), &picture.theirs()).is_err());
}

/// A sphere light that is two per cent larger.
#[test]
fn a_larger_sphere_light_is_detected() {
    let mut picture = penumbra();
    for light in &mut picture.scene.lights {
        if let canted_scene::Light::Sphere { radius, .. } = light {
            *radius *= 1.02;
        }
    }
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert!(matches!(verdict, Err(Disagreement::Mean { ratio, .. }) if ratio > 1.01), "{verdict:?}");
}

#[test]
fn bilinear_texels_of_a_wall() {
    check(Some(checker()));
}

/// A texture upside down.
#[test]
fn a_texture_upside_down_is_detected() {
    let mut picture = checker();
    for [_, v] in picture.scene.meshes[0].uvs.iter_mut().flatten() {
        *v = 1.0 - *v;
    }
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert!(matches!(verdict, Err(Disagreement::Block { .. })), "{verdict:?}");
}

#[test]
fn sun_over_sponza() {
    check(sponza_sun("sun_over_sponza"));
}

#[test]
fn paths_in_the_cornell_box() {
    for picture in cornell_paths("paths_in_the_cornell_box").into_iter().flatten() {
        check(Some(picture));
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
    let mut picture = lens();
    picture.camera.lens = picture.camera.lens.map(|lens| canted_scene::Lens { radius: 1.1 * lens.radius, ..lens });
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert!(matches!(verdict, Err(Disagreement::Block { .. })), "{verdict:?}");
}

/// Paths with one bounce less lack light.
#[test]
fn paths_cut_short_are_detected() {
    let Some([sky, ..]) = cornell_paths("paths_cut_short_are_detected") else { return };
    let short = OraclePicture { n_segments: Some(5), ..sky };
    let verdict = agree(&short.ours(), &short.theirs());
    assert!(verdict.is_err(), "{verdict:?}");
}

/// Two per cent more light from the environment.
#[test]
fn a_brighter_sky_is_detected() {
    let Some(mut picture) = cornell_env("a_brighter_sky_is_detected") else { return };
    picture.scene.environment = Some(BLUE.map(|x| 1.02 * x).into());
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert!(matches!(verdict, Err(Disagreement::Mean { ratio, .. }) if ratio > 1.01), "{verdict:?}");
}

/// Boxes that are four per cent darker.
#[test]
fn a_wrong_albedo_is_detected() {
    let Some(mut picture) = cornell_env("a_wrong_albedo_is_detected") else { return };
    for material in picture.scene.materials.iter_mut().filter(|material| material.name == "Khaki") {
        material.base_color = material.base_color.map(|x| 0.96 * x);
    }
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert!(verdict.is_err(), "{verdict:?}");
}

/// Swapping two blocks keeps the mean.
#[test]
fn another_picture_is_detected() {
    let Some(picture) = cornell_env("another_picture_is_detected") else { return };
    let mut ours = picture.ours();
    ours.swap(5, 6);
    let verdict = agree(&ours, &picture.theirs());
    assert!(matches!(verdict, Err(Disagreement::Block { block: 5, .. })), "{verdict:?}");
}

/// A picture that is too noisy proves nothing and is rejected.
#[test]
fn a_noisy_picture_is_rejected() {
    let Some(mut picture) = cornell_env("a_noisy_picture_is_rejected") else { return };
    picture.samples = 2;
    let verdict = agree(&picture.ours(), &picture.theirs());
    assert!(matches!(verdict, Err(Disagreement::Noise { .. })), "{verdict:?}");
}

/// Side of a block in pixels.
pub(crate) const BLOCK: u32 = 16;

/// Greatest relative difference of the mean from that of the reference.
const MEAN: f64 = 0.005;

/// Probability that noise alone makes two equal pictures disagree.
const FALSE_ALARM: f64 = 1e-3;

/// Relative rounding error of the references, which have half precision: 11 bits.
const HALF: f64 = 1.0 / 2048.0;

/// Means of red, green and blue in a block of pixels, and their standard errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) mean: [f64; 3],
    pub(crate) error: [f64; 3],
    /// Number of pixels in the block.
    pub(crate) area: f64,
}

/// The blocks of a film with independent samples.
pub(crate) fn blocks_of_film(film: &Film) -> Vec<Block> {
    let pixel = |i: usize| (film.pixels()[i].mean(), film.pixels()[i].variance_of_mean());
    blocks(film.width(), film.height(), pixel)
}

/// The blocks of a reference, with an error for each block.
pub(crate) fn blocks_of_reference(mean: &Picture, errors: &[[f64; 3]]) -> Vec<Block> {
    let mut blocks = blocks(mean.width, mean.height, |i| (mean.pixels[i].map(f64::from), [0.0; 3]));
    assert_eq!(blocks.len(), errors.len(), "one error per block");
    blocks.iter_mut().zip(errors).for_each(|(block, error)| block.error = *error);
    blocks
}

/// Blocks from the mean and the variance of the mean of each pixel, row by row.
fn blocks(width: u32, height: u32, pixel: impl Fn(usize) -> ([f64; 3], [f64; 3])) -> Vec<Block> {
    let corners =
        (0..height).step_by(BLOCK as usize).flat_map(|y| (0..width).step_by(BLOCK as usize).map(move |x| (x, y)));
    let block = |(left, top): (u32, u32)| {
        let (right, bottom) = ((left + BLOCK).min(width), (top + BLOCK).min(height));
        let area = f64::from(right - left) * f64::from(bottom - top);
        let (mut mean, mut variance) = ([0.0; 3], [0.0; 3]);
        for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
            let (of_mean, of_variance) = pixel(y as usize * width as usize + x as usize);
            for k in 0..3 {
                mean[k] += of_mean[k] / area;
                variance[k] += of_variance[k] / (area * area);
            }
        }
        Block { mean, error: variance.map(f64::sqrt), area }
    };
    corners.map(block).collect()
}

/// Why two pictures disagree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Disagreement {
    /// The noise is too high to compare the means.
    Noise { channel: usize, relative_error: f64 },
    /// The mean radiance differs.
    Mean { channel: usize, ratio: f64 },
    /// The mean of a block differs by more than the noise of both explains.
    Block { block: usize, channel: usize, ours: f64, theirs: f64, bound: f64 },
}

/// Compares the means of the pictures, and of each block.
///
/// The means agree within [`MEAN`]; three standard errors of both must be less, or the comparison could not fail. Blocks agree
/// within `q·√(a² + b²)`, where `a` and `b` are their standard errors, plus the rounding of the reference. With `n`
/// comparisons `q = √(2·ln(n/p))`: a normal deviate exceeds `q` with a probability of at most `exp(-q²/2)`, both tails
/// together, so one of `n` does with at most `p`, [`FALSE_ALARM`].
pub(crate) fn agree(ours: &[Block], theirs: &[Block]) -> Result<(), Disagreement> {
    assert_eq!(ours.len(), theirs.len(), "pictures of equal size");
    for channel in 0..3 {
        agree_in_mean(channel, ours, theirs)?;
    }
    let quantile = (2.0 * (3.0 * ours.len() as f64 / FALSE_ALARM).ln()).sqrt();
    for (block, (a, b)) in ours.iter().zip(theirs).enumerate() {
        for channel in 0..3 {
            let [ours, theirs] = [a, b].map(|block| block.mean[channel]);
            let bound = quantile * a.error[channel].hypot(b.error[channel]) + HALF * theirs;
            if !is_within(ours - theirs, bound) {
                return Err(Disagreement::Block { block, channel, ours, theirs, bound });
            }
        }
    }
    Ok(())
}

fn agree_in_mean(channel: usize, ours: &[Block], theirs: &[Block]) -> Result<(), Disagreement> {
    let sum = |blocks: &[Block]| blocks.iter().map(|block| block.area * block.mean[channel]).sum::<f64>();
    let square = |blocks: &[Block]| blocks.iter().map(|block| (block.area * block.error[channel]).powi(2)).sum::<f64>();
    let relative_error = (square(ours) + square(theirs)).sqrt() / sum(theirs);
    let ratio = sum(ours) / sum(theirs);
    if !is_within(3.0 * relative_error, MEAN) {
        return Err(Disagreement::Noise { channel, relative_error });
    }
    if !is_within(ratio - 1.0, MEAN) {
        return Err(Disagreement::Mean { channel, ratio });
    }
    Ok(())
}

/// Whether a difference is at most a bound; false if either is NaN.
fn is_within(difference: f64, bound: f64) -> bool {
    difference.abs() <= bound
}
