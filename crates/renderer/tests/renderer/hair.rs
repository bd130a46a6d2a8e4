//! The BSDF of hair: a white furnace, densities, and pictures of it.

use canted_film::Pixel;
use canted_renderer::{Bsdf, Hair, Integrator, Levels, Settings};
use canted_scene::{CurveSegments, CurveShape, Curves, Hair as Source, Material, Mesh};

use super::common::{camera, film_of, mesh, prepared, scene, settings, under};

fn hair(absorption: [f32; 3], roughness: [f32; 2]) -> Bsdf {
    let [roughness, roughness_around] = roughness;
    let hair = Hair { absorption, roughness, roughness_around, tilt_rad: 0.035, ior: 1.55, direction: [1.0, 0.0] };
    Bsdf { hair: Some(hair), ..Bsdf::lambert([1.0; 3]) }
}

/// Directions above the surface, across and along the hair.
const OUTGOING: [[f32; 3]; 5] =
    [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.8, 0.6], [0.0, -0.98, 0.199], [-0.8, 0.48, 0.36]];

/// Integrals of value and density over the sphere, by the midpoint rule in elevation along the hair and azimuth around it.
fn integrals(bsdf: &Bsdf, outgoing: [f32; 3]) -> [f64; 2] {
    let (n, m) = (300_u16, 500_u16);
    let mut sums = [0.0; 2];
    for i in 0..n {
        let x = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
        for j in 0..m {
            let phi = (f64::from(j) + 0.5) / f64::from(m) * std::f64::consts::TAU;
            let across = (1.0 - x * x).sqrt();
            let found = bsdf.evaluate(outgoing, [x, across * phi.cos(), across * phi.sin()].map(|x| x as f32));
            sums[0] += f64::from(found.value[0]);
            sums[1] += f64::from(found.density);
        }
    }
    sums.map(|sum| sum * 4.0 * std::f64::consts::PI / f64::from(n) / f64::from(m))
}

/// Hair that absorbs nothing scatters all light: within 1 %.
#[test]
fn hair_in_a_white_furnace_is_white() {
    for roughness in [[0.2, 0.2], [0.3, 0.3], [0.6, 0.4], [0.3, 0.9], [1.0, 1.0]] {
        for outgoing in OUTGOING {
            let [value, density] = integrals(&hair([0.0; 3], roughness), outgoing);
            assert!((value - 1.0).abs() < 0.01, "{roughness:?} {outgoing:?}: {value}");
            assert!((density - 1.0).abs() < 0.01, "{roughness:?} {outgoing:?}: density {density}");
        }
    }
}

/// What samples find is what evaluation says.
#[test]
fn samples_have_the_mean_of_the_bsdf() {
    for outgoing in OUTGOING {
        let bsdf = hair([0.6, 0.2, 1.5], [0.3, 0.3]);
        let [value, _] = integrals(&bsdf, outgoing);
        let n = 4000_u16;
        let mut sum = 0.0;
        for i in 0..n {
            let part = |step: f64| (0.5 + f64::from(i) * step).fract() as f32;
            let square = [part(0.754_877_666), part(0.569_840_291)];
            let sample = bsdf.sample(outgoing, square, (f32::from(i) + 0.5) / f32::from(n)).unwrap();
            let length: f32 = sample.incident.iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 1e-5);
            let found = bsdf.evaluate(outgoing, sample.incident);
            assert!((found.density - sample.density).abs() <= 1e-5 * sample.density);
            sum += f64::from(sample.weight[0]);
        }
        assert!((sum / f64::from(n) - value).abs() < 0.01, "{outgoing:?}: {} {value}", sum / f64::from(n));
    }
}

/// More melanin, darker hair; the color of a material is the color of dense hair, so light passes more of it once.
#[test]
fn melanin_darkens_hair() {
    let mut before = 2.0;
    for absorption in [0.0, 0.3, 1.3, 8.0] {
        let [value, _] = integrals(&hair([absorption; 3], [0.3, 0.3]), OUTGOING[1]);
        assert!(value < before, "{absorption}: {value}");
        before = value;
    }
}

/// A strand in a white furnace vanishes, whatever is behind it.
#[test]
fn white_strands_vanish_in_a_white_furnace() {
    let strand = Mesh {
        curves: Some(Curves {
            radii: vec![0.4, 0.3, 0.2],
            segments: CurveSegments::Linear(vec![[0, 1], [1, 2]]),
            shape: CurveShape::Tube,
        }),
        ..mesh(vec![[-2.0, 0.0, 0.0], [0.0, 0.2, 0.0], [2.0, 0.0, 0.3]], vec![], 0)
    };
    let source = Source { is_on: true, ..Source::default() };
    let white = Material { base_color: [1.0; 3], ior: 1.55, hair: Some(Box::new(source)), ..Material::default() };
    let stage = under([1.0; 3], scene(vec![strand], vec![white]));
    let settings = Settings { integrator: Integrator::Path, ..settings(8, 8, 64, 40) };
    let film = film_of(&stage, &prepared(&stage, Levels::Auto), &camera([0.5, 1.0, 4.0], [0.0; 3], 6.0), &settings);
    let mean: f64 = film.pixels().iter().map(|pixel| Pixel::mean(pixel)[0]).sum::<f64>() / 64.0;
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
}
