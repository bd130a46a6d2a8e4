//! Queries equal the loop over all shapes.

use canted_obb::Aabb;
use std::ops::ControlFlow;

use canted_trace::{Accept, Counts, Hit, Intersect, Ray, ScaledRay, Side};
use canted_wide::{Config, Costs, NodeKind, Preset, Primitive, PrimitiveHit, SimdPath, WideBvh};

use crate::scenes::{self, boxes, capsules, disks, rays, spheres, struts};
use crate::shape::{Capsule, loop_over_all};

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
            loop_over_all(bvh.primitives(), ray).into_iter().filter(|hit| accepts(i, ray, hit)).collect();
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
        let rays = scenes::rays(&shapes, 4_000);
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
