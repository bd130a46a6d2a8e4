//! Cubic curves, ribbons and curves whose points move: what the device calls certain is the CPU's answer, in every class of rays and curves.

use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{HostBvh, Options, Source, TracedScene, block_on};
use canted_obb::Affine;
use canted_tests::closed::placements;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Intersect, Ray, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment, Sphere};
use canted_wide::{Config, Moving, TriangleBvh, WideBvh};

use super::gpu;
use super::segments::{Tally, across, aside, of_kind, plus, unit, vector};
use super::setup::build;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(certain_hits_on_curves_are_the_cpus),
        needs_device(with_negative_bounds_certain_hits_on_curves_are_wrong),
        needs_device(curves_and_triangles_in_instances_answer_as_on_the_cpu),
        needs_device(curly_hair_leaves_few_rays_to_the_cpu),
    ]
}

/// Control points and radii, and the point of the next ribbon.
#[derive(Clone, Copy)]
struct Strand {
    points: [[f32; 3]; 4],
    radii: [f32; 4],
    next: [f32; 3],
}

impl Strand {
    fn cubic(&self) -> RoundCubic {
        RoundCubic { points: self.points, radii: self.radii }
    }

    fn cubic_ribbon(&self) -> RibbonCubic {
        RibbonCubic { points: self.points, radii: self.radii, next: self.next }
    }

    fn ribbon(&self) -> RibbonSegment {
        let [a, .., d] = self.points;
        let [r, .., s] = self.radii;
        RibbonSegment { ends: [a, d], radii: [r, s], next: self.next }
    }

    fn sphere(&self) -> Sphere {
        Sphere { center: self.points[3], radius: self.radii[3] + 0.5 * self.radii[0] }
    }

    fn segment(&self) -> RoundSegment {
        let RibbonSegment { ends, radii, .. } = self.ribbon();
        RoundSegment { ends, radii }
    }

    /// A point of the curve, and the radius there.
    fn at(&self, u: f32) -> ([f32; 3], f32) {
        let ([x, y, z, radius], _) = self.cubic().ball(u.into());
        ([x as f32, y as f32, z as f32], radius as f32)
    }
}

/// Curves of every shape: gentle, strongly bent, with coincident control points, cusps, loops, straight, short, points; thin and thick, and with radii that vary.
fn strands(rng: &mut SplitMix64, n: usize, scale: f32, offset: [f32; 3]) -> Vec<Strand> {
    let one = |i: usize| {
        let a = vector(rng);
        let length = [0.3, 0.3, 1e-3, 0.05][i % 4];
        let step = vector(rng);
        let along = |s: f32| plus(a, s * length, step);
        let near = |s: f32, bend: f32, rng: &mut SplitMix64| plus(along(s), bend * length, vector(rng));
        let [b, c, d] = match i / 4 % 10 {
            0..=2 => [near(0.33, 0.2, rng), near(0.66, 0.2, rng), along(1.0)],
            3 => [near(0.3, 1.0, rng), near(0.6, 1.0, rng), along(1.0)],
            4 => [a, along(1.0), along(1.0)],
            // A cusp, or nearly one.
            5 => [plus(along(1.0), 0.3 * length, [0.0, 1.0, 0.0]), near(-0.1, 0.1, rng), along(0.9)],
            // A loop that ends where it begins.
            6 => [near(0.5, 1.0, rng), near(0.5, 1.0, rng), a],
            7 => [along(1.0 / 3.0), along(2.0 / 3.0), along(1.0)],
            8 => [a, a, a],
            // There and back on a line.
            _ => [along(1.2), along(-0.4), along(0.8)],
        };
        let radius = length * [0.05, 1e-2, 3e-3, 0.3][i / 40 % 4];
        let radii = match i / 160 % 5 {
            0 | 1 => [radius; 4],
            2 => [radius, 0.8 * radius, 0.5 * radius, 0.0],
            3 => [1e-3 * radius, 2.0 * radius, 0.5 * radius, radius],
            _ => [1e-6 * length; 4],
        };
        let next = if i.is_multiple_of(3) { d } else { near(1.5, 0.8, rng) };
        let place = |p: [f32; 3]| plus(offset, scale, p);
        Strand { points: [a, b, c, d].map(place), radii: radii.map(|r| scale * r), next: place(next) }
    };
    (0..n).map(one).collect()
}

/// Rays at centers, at silhouettes, along tangents, from inside, at ends, and with ends near the surface.
fn rays(rng: &mut SplitMix64, strands: &[Strand], n: usize, scale: f32) -> Vec<Ray> {
    let one = |i: usize| {
        let strand = &strands[rng.below(strands.len())];
        let s = match i % 5 {
            0 => 1.0,
            1 => 0.0,
            _ => 0.5 * unit(rng) + 0.5,
        };
        let (center, radius) = strand.at(s);
        let (ahead, _) = strand.at((s + 0.01).min(1.0));
        let axis = [0, 1, 2].map(|k| ahead[k] - center[k]);
        let mut origin = plus(center, scale * [0.5, 3.0, 100.0][i % 3], vector(rng));
        let towards = [0, 1, 2].map(|k| center[k] - origin[k]);
        let (across, aside) = (across(towards, axis), aside(rng, i, radius, scale));
        let mut target = plus(center, aside, across);
        match i / 18 % 7 {
            0 => {
                origin = plus(plus(center, -40.0, axis), 0.9 * radius, vector(rng));
                target = plus(origin, 1.0, axis);
            }
            1 => origin = plus(center, 0.5 * radius, vector(rng)),
            2 => target = plus(center, 3.0 * radius + 0.02 * scale, vector(rng)),
            _ => {}
        }
        let direction = [0, 1, 2].map(|k| (target[k] - origin[k]) * [1.0, 1.0, 1e-3, 1e4][i / 108 % 4]);
        let mut ray = Ray::new(origin, direction);
        if i / 7 % 6 == 3 {
            let along = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
            let way = towards.iter().map(|x| x * x).sum::<f32>().sqrt() + radius * 1.5 * unit(rng);
            let t = (way / along).max(0.0);
            if t.is_finite() {
                (ray.t_min, ray.t_max) = if i.is_multiple_of(2) { (0.0, t) } else { (t, f32::INFINITY) };
            }
        }
        ray
    };
    (0..n).map(one).collect()
}

/// Makes a cloud of strands, and rays through it.
fn cloud(n_rays: usize) -> impl Fn(u64, f32, [f32; 3]) -> (Vec<Strand>, Vec<Ray>) {
    move |number, scale, offset| {
        let mut rng = SplitMix64::new(70 + number);
        let strands = strands(&mut rng, 800, scale, offset);
        let rays = rays(&mut rng, &strands, n_rays, scale);
        (strands, rays)
    }
}

/// What moves is, at shutter opening, somewhere else than where it closes.
fn moved(strand: &Strand) -> Strand {
    let away = 0.5 * (strand.points[1][0] - strand.points[0][0]);
    Strand {
        points: strand.points.map(|[x, y, z]| [x, y + away, z - away]),
        radii: strand.radii.map(|r| 0.5 * r),
        next: strand.next.map(|x| x + away),
    }
}

fn of_clouds(n_rays: usize, bound_scale: f64, mut each: impl FnMut(&str, &Tally)) {
    let each = &mut each;
    let all = cloud(n_rays);
    of_kind("cubic curves", &all, bound_scale, Strand::cubic, each);
    of_kind("ribbons", &all, bound_scale, Strand::ribbon, each);
    of_kind("cubic ribbons", &all, bound_scale, Strand::cubic_ribbon, each);
    let few = cloud(n_rays / 4);
    of_kind("spheres", &few, bound_scale, Strand::sphere, each);
    of_kind("moving spheres", &few, bound_scale, |s| Moving { open: s.sphere(), close: moved(s).sphere() }, each);
    of_kind("moving segments", &few, bound_scale, |s| Moving { open: s.segment(), close: moved(s).segment() }, each);
    of_kind("moving cubics", &few, bound_scale, |s| Moving { open: s.cubic(), close: moved(s).cubic() }, each);
    of_kind("moving ribbons", &few, bound_scale, |s| Moving { open: s.ribbon(), close: moved(s).ribbon() }, each);
    let moving = |s: &Strand| Moving { open: s.cubic_ribbon(), close: moved(s).cubic_ribbon() };
    of_kind("moving cubic ribbons", &few, bound_scale, moving, each);
}

#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn certain_hits_on_curves_are_the_cpus() {
    let mut n_hits = 0;
    of_clouds(6000, 1.0, |name, tally| {
        eprintln!("{name}: {tally:?}");
        n_hits += tally.n_hits;
        assert_eq!(tally.n_wrong, 0, "{name}: {tally:?}");
        // At 1e7 a rounding of a coordinate is as large as curves of size 1; a point that moves errs by some roundings.
        let is_rounded = name.contains("scale 1e0, offset [1") || name.contains("moving") && name.contains("offset [1");
        assert!(is_rounded || 20 * tally.n_hits > tally.n_rays && tally.n_misses > 30, "{name}: {tally:?}");
    });
    assert!(n_hits > 30_000, "{n_hits}");
}

/// The comparison must find hits and misses that are called certain without reason.
fn with_negative_bounds_certain_hits_on_curves_are_wrong() {
    let mut n_wrong = std::collections::BTreeMap::<String, usize>::new();
    of_clouds(1600, -1.0, |name, tally| {
        let kind = name.split(',').next().unwrap_or_default().to_owned();
        *n_wrong.entry(kind).or_default() += tally.n_wrong;
    });
    // Spheres are segments to a device: `segments` has a test with more rays.
    let is_found = |(kind, n): (&String, &usize)| *n > 0 || kind == "spheres";
    assert!(n_wrong.len() == 9 && n_wrong.iter().all(is_found), "{n_wrong:?}");
}

/// Curves of every kind and triangles in one scene, each placed many times: mirrored, sheared, tiny and far.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn curves_and_triangles_in_instances_answer_as_on_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(80);
    let strands = strands(&mut rng, 320, 1.0, [0.0; 3]);
    let cubics = WideBvh::over(strands.iter().map(Strand::cubic).collect()).unwrap();
    let ribbons = WideBvh::over(strands.iter().map(Strand::cubic_ribbon).collect()).unwrap();
    let segments = WideBvh::over(strands.iter().map(Strand::segment).collect()).unwrap();
    let triangles: TriangleBvh = build(&canted_fixtures::displaced_icosphere(3, 2), &Config::default());
    let mirror = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0]] };
    let places = placements().into_iter().map(|place| place.world_from_object).chain([mirror, Affine::IDENTITY]);
    let instances: Vec<Instance> = places.zip(0..).map(|(at, i)| Instance::new(i % 4, at)).collect();
    let all: Vec<Ray> = instances
        .iter()
        .flat_map(|instance| {
            let map = &instance.world_from_object;
            let placed = |ray: &Ray| {
                let end = map.point(plus(ray.origin, 1.0, ray.direction));
                let origin = map.point(ray.origin);
                Ray::new(origin, [0, 1, 2].map(|k| end[k] - origin[k]))
            };
            rays(&mut rng, &strands, 1500, 1.0).iter().map(placed).collect::<Vec<_>>()
        })
        .filter(|ray| ray.direction != [0.0; 3])
        .collect();
    let host: [HostBvh<'_>; 4] = [(&cubics).into(), (&ribbons).into(), (&triangles).into(), (&segments).into()];
    let scene = block_on(TracedScene::new(&gpu, Source::tlas(host, &instances), Options::default())).unwrap();
    let bottom: Vec<Box<dyn Intersect>> =
        vec![Box::new(cubics), Box::new(ribbons), Box::new(triangles), Box::new(segments)];
    let tlas = Tlas::new(bottom, &instances, TopConfig::default()).unwrap();
    let mut tally = Tally::default();
    tally.certain(&gpu, &scene, &tlas, &all, 1.0);
    tally.queries(&gpu, &scene, &tlas, &all);
    eprintln!("{tally:?}");
    assert_eq!(tally.n_wrong, 0, "{tally:?}");
    assert!(tally.n_hits > 5000 && tally.n_misses > 20, "{tally:?}");
    let mut of_negative = Tally::default();
    of_negative.certain(&gpu, &scene, &tlas, &all, -1.0);
    assert!(of_negative.n_wrong > 0, "{of_negative:?}");
}

/// Curly hair of a hundredth of the length of its parts, seen whole: tubes and ribbons.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn curly_hair_leaves_few_rays_to_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(90);
    let mut hairs = vec![];
    for _ in 0..2000 {
        let (mut at, mut along) = (vector(&mut rng), vector(&mut rng));
        for _ in 0..5 {
            let turn = plus(along, 0.7, vector(&mut rng));
            let points = [at, plus(at, 0.05, along), plus(plus(at, 0.05, along), 0.05, turn)];
            let end = plus(points[2], 0.05, turn);
            let next = plus(end, 1.0, turn);
            hairs.push(Strand { points: [points[0], points[1], points[2], end], radii: [2e-3; 4], next });
            (at, along) = (end, turn);
        }
    }
    let rays: Vec<Ray> = (0..20_000)
        .map(|_| {
            let origin = [3.0, 0.2, 0.1];
            let target = vector(&mut rng);
            Ray::new(origin, [0, 1, 2].map(|k| target[k] - origin[k]))
        })
        .collect();
    let check = |name: &str, scene: &TracedScene, cpu: &dyn Intersect| {
        let mut tally = Tally::default();
        tally.queries(&gpu, scene, cpu, &rays);
        eprintln!("{name}: {tally:?}");
        assert_eq!(tally.n_wrong, 0, "{name}: {tally:?}");
        assert!(tally.n_hits > 5000 && tally.n_left * 10 < tally.n_rays, "{name}: {tally:?}");
    };
    let bvh = WideBvh::over(hairs.iter().map(Strand::cubic).collect()).unwrap();
    check("tubes", &block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap(), &bvh);
    let bvh = WideBvh::over(hairs.iter().map(Strand::cubic_ribbon).collect()).unwrap();
    check("ribbons", &block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap(), &bvh);
}
