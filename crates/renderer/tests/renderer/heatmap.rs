use canted_renderer::{Heatmap, Measure, Surfaces, heatmap};
use canted_scene::Scene;
use canted_trace::Counts;

use crate::common::{BruteForce, camera, floor, grey, scene, sphere};

/// The brute-force tracer counts one box test per instance and tests every triangle, so counts are known.
fn known() -> Scene {
    scene(vec![floor(1.0, 0.0, 0), sphere([0.0; 3], 0.5, 1, 0)], vec![grey(0.5)])
}

fn draw(size: [u32; 2], measure: Measure, full_scale: u32) -> Heatmap {
    let scene = known();
    let view = camera([1.0, 2.0, 3.0], [0.0; 3], 40.0);
    heatmap(&Surfaces::new(&scene), &BruteForce::new(&scene), &view, size, measure, full_scale).unwrap()
}

#[test]
fn sums_and_means_match_the_counters() {
    let map = draw([20, 10], Measure::Boxes, 128);
    assert_eq!(map.counts.len(), 200);
    assert!(map.counts.iter().all(|counts| *counts == Counts { boxes: 2, triangles: 34 }));
    assert_eq!(map.total(), Counts { boxes: 400, triangles: 6800 });
    assert_eq!(map.mean(), [2.0, 34.0]);
}

#[test]
fn colors_follow_the_fixed_scale() {
    // Too small for a legend: every pixel shows its count.
    let color = |measure, full_scale| {
        let picture = draw([8, 8], measure, full_scale).picture;
        assert!(picture.pixels.iter().all(|pixel| *pixel == picture.pixels[0]));
        picture.pixels[0]
    };
    assert_eq!(color(Measure::Boxes, 4), color(Measure::Triangles, 68), "half scale in both directions");
    assert_ne!(color(Measure::Boxes, 4), color(Measure::Triangles, 4));
    assert_eq!(color(Measure::Triangles, 34), color(Measure::Triangles, 1), "full scale and above");
}

#[test]
fn legend_covers_only_the_lower_left_corner() {
    let (plain, width, height) = (draw([8, 8], Measure::Boxes, 4).picture.pixels[0], 320, 180);
    let picture = draw([width, height], Measure::Boxes, 4).picture;
    assert_eq!((picture.width, picture.height), (width, height));
    let covered = |x, y| picture.pixels[picture.index(x, y)] != plain;
    assert!(covered(0, height - 1));
    assert!((0..height).all(|y| (160..width).all(|x| !covered(x, y))));
    assert!((0..90).all(|y| (0..width).all(|x| !covered(x, y))));
    // The numbers are white, and the color bar covers the entire range.
    let has = |color: [f32; 3]| picture.pixels.contains(&color);
    let shown = |full_scale| draw([8, 8], Measure::Triangles, full_scale).picture.pixels[0];
    assert!(has([1.0; 3]) && has(shown(1)) && has([0.0; 3]));
    let left_end = picture.pixels[picture.index(4, height - 5)];
    let least = shown(u32::MAX);
    // 34 of 2^32 tests on a scale of eight steps, each below 1 in sRGB, where the slope of the curve is at most 2.4;
    // such dark colors are rounded by at most half as much as one.
    let bound = 34.0 / 2.0_f32.powi(32) * 8.0 * 2.4 + 0.5 * f32::EPSILON;
    assert!((0..3).all(|k| (left_end[k] - least[k]).abs() <= bound), "{left_end:?} {least:?}");
}
