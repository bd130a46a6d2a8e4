//! Triangles that move while the shutter is open: hits at each time are those of the loop over the triangles at that time.
//!
//! Not covered: curved paths; vertices move in straight lines.

use canted_fixtures::{self as fixtures, Mesh, SplitMix64};
use canted_trace::{Hit, Intersect, Kernel, MollerTrumbore, Ray, TriangleTest, Watertight, position_at};
use canted_wide::{Config, MovingBvh, Preset, RefitError, TriangleBvh};

use crate::common::{brute, paths, rays};

const TIMES: [f32; 5] = [0.0, 1e-6, 0.3, 0.75, 1.0];

/// A mesh, and where its vertices are as the shutter closes.
struct Motion {
    open: Mesh,
    close: Vec<[f32; 3]>,
}

impl Motion {
    fn new(open: Mesh, close: impl FnMut([f32; 3]) -> [f32; 3]) -> Self {
        let close = open.positions.iter().copied().map(close).collect();
        Self { open, close }
    }

    fn build(&self, config: Config) -> MovingBvh {
        MovingBvh::build_with(&self.open.positions, &self.close, &self.open.triangles, config)
            .expect("fixtures are valid")
    }

    /// The mesh at a time.
    fn at(&self, time: f32) -> Mesh {
        let ends = self.open.positions.iter().zip(&self.close);
        let positions = ends.map(|(open, close)| position_at(open, close, time)).collect();
        Mesh { positions, triangles: self.open.triangles.clone() }
    }
}

/// Twists, explosions, and motions by far more than the size of a triangle, or of the mesh.
fn motions() -> Vec<(&'static str, Motion)> {
    let mut rng = SplitMix64::new(7);
    let mut number = move |size: f32| size * (rng.unit() as f32 - 0.5);
    let mut anywhere = |size: f32| Motion::new(fixtures::soup(1, 150), |p: [f32; 3]| p.map(|x| x + number(size)));
    let twisted = |[x, y, z]: [f32; 3]| {
        let (sin, cos) = (2.0 * z).sin_cos();
        [cos * x - sin * y, sin * x + cos * y, z]
    };
    let away = |p: [f32; 3]| p.map(|x| 1e7 + 1e-3 * x);
    vec![
        ("almost still", anywhere(1e-3)),
        ("near", anywhere(3.0)),
        ("far", anywhere(100.0)),
        ("twisted scaffold", Motion::new(fixtures::scaffold_of(1, true, 2), twisted)),
        ("exploding sphere", Motion::new(fixtures::icosphere(2), |p| p.map(|x| 5.0 * x))),
        ("collapsing sphere", Motion::new(fixtures::icosphere(2), |_| [0.25; 3])),
        ("inverted sphere", Motion::new(fixtures::icosphere(2), |p| p.map(|x| -x))),
        ("far away", Motion::new(fixtures::icosphere(2), away)),
        ("slivers", Motion::new(fixtures::slivers(2, 100), |[x, y, z]| [y, z, x])),
        ("no motion", Motion::new(fixtures::coplanar_quads(6), |p| p)),
    ]
}

/// The first ray with other hits than the loop.
fn first_difference(bvh: &MovingBvh, rays: &[Ray], time: f32, wants: &[Vec<Hit>]) -> Option<String> {
    let mut all = vec![];
    rays.iter().zip(wants).find_map(|(ray, want)| {
        let ray = &ray.at_time(time);
        let (closest, occluded) = (bvh.closest_hit(ray), bvh.occluded(ray));
        bvh.all_hits(ray, &mut all);
        let is_equal = closest == want.first().copied() && occluded != want.is_empty() && all == *want;
        (!is_equal).then(|| format!("{ray:?}: {closest:?}, {occluded}, {all:?} instead of {want:?}"))
    })
}

fn with(test: TriangleTest) -> Config {
    Config { test, ..Config::default() }
}

#[track_caller]
fn agrees<K: Kernel<Record = [[f32; 3]; 3]>>(configs: &[Config]) {
    for (name, motion) in motions() {
        let mut n_hits = 0;
        for time in TIMES {
            let mesh = motion.at(time);
            let rays = rays(&mesh, 12, 5);
            let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| brute::<K>(&mesh, ray)).collect();
            n_hits += wants.iter().filter(|want| !want.is_empty()).count();
            // A static BVH is the other oracle.
            let still = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, configs[0]).unwrap();
            assert!(
                rays.iter().zip(&wants).all(|(ray, want)| still.closest_hit(ray) == want.first().copied()),
                "{name}"
            );
            for &config in configs {
                let mut bvh = motion.build(config);
                for path in paths() {
                    bvh = bvh.with_path(path);
                    let difference = first_difference(&bvh, &rays, time, &wants);
                    assert_eq!(difference, None, "{name}, {}, time {time}", path.name());
                }
            }
        }
        // Most rays miss slivers.
        assert!(n_hits > 5, "{name}: {n_hits} hits");
    }
}

#[test]
fn hits_at_a_time_are_those_of_the_triangles_at_that_time() {
    agrees::<Watertight>(&[Preset::Fast, Preset::Balanced, Preset::Dynamic].map(Config::preset));
    agrees::<MollerTrumbore>(&[with(TriangleTest::MollerTrumbore)]);
}

/// Its records are not vertices, so it is compared with the test whose hits it has.
#[test]
fn kernels_with_other_records_have_the_same_hits() {
    let motion = Motion::new(fixtures::soup(3, 200), |[x, y, z]| [y, 1.0 - z, x]);
    let [a, b] = [TriangleTest::MollerTrumbore, TriangleTest::BaldwinWeber].map(|test| motion.build(with(test)));
    for ray in rays(&motion.at(0.4), 20, 1) {
        let ray = ray.at_time(0.4);
        assert_eq!(a.closest_hit(&ray), b.closest_hit(&ray));
    }
}

/// Rays at another time have other hits, and the comparison finds them.
#[test]
fn the_comparison_finds_a_wrong_time() {
    let motion = Motion::new(fixtures::icosphere(2), |p| p.map(|x| 3.0 * x));
    let mesh = motion.at(0.5);
    let rays = rays(&mesh, 12, 5);
    let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| brute::<Watertight>(&mesh, ray)).collect();
    let bvh = motion.build(Config::default());
    assert_eq!(first_difference(&bvh, &rays, 0.5, &wants), None);
    assert!(first_difference(&bvh, &rays, 0.51, &wants).is_some());
}

/// Refits, as far as vertices may move, and back.
#[test]
fn refits_have_the_hits_of_builds() {
    let sphere = fixtures::icosphere(3);
    let motions = [1.0, 1.1, 50.0, -3.0, 1e6, 1e-6, 1.0].map(|scale| {
        let open =
            Mesh { positions: sphere.positions.iter().map(|p| p.map(|x| scale * x)).collect(), ..sphere.clone() };
        Motion::new(open, |[x, y, z]| [y + scale, 2.0 * x, z * z])
    });
    let mut bvh = motions[0].build(Config::default());
    let mut greatest = 0.0_f32;
    for motion in &motions {
        let drift = bvh.refit(&motion.open.positions, &motion.close, &sphere.triangles).unwrap().drift;
        greatest = greatest.max(drift);
        for time in TIMES {
            let mesh = motion.at(time);
            let rays = rays(&mesh, 10, 3);
            let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| brute::<Watertight>(&mesh, ray)).collect();
            for path in paths() {
                bvh = bvh.with_path(path);
                assert_eq!(first_difference(&bvh, &rays, time, &wants), None, "time {time}, {}", path.name());
            }
        }
    }
    assert!(greatest > 1.0);
}

#[test]
fn invalid_motions_are_errors_and_leave_the_bvh_as_it_is() {
    let motion = Motion::new(fixtures::icosphere(1), |p| p.map(|x| 2.0 * x));
    let mut bvh = motion.build(Config::default());
    let (open, triangles) = (&motion.open.positions, &motion.open.triangles);
    let build = |close: &[[f32; 3]]| MovingBvh::build(open, close, triangles);
    let mut torn = motion.close.clone();
    torn[5][1] = f32::NAN;
    let first = triangles.iter().position(|triangle| triangle.contains(&5)).unwrap();
    let message =
        format!("triangle {first} has a vertex that is not finite: vertex 5 is ({}, NaN, {})", torn[5][0], torn[5][2]);
    assert_eq!(build(&torn).unwrap_err().to_string(), message);
    assert_eq!(bvh.refit(open, &torn, triangles).unwrap_err().to_string(), message);
    assert!(build(&motion.close[1..]).unwrap_err().to_string().contains("vertex index"));
    assert!(matches!(bvh.refit(open, &motion.close, &triangles[1..]), Err(RefitError::Count { .. })));
    let ray = Ray::new([0.1, 0.2, 9.0], [0.0, 0.0, -1.0]);
    let hits = |bvh: &MovingBvh| bvh.closest_hit(&ray.at_time(0.5));
    assert!(hits(&bvh).is_some());
    assert_eq!(hits(&bvh), hits(&motion.build(Config::default())));
    // Rays that cannot hit, and no triangles.
    let none = MovingBvh::build::<[f32; 3], u32>(&[], &[], &[]).unwrap();
    assert_eq!(hits(&none), None);
    let invalid = Ray::new([f32::NAN, 0.0, 0.0], [0.0, 0.0, -1.0]);
    assert!(!bvh.occluded(&invalid.at_time(f32::NAN)));
    // Times outside of the shutter are clamped.
    let at = |time| bvh.closest_hit(&ray.at_time(time));
    assert_eq!([at(-1.0), at(2.0), at(f32::NAN)], [at(0.0), at(1.0), at(0.0)]);
}
