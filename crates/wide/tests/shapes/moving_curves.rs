//! Curves, ribbons, spheres and patches whose points and radii move: hits are those of a loop over them at the time of the ray.

use canted_fixtures::SplitMix64;
use canted_trace::{
    BezierPatch, Intersect as _, Ray, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment, ScaledRay, Side, Sphere,
    position_at,
};
use canted_wide::{Config, Moves, Moving, Preset, Primitive, SavedPrimitive, SimdPath, WideBvh};

/// Of a few points and radii.
trait Shape: Moves + SavedPrimitive + PartialEq + std::fmt::Debug {
    const N: usize;

    fn of(points: &[[f32; 3]], radii: &[f32]) -> Self;

    /// The same, number by number.
    fn interpolated(open: (&[[f32; 3]], &[f32]), close: (&[[f32; 3]], &[f32]), time: f32) -> Self {
        let points: Vec<_> = open.0.iter().zip(close.0).map(|(a, b)| position_at(a, b, time)).collect();
        let radii: Vec<_> = open.1.iter().zip(close.1).map(|(&a, &b)| position_at(&[a; 3], &[b; 3], time)[0]).collect();
        Self::of(&points, &radii)
    }
}

fn first<const N: usize, T: Copy>(list: &[T]) -> [T; N] {
    std::array::from_fn(|i| list[i])
}

impl Shape for Sphere {
    const N: usize = 1;
    fn of(points: &[[f32; 3]], radii: &[f32]) -> Self {
        Self { center: points[0], radius: radii[0] }
    }
}

impl Shape for RoundSegment {
    const N: usize = 2;
    fn of(points: &[[f32; 3]], radii: &[f32]) -> Self {
        Self { ends: first(points), radii: first(radii) }
    }
}

impl Shape for RoundCubic {
    const N: usize = 4;
    fn of(points: &[[f32; 3]], radii: &[f32]) -> Self {
        Self { points: first(points), radii: first(radii) }
    }
}

impl Shape for RibbonSegment {
    const N: usize = 3;
    fn of(points: &[[f32; 3]], radii: &[f32]) -> Self {
        Self { ends: first(points), radii: first(radii), next: points[2] }
    }
}

impl Shape for RibbonCubic {
    const N: usize = 5;
    fn of(points: &[[f32; 3]], radii: &[f32]) -> Self {
        Self { points: first(points), radii: first(radii), next: points[4] }
    }
}

impl Shape for BezierPatch {
    const N: usize = 16;
    fn of(points: &[[f32; 3]], _: &[f32]) -> Self {
        Self { points: std::array::from_fn(|i| first(&points[4 * i..])) }
    }
}

/// Points and radii at both ends: from resting to moving farther than their size, some with a radius that vanishes.
type Ends = [(Vec<[f32; 3]>, Vec<f32>); 2];

fn ends<S: Shape>(rng: &mut SplitMix64, i: usize, place: impl Fn([f32; 3]) -> [f32; 3], scale: f32) -> Ends {
    let center = rng.signed3();
    let size = [0.3, 0.02, 1.0, 0.0][i % 4];
    let mut near = |spread: f64| -> [f32; 3] {
        let off = rng.signed3();
        std::array::from_fn(|k| (center[k] + spread * off[k]) as f32)
    };
    let motion = [0.0, 0.1, 1.0][i % 3];
    let open: Vec<_> = (0..S::N).map(|_| near(size)).collect();
    let shift = near(motion);
    let close = open.iter().map(|p| {
        std::array::from_fn(|k| p[k] + (shift[k] - center[k] as f32) + near(0.1 * motion)[k] - center[k] as f32)
    });
    let close: Vec<[f32; 3]> = close.collect();
    let radii = |factor: f32| (0..S::N).map(|k| scale * factor * [0.1, 0.02, 0.05, 0.1][k % 4]).collect::<Vec<_>>();
    let moved = |points: Vec<[f32; 3]>| points.into_iter().map(&place).collect::<Vec<_>>();
    [(moved(open), radii(1.0)), (moved(close), radii([1.0, 3.0, 0.0][i / 3 % 3]))]
}

/// Rays at the points at the time of the ray, from all around.
fn rays(rng: &mut SplitMix64, all: &[Ends], scale: f32, n: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let [open, close] = &all[rng.below(all.len())];
        let k = rng.below(open.0.len());
        let time = [0.0, 1.0, 0.25, rng.unit() as f32, f32::NAN, 2.0, 1e-7][i % 7];
        let target = position_at(&open.0[k], &close.0[k], time);
        let (from, off) = (rng.on_sphere(), rng.signed3());
        let away = scale * [4.0, 0.2][i / 7 % 2];
        let origin = std::array::from_fn(|k| target[k] + away * from[k] as f32 + scale * 0.04 * off[k] as f32);
        Ray::new(origin, from.map(|x| -x as f32)).at_time(time)
    };
    (0..n).map(ray).collect()
}

type Bits = Option<([u32; 3], Side, u32)>;

/// The first hit of a loop over the primitives at the time of the ray, which are interpolated point by point; `late` is added to the time.
fn looped<S: Shape>(all: &[Ends], ray: &Ray, late: f32) -> Bits {
    let scaled = ScaledRay::new(ray)?;
    let one = |(i, [open, close]): (u32, &Ends)| {
        let shape = S::interpolated((&open.0, &open.1), (&close.0, &close.1), ray.time + late);
        Some((shape.intersect(&scaled, scaled.t_max)?, i))
    };
    let (hit, i) = (0..).zip(all).filter_map(one).min_by(|a, b| a.0.t.total_cmp(&b.0.t).then(a.1.cmp(&b.1)))?;
    Some(([scaled.caller_t(hit.t), hit.u, hit.v].map(f32::to_bits), hit.side, i))
}

fn moving<S: Shape>([open, close]: &Ends) -> Moving<S> {
    Moving { open: S::of(&open.0, &open.1), close: S::of(&close.0, &close.1) }
}

fn check<S: Shape>() {
    let mut rng = SplitMix64::new(51);
    for (scale, offset) in [(1.0_f32, 0.0_f32), (1024.0, 1e7), (1e-6, 0.0), (1.0, -3e3)] {
        let place = |p: [f32; 3]| p.map(|x| scale * x + offset);
        let all: Vec<Ends> = (0..120).map(|i| ends::<S>(&mut rng, i, place, scale)).collect();
        let shapes: Vec<Moving<S>> = all.iter().map(moving).collect();
        let rays = rays(&mut rng, &all, scale, 400);
        let wants: Vec<Bits> = rays.iter().map(|ray| looped::<S>(&all, ray, 0.0)).collect();
        assert!(wants.iter().flatten().count() > 60, "{scale} {offset}: {}", wants.iter().flatten().count());
        let configs: [Config; 3] = [Preset::Dynamic.into(), Preset::Quality.into(), Config::default().axis_aligned()];
        for config in configs {
            let bvh = WideBvh::over_with(shapes.clone(), config).expect("finite bounds");
            let loaded = WideBvh::<Moving<S>>::from_bytes(&bvh.to_bytes()).expect("a valid file");
            let still = shapes.iter().map(|shape| Moving { close: shape.open, ..*shape }).collect();
            let mut refitted = WideBvh::over_with(still, config).expect("finite bounds");
            refitted.refit(shapes.clone()).expect("as many");
            let paths = SimdPath::ALL.into_iter().filter(|path| path.is_available());
            for bvh in paths.map(|path| bvh.clone().with_path(path)).chain([loaded, refitted]) {
                for (ray, want) in rays.iter().zip(&wants) {
                    let hit = bvh.closest_hit(ray);
                    let bits = hit.map(|hit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.side, hit.primitive.0));
                    assert_eq!(bits, *want, "{ray:?}");
                    assert_eq!(bvh.occluded(ray), want.is_some(), "{ray:?}");
                }
            }
        }
        // The comparison finds a time that is off.
        let n_other = rays.iter().zip(&wants).filter(|(ray, want)| looped::<S>(&all, ray, 0.02) != **want).count();
        assert!(n_other > 20, "{n_other}");
    }
}

#[test]
fn spheres_are_hit_where_they_are_at_the_time() {
    check::<Sphere>();
}

#[test]
fn segments_are_hit_where_they_are_at_the_time() {
    check::<RoundSegment>();
}

#[test]
fn cubics_are_hit_where_they_are_at_the_time() {
    check::<RoundCubic>();
}

#[test]
fn ribbons_are_hit_where_they_are_at_the_time() {
    check::<RibbonSegment>();
    check::<RibbonCubic>();
}

#[test]
fn patches_are_hit_where_they_are_at_the_time() {
    check::<BezierPatch>();
}

/// At all times the primitive's own intervals and bounds are in those that hold at all times, rounded or not.
#[test]
fn extents_hold_at_all_times() {
    fn check<S: Shape>() {
        let mut rng = SplitMix64::new(52);
        for i in 0..300 {
            let offset = [0.0, 1e7, 3.3][i % 3];
            let ends = ends::<S>(&mut rng, i, |p| p.map(|x| x + offset), 1.0);
            let shape = moving::<S>(&ends);
            let direction = rng.on_sphere().map(|x| x as f32);
            for time in [0.0, 1.0, 1.0 / 3.0, 0.5, 1e-7, 0.999_999_9] {
                let now = S::between(&shape.open, &shape.close, time);
                let (inner, outer) = (now.extent_along(direction), shape.extent_along(direction));
                assert!(outer[0] <= inner[0] && inner[1] <= outer[1], "{shape:?} {time}: {inner:?} {outer:?}");
                let (inner, outer) = (now.bounds(), shape.bounds());
                assert!(
                    (0..3).all(|k| outer.min[k] <= inner.min[k] && inner.max[k] <= outer.max[k]),
                    "{shape:?} {time}"
                );
            }
        }
    }
    check::<Sphere>();
    check::<RoundSegment>();
    check::<RoundCubic>();
    check::<RibbonCubic>();
    check::<BezierPatch>();
}

#[test]
fn numbers_that_are_not_finite_are_errors_at_either_end() {
    let at = |x: f32| Sphere { center: [x, 0.0, 0.0], radius: 1.0 };
    for (open, close) in [(0.0, f32::NAN), (f32::INFINITY, 0.0), (f32::NAN, 1.0)] {
        assert!(WideBvh::over(vec![Moving { open: at(open), close: at(close) }]).is_err());
    }
}
