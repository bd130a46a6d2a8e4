use rayon::ThreadPoolBuilder;

use super::*;

const SIDE: u32 = 96;

/// A number in 0..1 for each pixel and key.
fn random(index: usize, key: u32) -> f32 {
    let mut x = u32::try_from(index).unwrap().wrapping_mul(0x9e37_79b9) ^ key.wrapping_mul(0x85eb_ca6b);
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    f32::from(u16::try_from((x ^ (x >> 16)) >> 16).unwrap()) / 65536.0
}

/// A picture whose pixels are given by column, row and index.
fn noisy(light: impl Fn(u32, u32, usize) -> Light, feature: impl Fn(u32, u32, usize) -> Feature) -> Noisy {
    let mut noisy = Noisy::new([SIDE; 2]);
    for index in 0..noisy.light.len() {
        let at = u32::try_from(index).unwrap();
        noisy.light[index] = light(at % SIDE, at / SIDE, index);
        noisy.features[index] = feature(at % SIDE, at / SIDE, index);
    }
    noisy
}

/// A wall that faces the camera.
fn wall(_: u32, _: u32, _: usize) -> Feature {
    Feature { normal: [0.0, 0.0, 1.0], depth: 3.0, albedo: [0.5; 3], is_present: true }
}

/// Noise around `mean` that is uniform between 0 and twice the mean: its variance is a third of the mean's square.
fn noise(mean: f32, index: usize) -> Light {
    Light { color: [2.0 * mean * random(index, 1); 3], variance: mean * mean / 3.0 }
}

fn rms(picture: &Picture, expected: impl Fn(usize) -> f32) -> f64 {
    let scale = wall(0, 0, 0).scale(0);
    let squares = picture.pixels.iter().enumerate().map(|(i, c)| f64::from(c[0] / scale - expected(i)).powi(2));
    (squares.sum::<f64>() / f64::from(SIDE * SIDE)).sqrt()
}

/// The error of noise on surfaces with these features; without a filter it is 0.577, the standard deviation.
fn error_on(feature: impl Fn(u32, u32, usize) -> Feature) -> f64 {
    rms(&denoise(noisy(|_, _, i| noise(1.0, i), feature), &Denoise::default()), |_| 1.0)
}

/// It falls to 0.23 of it.
#[test]
fn noise_on_a_wall_falls_to_a_quarter() {
    let error = error_on(wall);
    assert!(error < 0.577 / 4.0, "{error}");
}

/// Colors do not hold the filter back here, so that only the surfaces can.
fn by_surfaces_alone() -> Denoise {
    Denoise { color: 1e6, albedo: 0.1, ..Denoise::default() }
}

/// The error of a noisy picture that is dark on the left and bright on the right, with these features of both halves.
fn error_of_halves(left: Feature, right: Feature) -> f64 {
    let expected = |x: u32| if x < SIDE / 2 { 0.1 } else { 1.0 };
    let halves = noisy(|x, _, i| noise(expected(x), i), |x, _, _| if x < SIDE / 2 { left } else { right });
    rms(&denoise(halves, &by_surfaces_alone()), |i| expected(u32::try_from(i).unwrap() % SIDE))
}

#[test]
fn edges_of_geometry_stay() {
    let front = wall(0, 0, 0);
    let blurred = error_of_halves(front, front);
    assert!(blurred > 0.15, "without an edge the halves must blur: {blurred}");
    let normal = Feature { normal: [1.0, 0.0, 0.0], ..front };
    let depth = Feature { depth: 3.3, ..front };
    let albedo = Feature { albedo: [0.5, 0.0, 0.0], ..front };
    let miss = Feature { is_present: true, ..Feature::default() };
    for (what, other) in [("normal", normal), ("depth", depth), ("miss", miss)] {
        // The right half alone has noise of 0.577, the left of 0.0577.
        let scale = f64::from(front.scale(0) / other.scale(0));
        let kept = error_of_halves(other, front);
        assert!(kept < 0.08 || scale > 1.0 && kept < 0.1, "{what}: {kept}");
    }
    // The same albedo in the first channel, which `rms` reads.
    let kept = error_of_halves(albedo, front);
    assert!(kept < 0.08, "albedo: {kept}");
}

#[test]
fn an_inclined_wall_is_filtered_like_one_that_faces_the_camera() {
    let inclined = |x: u32, _: u32, _: usize| {
        #[expect(clippy::cast_precision_loss, reason = "a column")]
        let depth = 3.0 + 0.1 * x as f32;
        Feature { normal: [0.6, 0.0, 0.8], depth, ..wall(0, 0, 0) }
    };
    let [inclined, facing] = [error_on(inclined), error_on(wall)];
    assert!(inclined < 1.25 * facing, "{inclined}, {facing}");
}

/// A tap changes a channel by at most `√3 t / e` times the ratio of its weight and that of the center, where `t` is
/// a millionth of the pixel's brightest channel; all ratios sum to 55/9. A weighted mean of 25 values adds 27 roundings of
/// weights and sums, twice. Five levels give 4e-5.
#[test]
fn a_picture_without_noise_stays_within_the_bound() {
    let exact = |_, _, i: usize| Light { color: [0, 1, 2].map(|k| 2.0 * random(i, k)), variance: 0.0 };
    let before = noisy(exact, wall);
    let light = before.light.clone();
    let after = denoise(before.clone(), &Denoise::default());
    for (i, (color, light)) in after.pixels.iter().zip(&light).enumerate() {
        let brightest = light.color.into_iter().fold(0.0, f32::max);
        for (k, x) in color.iter().enumerate() {
            let change = (x / before.features[i].scale(k) - light.color[k]).abs();
            assert!(change <= 4e-5 * brightest, "pixel {i}: {change} of {brightest}");
        }
    }
    // With variance it changes.
    let mut uncertain = before.clone();
    uncertain.light.iter_mut().for_each(|light| light.variance = 0.1);
    assert!(denoise(uncertain, &Denoise::default()) != after);
}

#[test]
fn a_white_furnace_stays_white() {
    let albedo = |i: usize| [0, 1, 2].map(|k| random(i, 7 + k));
    let furnace = noisy(
        |_, _, _| Light { color: [1.0; 3], variance: 0.2 },
        |_, _, i| Feature { albedo: albedo(i), ..wall(0, 0, 0) },
    );
    let features = furnace.features.clone();
    for (color, feature) in denoise(furnace, &Denoise::default()).pixels.iter().zip(&features) {
        for (k, x) in color.iter().enumerate() {
            assert!((x / feature.scale(k) - 1.0).abs() < 1e-5, "{color:?}");
        }
    }
}

#[test]
fn one_sample_per_pixel_is_filtered_by_the_variance_of_neighbors() {
    let unknown = noisy(|_, _, i| Light { variance: -1.0, ..noise(1.0, i) }, wall);
    let error = rms(&denoise(unknown, &Denoise::default()), |_| 1.0);
    assert!(error < 0.577 / 4.0, "{error}");
}

#[test]
fn bad_values_stay_where_they_are() {
    let mut broken = noisy(|_, _, i| noise(1.0, i), wall);
    let at = |x: usize, y: usize| y * SIDE as usize + x;
    broken.features[at(10, 10)].normal = [f32::NAN; 3];
    broken.features[at(20, 10)].depth = f32::INFINITY;
    broken.features[at(30, 10)].is_present = false;
    broken.light[at(40, 10)] = Light { color: [f32::MAX; 3], variance: f32::INFINITY };
    broken.light[at(50, 10)].variance = f32::NAN;
    broken.light[at(60, 10)] = Light { color: [-1e30, 1e30, 0.0], variance: 1e38 };
    let picture = denoise(broken, &Denoise::default());
    for (i, color) in picture.pixels.iter().enumerate() {
        assert!(color.iter().all(|x| x.is_finite()), "pixel {i}: {color:?}");
    }
    assert_eq!(picture.pixels[at(30, 10)], [0.0; 3], "a pixel without samples is black");
    // Out of reach nothing changes.
    let first = at(0, 11 + REACH as usize);
    let without = denoise(noisy(|_, _, i| noise(1.0, i), wall), &Denoise::default());
    assert!(picture.pixels[..first] != without.pixels[..first]);
    assert_eq!(picture.pixels[first..], without.pixels[first..]);
}

#[test]
fn bits_do_not_depend_on_threads_or_on_pixels_out_of_reach() {
    let picture = |n: usize, noisy: &Noisy| {
        let pool = ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| denoise(noisy.clone(), &Denoise::default()))
    };
    let all = noisy(|_, _, i| noise(1.0, i), |_, _, i| Feature { depth: 3.0 + 0.01 * random(i, 3), ..wall(0, 0, 0) });
    let whole = picture(1, &all);
    for n in [2, 3, 7] {
        assert_eq!(picture(n, &all), whole, "{n} threads");
    }
    // The last columns are further than the reach from the first ones.
    let n_exact = SIDE - 1 - REACH;
    let cut = picture(2, &all.cropped([0, 0], [SIDE - 1, SIDE]));
    assert_eq!(cut.cropped([0, 0], [n_exact, SIDE]), whole.cropped([0, 0], [n_exact, SIDE]));
}
