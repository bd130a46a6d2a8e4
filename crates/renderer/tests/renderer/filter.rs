use canted_film::{Filter, FilterSampler};
use canted_renderer::{Pattern, Sampler, Settings};
use canted_scene::{Material, MaterialId, Mesh, Part, Scene};

use crate::common::{camera, film, scene, settings};

const FILTERS: [Filter; 7] = [
    Filter::BOX,
    Filter::Box(1.25),
    Filter::TENT,
    Filter::GAUSSIAN,
    Filter::MITCHELL,
    Filter::Mitchell(3.0),
    Filter::BLACKMAN_HARRIS,
];

/// Samples form a net: each of as many columns contains one.
const N: u32 = 1 << 16;

/// The filter's response to light that depends on x, by samples and by quadrature.
fn responses(filter: Filter, light: impl Fn(f64) -> f64, breaks: &[f64]) -> [f64; 2] {
    let sampler = Sampler::new(Pattern::Sobol, N, 1);
    let placer = FilterSampler::new(filter).unwrap();
    let (mut sum, mut weights) = (0.0, 0.0);
    for ([x, _], weight) in (0..N).map(|i| placer.sample(sampler.pair(0, i, 0))) {
        sum += f64::from(weight) * light(x);
        weights += f64::from(weight);
    }
    let r = f64::from(filter.radius());
    let mut breaks: Vec<f64> = breaks.iter().copied().chain([-r, -r / 2.0, 0.0, r / 2.0, r]).collect();
    breaks.retain(|x| x.abs() <= r);
    breaks.sort_by(f64::total_cmp);
    let integral = |of: &dyn Fn(f64) -> f64| breaks.windows(2).map(|w| simpson(of, w[0], w[1])).sum::<f64>();
    // Pieces are open intervals, so a break belongs to neither side.
    [sum / weights, integral(&|x| filter.value(x) * light(x)) / integral(&|x| filter.value(x))]
}

fn simpson(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    const PIECES: i32 = 200;
    // Ends are moved inwards by a billionth, so that an edge of the light belongs to one side.
    let (a, b) = (a + 1e-9 * (b - a), b - 1e-9 * (b - a));
    let h = (b - a) / f64::from(2 * PIECES);
    let at = |i: i32| f(a + h * f64::from(i));
    (0..PIECES).map(|i| at(2 * i) + 4.0 * at(2 * i + 1) + at(2 * i + 2)).sum::<f64>() * h / 3.0
}

/// Error bound of sampling and table for light of this variation.
///
/// Koksma's inequality: the error is at most the discrepancy of the net times the variation. The discrepancy is at most
/// 2/n along one axis. The signs of a filter with negative lobes vary along both axes, by four each and by products
/// with the light; the discrepancy over rectangles is (m + 3)/n. The table adds a millionth for an edge.
fn bound(filter: Filter, variation: f64, n: u32) -> f64 {
    match filter {
        Filter::Mitchell(_) => 2.0 * (variation + 8.0) * f64::from(n.ilog2() + 3) / f64::from(n),
        _ => variation * 2.0 / f64::from(n) + 1e-6,
    }
}

#[test]
fn edge_responses_match_quadrature() {
    for filter in FILTERS {
        for edge in [-2.2, -1.0, -0.6, -0.3, 0.0, 0.1, 0.45, 0.9, 1.7] {
            let [sampled, exact] = responses(filter, |x| f64::from(u8::from(x > edge)), &[edge]);
            assert!((sampled - exact).abs() < bound(filter, 1.0, N), "{filter:?} edge {edge}: {sampled} for {exact}");
        }
    }
}

#[test]
fn sine_responses_match_quadrature() {
    for filter in FILTERS {
        for period in [0.7, 1.0, 2.0, 5.0] {
            let light = |x: f64| (std::f64::consts::TAU * (x + 0.1) / period).sin();
            let [sampled, exact] = responses(filter, light, &[]);
            let variation = 4.0 * (2.0 * f64::from(filter.radius()) / period + 1.0);
            assert!(
                (sampled - exact).abs() < bound(filter, variation, N),
                "{filter:?} period {period}: {sampled} {exact}"
            );
        }
    }
}

/// The test above distinguishes filters: their responses to an edge differ.
#[test]
fn test_distinguishes_filters() {
    for a in FILTERS {
        for b in FILTERS.into_iter().filter(|b| *b != a) {
            let differs = [0.1, 0.3, 0.6].into_iter().any(|edge| {
                let light = |x: f64| f64::from(u8::from(x > edge));
                let [[sampled, _], [_, exact]] = [responses(a, light, &[edge]), responses(b, light, &[edge])];
                (sampled - exact).abs() > bound(a, 1.0, N)
            });
            assert!(differs, "{a:?} for {b:?}");
        }
    }
}

#[test]
fn weights_are_one_unless_the_filter_has_negative_lobes() {
    let ends = [0.0, 0.25, 0.5, 1.0 - 1.0 / 16_777_216.0];
    for filter in FILTERS {
        let placer = FilterSampler::new(filter).unwrap();
        for square in ends.iter().flat_map(|&x| ends.map(|y| [x, y])) {
            let (position, weight) = placer.sample(square);
            assert!(
                position.iter().all(|x| x.abs() <= f64::from(filter.radius())),
                "{filter:?} {square:?}: {position:?}"
            );
            // The center of the square maps to the center of the pixel.
            assert_eq!(placer.sample([0.5, 0.5]).0, [0.0, 0.0]);
            match filter {
                Filter::Mitchell(_) => assert_eq!(weight.abs().to_bits(), 1.0_f32.to_bits(), "{filter:?}"),
                _ => assert_eq!(weight.to_bits(), 1.0_f32.to_bits(), "{filter:?}"),
            }
        }
    }
}

#[test]
fn box_filter_is_the_identity() {
    let placer = FilterSampler::new(Filter::BOX).unwrap();
    let sampler = Sampler::new(Pattern::Random, 1, 0);
    for pixel in 0..1000 {
        let square = sampler.pair(pixel, 0, 0);
        let ([x, y], _) = placer.sample(square);
        let column = f64::from(pixel * 7 + 3);
        assert_eq!([column + 0.5 + x, 0.5 + y], [column + f64::from(square[0]), f64::from(square[1])]);
    }
}

#[test]
fn invalid_radii_are_rejected() {
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(FilterSampler::new(Filter::Tent(radius)).is_none(), "{radius}");
    }
}

/// Weights are normalized: constant light stays constant with few samples and any filter.
#[test]
fn constant_light_stays_constant() {
    let empty = Scene { environment: Some([0.75; 3].into()), ..scene(vec![], vec![]) };
    let view = camera([0.0, 0.0, 1.0], [0.0; 3], 90.0);
    for filter in FILTERS {
        for samples in [1, 3, 16] {
            let film = film(&empty, &view, &Settings { filter, ..settings(16, 16, samples, 0) });
            assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.75; 3]), "{filter:?} {samples}");
        }
    }
}

/// A bright half-plane viewed frontally: the pixels of a row are the filter's response to its edge.
#[test]
fn rendered_edge_is_filtered() {
    const EDGE: f32 = 0.2;
    const SAMPLES: u32 = 1 << 12;
    let bright = Material { base_color: [0.0; 3], emission: [1.0; 3], ..Material::default() };
    let half_plane = Mesh {
        positions: vec![[EDGE, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [EDGE, 9.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
        ..Mesh::default()
    };
    let stage = scene(vec![half_plane], vec![bright]);
    // A pixel is an eighth of a unit.
    let view = camera([0.0, 0.0, 1.0], [0.0; 3], 90.0);
    for filter in FILTERS {
        let film = film(&stage, &view, &Settings { filter, pattern: Pattern::Sobol, ..settings(16, 16, SAMPLES, 0) });
        for column in 0..16_u8 {
            let middle = (f64::from(column) + 0.5 - 8.0) / 8.0;
            let edge = 8.0 * (f64::from(EDGE) - middle);
            let [_, exact] = responses(filter, |x| f64::from(u8::from(x > edge)), &[edge]);
            let value = film.pixels()[8 * 16 + usize::from(column)].mean()[0];
            let bound = bound(filter, 1.0, SAMPLES);
            assert!((value - exact).abs() < bound, "{filter:?} column {column}: {value} for {exact}");
        }
    }
}
