//! Queries equal the loop over all shapes; shapes that break their contract; intervals contain the exact projections.

use std::ops::ControlFlow;

use canted_fixtures::{SplitMix64, sum_is_positive};
use canted_obb::{Aabb, PrimId};
use canted_trace::{Accept, Counts, Hit, Intersect, Ray, ScaledRay, Side, Sphere};
use canted_wide::{
    Config, Costs, NodeKind, Preset, Primitive, PrimitiveError, PrimitiveHit, SimdPath, WideBvh, bounds_of_points,
    extent_of_box, extent_of_points,
};

use crate::shape::{Capsule, boxes, capsules, disks, loop_over_all, rays, segments, spheres, struts};

/// Presets with and without oriented nodes, and oriented nodes only.
pub(crate) fn configs() -> Vec<(&'static str, Config)> {
    let costs = Costs { aligned_node: 1e6, oriented_node: 0.01, leaf: 0.0, max_leaf: 1, ..Costs::default() };
    vec![
        ("dynamic", Config::preset(Preset::Dynamic)),
        ("fast", Config::preset(Preset::Fast)),
        ("balanced", Config::default()),
        ("quality", Config::preset(Preset::Quality)),
        ("aligned", Config::default().axis_aligned()),
        ("oriented only", Config { costs, rotate_mesh: false, ..Config::default() }),
    ]
}

pub(crate) fn paths() -> impl Iterator<Item = SimdPath> {
    SimdPath::ALL.into_iter().filter(|path| path.is_available())
}

fn n_oriented<P: Primitive>(bvh: &WideBvh<P>) -> usize {
    bvh.sizes().nodes[NodeKind::Oriented as usize]
}

/// The first ray with another result than the loop.
pub(crate) fn first_difference<P: Primitive>(bvh: &WideBvh<P>, rays: &[Ray], wants: &[Vec<Hit>]) -> Option<String> {
    let mut all = vec![];
    rays.iter().zip(wants).find_map(|(ray, want)| {
        let (closest, occluded) = (bvh.closest_hit(ray), bvh.occluded(ray));
        bvh.all_hits(ray, &mut all);
        let is_equal = closest == want.first().copied() && occluded != want.is_empty() && all == *want;
        (!is_equal).then(|| format!("{ray:?}: {closest:?}, {occluded}, {all:?} instead of {want:?}"))
    })
}

fn agrees<P: Primitive>(name: &str, shapes: &[P], n_rays: usize) -> usize {
    let rays = rays(shapes, n_rays);
    let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(shapes, ray)).collect();
    let n_hits = wants.iter().filter(|want| !want.is_empty()).count();
    assert!(n_hits > n_rays / 8, "{name}: {n_hits} of {n_rays} rays hit");
    let mut n = 0;
    for (config_name, config) in configs() {
        let mut bvh = WideBvh::over_with(shapes.iter().collect(), config).unwrap();
        n += n_oriented(&bvh);
        for path in paths() {
            bvh = bvh.with_path(path);
            assert_eq!(first_difference(&bvh, &rays, &wants), None, "{name}, {config_name}, {}", path.name());
        }
    }
    n
}

/// Sizes and offsets of scenes; with the offset, shapes have few digits left.
const PLACES: [(f32, f32); 4] = [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e4)];

#[test]
fn capsules_are_hit_as_by_the_loop() {
    for (scale, offset) in PLACES {
        assert!(agrees("capsules", &capsules(200, scale, offset), 300) > 0);
    }
    assert!(agrees("struts", &struts(300), 400) > 0);
}

#[test]
fn disks_are_hit_as_by_the_loop() {
    for (scale, offset) in PLACES {
        assert!(agrees("disks", &disks(200, scale, offset), 300) > 0);
    }
}

#[test]
fn spheres_and_boxes_are_hit_as_by_the_loop() {
    for (scale, offset) in PLACES {
        agrees("spheres", &spheres(200, scale, offset), 300);
        agrees("boxes", &boxes(200, scale, offset), 300);
    }
}

#[test]
fn round_segments_are_hit_as_by_the_loop() {
    for (scale, offset) in PLACES {
        assert!(agrees("segments", &segments(300, scale, offset), 400) > 0);
    }
}

#[test]
fn few_and_equal_shapes_are_hit_as_by_the_loop() {
    let thick = Capsule { ends: [[0.0; 3], [1.0, 1.0, -0.5]], radius: 0.75 };
    agrees("one", &[thick], 80);
    agrees("equal", &[thick; 70], 80);
    let none = WideBvh::<Capsule>::over(vec![]).unwrap();
    assert_eq!(none.closest_hit(&Ray::new([0.0; 3], [1.0; 3])), None);
}

/// Oriented nodes are chosen where they gain, and rays then test fewer nodes and fewer shapes.
#[test]
fn diagonal_capsules_get_oriented_nodes_that_save_tests() {
    let shapes = struts(2_000);
    // From far away pads exceed the width of the capsules.
    let mut rays = rays(&shapes, 1_000);
    rays.retain(|ray| ray.origin.into_iter().all(|x| x.abs() < 100.0));
    let count = |config: Config| {
        let bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
        let mut counts = Counts::default();
        for ray in &rays {
            bvh.closest_hit_with(ray, &mut counts);
        }
        (n_oriented(&bvh), counts)
    };
    let (n, oriented) = count(Config::default());
    let (none, aligned) = count(Config::default().axis_aligned());
    assert!(n > 100 && none == 0, "{n} oriented nodes");
    assert!(2 * oriented.triangles < aligned.triangles && oriented.boxes < aligned.boxes, "{oriented:?}, {aligned:?}");
    // No cost is that low.
    for max_oriented_cost in [0.0, -1.0, f32::NAN] {
        let (never, _) = count(Config { max_oriented_cost, ..Config::default() });
        let (never_alone, _) = count(Config { max_oriented_cost, groups: None, ..Config::default() });
        assert_eq!([never, never_alone], [0; 2], "{max_oriented_cost}");
    }
}

#[test]
fn slices_and_filters_equal_single_rays() {
    let shapes = capsules(150, 1.0, 0.0);
    let rays = rays(&shapes, 1_500);
    let bvh = WideBvh::over(shapes).unwrap();
    let accepts = |index: usize, _: &Ray, hit: &Hit| !(index + hit.primitive.index()).is_multiple_of(3);
    let n = rays.len();
    let (mut hits, mut par_hits) = (vec![None; n], vec![None; n]);
    let (mut occluded, mut par_occluded) = (vec![false; n], vec![true; n]);
    let (mut all, mut par_all) = (vec![vec![]; n], vec![vec![]; n]);
    bvh.closest_hits_with(&rays, &mut hits, &accepts);
    bvh.par_closest_hits_with(&rays, &mut par_hits, &accepts);
    bvh.occluded_many_with(&rays, &mut occluded, &accepts);
    bvh.par_occluded_many_with(&rays, &mut par_occluded, &accepts);
    bvh.all_hits_many_with(&rays, &mut all, &accepts);
    bvh.par_all_hits_many_with(&rays, &mut par_all, &accepts);
    assert_eq!((&hits, &occluded, &all), (&par_hits, &par_occluded, &par_all));
    let mut single = vec![];
    for (i, ray) in rays.iter().enumerate() {
        let want: Vec<Hit> =
            loop_over_all(&bvh.primitives(), ray).into_iter().filter(|hit| accepts(i, ray, hit)).collect();
        assert_eq!((hits[i], occluded[i], &all[i]), (want.first().copied(), !want.is_empty(), &want), "{ray:?}");
        let mut accepts = Accept(|hit: &Hit| accepts(i, ray, hit));
        bvh.all_hits_with(ray, &mut accepts, &mut single);
        assert_eq!(single, want);
        assert_eq!(bvh.closest_hit_with(ray, &mut accepts), want.first().copied());
        assert_eq!(bvh.occluded_with(ray, &mut accepts), !want.is_empty());
    }
    assert!(hits.iter().flatten().count() > 200);
}

/// Traversal without tests visits every shape that is hit, before its hit ends the traversal.
#[test]
fn traversal_visits_all_shapes_that_are_hit() {
    let shapes = capsules(200, 1.0, 0.0);
    let rays = rays(&shapes, 500);
    for (name, config) in configs() {
        let bvh = WideBvh::over_with(shapes.iter().collect(), config).unwrap();
        let mut n_visited = 0;
        for ray in &rays {
            let mut visited = vec![];
            bvh.traverse(ray, |id, t_max| {
                visited.push(id);
                ControlFlow::Continue(t_max)
            });
            assert!(loop_over_all(&shapes, ray).iter().all(|hit| visited.contains(&hit.primitive)), "{name} {ray:?}");
            n_visited += visited.len();
            visited.sort_unstable();
            assert!(visited.windows(2).all(|pair| pair[0] < pair[1]), "{name} {ray:?}");
        }
        assert!(n_visited < rays.len() * shapes.len() / 2, "{name}: {n_visited} shapes visited");
    }
}

/// A capsule whose intervals are too short by `PARTS` in a million, on both sides.
struct Shrunk<const PARTS: u32>(Capsule);

impl<const PARTS: u32> Primitive for Shrunk<PARTS> {
    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        let [lo, hi] = self.0.extent_along(direction).map(f64::from);
        let by = 1e-6 * f64::from(PARTS) * (hi - lo);
        [(lo + by) as f32, (hi - by) as f32]
    }

    fn moments(&self) -> canted_obb::Moments {
        self.0.moments()
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        self.0.intersect(ray, t_max)
    }
}

#[test]
fn intervals_that_are_too_short_lose_hits() {
    fn n_lost<const PARTS: u32>() -> usize {
        let shapes = struts(300);
        let rays = rays(&shapes, 4_000);
        let (_, config) = configs().pop().expect("the last one has oriented nodes only");
        let shrunk = shapes.iter().map(|&shape| Shrunk::<PARTS>(shape)).collect();
        let bvh = WideBvh::<Shrunk<PARTS>>::over_with(shrunk, config).unwrap();
        rays.iter().filter(|ray| bvh.closest_hit(ray) != loop_over_all(&shapes, ray).first().copied()).count()
    }
    assert_eq!(n_lost::<0>(), 0);
    let lost = n_lost::<5_000>();
    assert!(lost > 5, "{lost} hits are lost");
}

/// A capsule that reports no interval, an inverted one, or one that is far too wide: that of the bounds replaces it.
struct Vague<const KIND: u32>(Capsule);

impl<const KIND: u32> Primitive for Vague<KIND> {
    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    fn extent_along(&self, _: [f32; 3]) -> [f32; 2] {
        [[f32::NAN; 2], [f32::NEG_INFINITY, f32::INFINITY], [-1e30, 1e30]][KIND as usize]
    }

    fn moments(&self) -> canted_obb::Moments {
        let moments = self.0.moments();
        canted_obb::Moments { weight: [f64::NAN, -1.0, f64::INFINITY][KIND as usize], ..moments }
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        self.0.intersect(ray, t_max)
    }
}

#[test]
fn useless_intervals_and_moments_lose_no_hit() {
    fn agrees_vaguely<const KIND: u32>() {
        let shapes: Vec<Vague<KIND>> = capsules(100, 1.0, 0.0).into_iter().map(Vague).collect();
        agrees("vague", &shapes, 200);
    }
    agrees_vaguely::<0>();
    agrees_vaguely::<1>();
    agrees_vaguely::<2>();
}

#[test]
fn boxes_are_entered_and_left() {
    let unit = Aabb { min: [0.0; 3], max: [1.0; 3] };
    let bvh = WideBvh::over(vec![unit]).unwrap();
    let mut hits = vec![];
    bvh.all_hits(&Ray::new([0.5, 0.5, -1.0], [0.0, -0.0, 2.0]), &mut hits);
    assert_eq!(hits.iter().map(|hit| (hit.t, hit.side)).collect::<Vec<_>>(), [(0.5, Side::Front), (1.0, Side::Back)]);
    assert_eq!(bvh.closest_hit(&Ray::new([0.5; 3], [1.0, 0.0, 0.0])).map(|hit| hit.t), Some(0.5));
    assert!(!bvh.occluded(&Ray::new([2.0, 0.5, 0.5], [0.0, 1.0, 0.0])));
}

#[test]
fn where_the_entry_is_rejected_the_exit_is_hit() {
    let leaving = |hit: &Hit| hit.side == Side::Back;
    let bvh = WideBvh::over(vec![Sphere { center: [0.0; 3], radius: 1.0 }]).expect("valid");
    let ray = Ray::new([0.0, 0.0, -3.0], [0.0, 0.0, 0.5]);
    assert_eq!(bvh.closest_hit(&ray).map(|hit| (hit.t, hit.side)), Some((4.0, Side::Front)));
    let left = bvh.closest_hit_with(&ray, &mut Accept(leaving));
    assert_eq!(left.map(|hit| (hit.t, hit.side)), Some((8.0, Side::Back)));
    assert!(bvh.occluded_with(&ray, &mut Accept(leaving)));
}

#[test]
fn invalid_bounds_are_rejected_by_id() {
    let valid = Sphere { center: [0.0; 3], radius: 1.0 };
    for radius in [-1.0, f32::NAN, f32::INFINITY] {
        let primitives = vec![valid, Sphere { radius, ..valid }, valid];
        let rejected = WideBvh::over(primitives).map(|_| ());
        assert_eq!(rejected, Err(PrimitiveError::Bounds { primitive: PrimId(1) }), "{radius}");
    }
    let none = WideBvh::<Sphere>::over(vec![]).expect("no primitive is invalid");
    assert!(none.closest_hit(&Ray::new([0.0; 3], [1.0; 3])).is_none());
    assert!(none.aabb().is_empty());
}

/// Reports hits outside the interval, and NaN.
struct WrongT(f32);

impl Primitive for WrongT {
    fn bounds(&self) -> Aabb {
        Aabb { min: [0.0; 3], max: [1.0; 3] }
    }

    fn intersect(&self, _: &ScaledRay, _: f32) -> Option<PrimitiveHit> {
        Some(PrimitiveHit { t: self.0, u: 0.0, v: 0.0, side: Side::Front })
    }
}

#[test]
fn hits_outside_the_interval_are_ignored() {
    for t in [f32::NAN, f32::INFINITY, -1.0, 100.0] {
        let bvh = WideBvh::over(vec![WrongT(t)]).expect("valid bounds");
        let ray = Ray { t_max: 50.0, ..Ray::new([0.5, 0.5, -1.0], [0.0, 0.0, 1.0]) };
        assert_eq!(bvh.closest_hit(&ray), None, "{t}");
        let endless = Ray { t_max: f32::INFINITY, ..ray };
        let mut hits = vec![];
        bvh.all_hits(&endless, &mut hits);
        assert_eq!(hits.len(), usize::from(t == 100.0));
    }
}

/// A sphere whose error is larger than stated.
struct Inexact<const STATED: bool>(Sphere);

/// Its error, relative to `|o|∞ + ρ∞`.
const ACTUAL_ERROR: f32 = 1e-3;

impl<const STATED: bool> Primitive for Inexact<STATED> {
    const ERROR: f32 = if STATED { 2.0 * ACTUAL_ERROR } else { 0.0 };

    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let reach = |v: [f32; 3]| v.into_iter().fold(0.0f32, |a, x| a.max(x.abs()));
        let scale = reach(ray.origin) + self.bounds().reach();
        // Grown by the error, so that rays which miss the bounds hit it.
        let grown = Sphere { radius: self.0.radius + ACTUAL_ERROR * scale, ..self.0 };
        Primitive::intersect(&grown, ray, t_max)
    }
}

#[test]
fn pads_follow_the_stated_error() {
    fn lost<const STATED: bool>() -> usize {
        let spheres = spheres(200, 1.0, 0.0);
        let rays = rays(&spheres, 2000);
        let bvh = WideBvh::<Inexact<STATED>>::over(spheres.iter().map(|&s| Inexact::<STATED>(s)).collect());
        let bvh = bvh.expect("valid spheres");
        rays.iter()
            .filter(|ray| {
                let Some(scaled) = ScaledRay::new(ray) else { return false };
                let tried = bvh.primitives().into_iter().filter_map(|p| p.intersect(&scaled, scaled.t_max));
                let want = tried.map(|hit| scaled.caller_t(hit.t)).reduce(f32::min);
                bvh.closest_hit(ray).map(|hit| hit.t) != want
            })
            .count()
    }
    assert_eq!(lost::<true>(), 0);
    let lost = lost::<false>();
    assert!(lost > 20, "an error that is not stated loses {lost} hits");
}

/// Whether `lo <= direction·point <= hi`, by exact products and sums.
fn contains([lo, hi]: [f32; 2], direction: [f32; 3], point: [f32; 3]) -> bool {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| f64::from(direction[k]) * f64::from(point[k]));
    sum_is_positive(&[x, y, z, -f64::from(lo)]) && sum_is_positive(&[-x, -y, -z, f64::from(hi)])
}

fn random(rng: &mut SplitMix64, scale: f64, offset: f64) -> [f32; 3] {
    std::array::from_fn(|_| (scale * rng.signed() + offset) as f32)
}

#[test]
fn intervals_contain_exact_projections_and_little_else() {
    let mut rng = SplitMix64::new(1);
    for i in 0..20_000 {
        let (scale, offset) = [(1.0, 0.0), (1e-30, 0.0), (1e15, 0.0), (1.0, 1e7), (1e-3, -1.0)][i % 5];
        let points = [(); 3].map(|()| random(&mut rng, scale, offset));
        let direction = rng.on_sphere().map(|x| x as f32);
        let extent = extent_of_points(points, 0.0, direction);
        assert!(points.iter().all(|&point| contains(extent, direction, point)), "{points:?} {direction:?}");
        // An interval one unit shorter at either end misses a point.
        for shorter in [[extent[0].next_up(), extent[1]], [extent[0], extent[1].next_down()]] {
            let loose = points.iter().all(|&point| contains(shorter, direction, point));
            let exact = points.iter().any(|&point| contains([extent[0], extent[0]], direction, point));
            let _ = exact;
            // Errors of f64 may widen the interval by one unit of f32, not by two.
            let [lo, hi] = [shorter[0].next_up(), shorter[1].next_down()];
            assert!(!loose || !points.iter().all(|&point| contains([lo, hi], direction, point)));
        }
        let aabb = Aabb::from_points(points);
        let extent = extent_of_box(&aabb, direction);
        assert!(aabb.corners().iter().all(|&corner| contains(extent, direction, corner)));
    }
}

#[test]
fn radii_widen_intervals_and_boxes() {
    let (points, radius) = ([[1.0, 2.0, 3.0], [-4.0, 0.5, 0.25]], 0.1_f32);
    let bounds = bounds_of_points(points, radius);
    for k in 0..3 {
        let axis = std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 });
        let [lo, hi] = extent_of_points(points, radius, axis);
        let (least, greatest) = (points[0][k].min(points[1][k]), points[0][k].max(points[1][k]));
        for (lo, hi) in [(lo, hi), (bounds.min[k], bounds.max[k])] {
            // In f64 these sums are exact.
            assert!(f64::from(lo) <= f64::from(least) - f64::from(radius));
            assert!(f64::from(hi) >= f64::from(greatest) + f64::from(radius));
            assert!(hi - lo < 1.000_001 * (greatest - least + 2.0 * radius));
        }
    }
    assert_eq!(bounds_of_points([[3.0, 0.0, 0.0]], 1.0), Aabb { min: [2.0, -1.0, -1.0], max: [4.0, 1.0, 1.0] });
    // What f64 cannot hold is rounded outward, too.
    let tiny = bounds_of_points([[1.0; 3]], 1e-30);
    assert_eq!((tiny.min, tiny.max), ([1.0f32.next_down(); 3], [1.0f32.next_up(); 3]));
}

#[test]
fn no_points_and_nan_give_no_box() {
    assert!(bounds_of_points([], 1.0).is_empty());
    assert!(bounds_of_points([[0.0; 3], [0.0, f32::NAN, 0.0]], 1.0).min[0].is_nan());
    let [lo, hi] = extent_of_points([], 1.0, [1.0, 0.0, 0.0]);
    assert!(lo > hi);
}
