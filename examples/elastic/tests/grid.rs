//! The grid finds what a loop over all points finds.

mod common;

use common::Random;
use elastic::Grid;

/// The oracle: every point, in `f64`.
fn loop_over(points: &[[f32; 3]], center: [f32; 3], radius: f64) -> Vec<u32> {
    let near = |point: &[f32; 3]| {
        let squares = (0..3).map(|k| f64::from(point[k]) - f64::from(center[k])).map(|x| x * x);
        squares.sum::<f64>() <= radius * radius
    };
    (0..).zip(points).filter(|(_, point)| near(point)).map(|(i, _)| i).collect()
}

/// Random points at a scale about an offset, with duplicates, a plane, a line, and one far outlier.
#[expect(clippy::cast_possible_truncation, reason = "rounds")]
fn points(random: &mut Random, scale: f64, offset: f64, with_outlier: bool) -> Vec<[f32; 3]> {
    let mut points: Vec<[f32; 3]> = (0..150).map(|_| random.vector(scale).map(|x| (x + offset) as f32)).collect();
    points.extend_from_within(0..20);
    points.extend((0..20).map(|_| [(random.next() * scale) as f32, offset as f32, -0.0]));
    points.extend((0..20).map(|i| [(f64::from(i) * 0.1 * scale + offset) as f32, offset as f32, offset as f32]));
    if with_outlier {
        points.push([(3e4 * scale + offset) as f32, offset as f32, 0.0]);
    }
    points
}

#[test]
fn a_query_equals_a_loop() {
    let mut random = Random(1);
    let mut n_found = 0;
    for scale in [1e-6, 1.0, 1e6] {
        for offset in [0.0, -scale, 1e7] {
            for with_outlier in [false, true] {
                let points = points(&mut random, scale, offset, with_outlier);
                for part in [0.0, 0.003, 0.1, 0.5, 10.0] {
                    let radius = part * scale;
                    let grid = Grid::new(&points, radius);
                    #[expect(clippy::cast_possible_truncation, reason = "rounds")]
                    let elsewhere = (0..20).map(|_| random.vector(3.0 * scale).map(|x| (x + offset) as f32));
                    for center in points.iter().copied().chain(elsewhere.collect::<Vec<_>>()) {
                        let want = loop_over(&points, center, radius);
                        n_found += want.len();
                        assert_eq!(grid.within(center, radius), want, "within {radius} of {center:?}");
                    }
                }
            }
        }
    }
    assert!(n_found > 100_000, "most queries find something: {n_found}");
}

/// Points on the borders of cells: multiples of the radius.
#[test]
fn points_exactly_a_radius_apart_are_found() {
    let points: Vec<[f32; 3]> = (0..1000_u16).map(|i| [0.1 * f32::from(i), 7.0, -0.0]).collect();
    let grid = Grid::new(&points, f64::from(0.1_f32));
    for &center in &points {
        for radius in [0.05, 0.1, f64::from(0.1_f32)] {
            assert_eq!(grid.within(center, radius), loop_over(&points, center, radius));
        }
    }
}

#[test]
fn extreme_coordinates_are_found() {
    let points = [[0.0; 3], [-0.0; 3], [f32::MAX; 3], [f32::MIN; 3], [1e-45; 3], [f32::MIN_POSITIVE; 3]];
    for radius in [0.0, 1e-44, 1.0, 1e38, 1e39] {
        let grid = Grid::new(&points, radius);
        for center in points {
            assert_eq!(grid.within(center, radius), loop_over(&points, center, radius), "{radius} {center:?}");
        }
    }
    assert!(Grid::new(&[], 1.0).within([0.0; 3], 1.0).is_empty());
}

#[test]
#[should_panic(expected = "cannot search 2")]
fn a_larger_radius_than_that_of_the_grid_is_rejected() {
    let _ = Grid::new(&[[0.0; 3]], 1.0).within([0.0; 3], 2.0);
}
