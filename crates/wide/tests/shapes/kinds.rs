//! Every kind of curve and quadric: the loop over all of a kind gives the same bits with every preset and path, saved and loaded, and
//! refitted from others, for closest hits, occlusion, all hits and a filter.

use canted_fixtures::SplitMix64;
use canted_trace::{
    Accept, Cone, Disk, Ellipsoid, Hit, Intersect as _, Ray, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment,
    ScaledRay, Side, Sphere,
};
use canted_wide::{Config, Preset, Primitive, PrimitiveHit, SavedPrimitive, SimdPath, WideBvh};

/// Bits of a hit, and its number.
type Bits = ([u32; 3], Side, u32);

fn bits(scaled: &ScaledRay, hit: &PrimitiveHit, number: u32) -> Bits {
    ([scaled.caller_t(hit.t), hit.u, hit.v].map(f32::to_bits), hit.side, number)
}

fn bits_of(hit: &Hit) -> Bits {
    ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.side, hit.primitive.0)
}

/// All hits of a loop over primitives, by `t`, then by number.
fn loop_over<P: Primitive>(all: &[P], ray: &Ray) -> Vec<Bits> {
    let Some(scaled) = ScaledRay::new(ray) else { return vec![] };
    let mut found = vec![];
    for (number, primitive) in (0..).zip(all) {
        let mut rest = scaled;
        while let Some(hit) = primitive.intersect(&rest, f32::INFINITY) {
            found.push((hit.t, bits(&scaled, &hit, number)));
            rest.t_min = hit.t.next_up();
        }
    }
    found.sort_by(|(t, a), (other, b)| t.total_cmp(other).then(a.2.cmp(&b.2)));
    found.into_iter().map(|(_, bits)| bits).collect()
}

/// Rays at and past boxes of primitives: from afar, from within, from near, along the axes.
fn rays<P: Primitive>(all: &[P], rng: &mut SplitMix64) -> Vec<Ray> {
    let ray = |i: usize| {
        let bounds = all[rng.below(all.len())].bounds();
        let at = |k: usize, x: f64| {
            let (low, high) = (f64::from(bounds.min[k]), f64::from(bounds.max[k]));
            0.5 * (low + high) + 0.55 * x * (high - low)
        };
        let offset = rng.signed3();
        let target: [f64; 3] = std::array::from_fn(|k| at(k, offset[k]));
        let from = if i.is_multiple_of(7) { [0.0, -1.0, 0.0] } else { rng.on_sphere() };
        let far = [5.0, 0.0, 0.3][i % 3];
        Ray::new(std::array::from_fn(|k| (target[k] + far * from[k]) as f32), from.map(|x| -x as f32))
    };
    (0..240).map(ray).collect()
}

fn check<P: SavedPrimitive + Clone>(all: &[P], rng: &mut SplitMix64, name: &str) {
    let rays = rays(all, rng);
    let wants: Vec<_> = rays.iter().map(|ray| loop_over(all, ray)).collect();
    let n_hits = wants.iter().filter(|hits| !hits.is_empty()).count();
    assert!(n_hits > 40, "{name}: {n_hits} of {} rays hit", rays.len());
    let mut others = all.to_vec();
    others.rotate_left(all.len() / 3);
    let is_found = |(ray, want): (&Ray, &Vec<Bits>)| loop_over(&others, ray) != *want;
    assert!(rays.iter().zip(&wants).any(is_found), "{name}: a refit that keeps the others would pass");
    let presets = [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality].map(Config::from);
    for config in presets.into_iter().chain([Config { max_oriented_cost: 10.0, ..Config::default() }]) {
        let bvh = WideBvh::over_with(all.to_vec(), config).unwrap();
        let loaded = WideBvh::<P>::from_bytes(&bvh.to_bytes()).unwrap();
        let mut refitted = WideBvh::over_with(others.clone(), config).unwrap();
        refitted.refit(all.to_vec()).unwrap();
        let paths = SimdPath::ALL.into_iter().filter(|path| path.is_available());
        let on_paths = paths.map(|path| bvh.clone().with_path(path));
        for (b, bvh) in on_paths.chain([loaded, refitted]).enumerate() {
            let mut found = vec![];
            for (ray, want) in rays.iter().zip(&wants) {
                let first = bvh.closest_hit(ray).as_ref().map(bits_of);
                assert_eq!(first, want.first().copied(), "{name}, BVH {b}: {ray:?}");
                assert_eq!(bvh.occluded(ray), !want.is_empty(), "{name}, BVH {b}: {ray:?}");
                bvh.all_hits(ray, &mut found);
                assert_eq!(found.iter().map(bits_of).collect::<Vec<_>>(), *want, "{name}, BVH {b}: {ray:?}");
                let odd = bvh.closest_hit_with(ray, &mut Accept(|hit: &Hit| hit.primitive.0 % 2 == 1));
                let want = want.iter().find(|(.., number)| number % 2 == 1).copied();
                assert_eq!(odd.as_ref().map(bits_of), want, "{name}, BVH {b}, odd numbers: {ray:?}");
            }
        }
    }
}

#[test]
fn hits_of_every_kind_do_not_depend_on_the_bvh() {
    let mut rng = SplitMix64::new(31);
    let rng = &mut rng;
    fn point(rng: &mut SplitMix64) -> [f32; 3] {
        rng.signed3().map(|x| 2.0 * x as f32)
    }
    fn beside(rng: &mut SplitMix64, p: [f32; 3]) -> [f32; 3] {
        let off = rng.signed3();
        std::array::from_fn(|k| p[k] + 0.4 * off[k] as f32)
    }
    fn radius(rng: &mut SplitMix64) -> f32 {
        [0.3, 0.1, 1e-4][rng.below(3)] * rng.unit() as f32
    }
    // Chains of four points, some of which coincide.
    fn chain(rng: &mut SplitMix64) -> [[f32; 3]; 4] {
        let a = point(rng);
        let b = beside(rng, a);
        let c = if rng.below(8) == 0 { b } else { beside(rng, b) };
        [a, b, c, beside(rng, c)]
    }
    let n = 90;
    let ends = |rng: &mut SplitMix64| {
        let a = point(rng);
        [a, beside(rng, a)]
    };
    let all: Vec<_> = (0..n).map(|_| RoundSegment { ends: ends(rng), radii: [radius(rng), radius(rng)] }).collect();
    check(&all, rng, "round segments");
    let all: Vec<_> = (0..n).map(|_| Sphere { center: point(rng), radius: radius(rng) }).collect();
    check(&all, rng, "spheres");
    let all: Vec<_> = (0..n).map(|_| RoundCubic { points: chain(rng), radii: [0; 4].map(|_| radius(rng)) }).collect();
    check(&all, rng, "round cubic curves");
    let all: Vec<_> = (0..n)
        .map(|_| {
            let [a, b] = ends(rng);
            RibbonSegment { ends: [a, b], radii: [radius(rng), radius(rng)], next: beside(rng, b) }
        })
        .collect();
    check(&all, rng, "ribbons");
    let all: Vec<_> = (0..n)
        .map(|_| {
            let points = chain(rng);
            RibbonCubic { points, radii: [0; 4].map(|_| radius(rng)), next: beside(rng, points[3]) }
        })
        .collect();
    check(&all, rng, "cubic ribbons");
    let all: Vec<_> = (0..n)
        .map(|_| Disk {
            center: point(rng),
            normal: rng.on_sphere().map(|x| 3.0 * x as f32),
            radius: 2.0 * radius(rng),
        })
        .collect();
    check(&all, rng, "disks");
    let all: Vec<_> = (0..n)
        .map(|i| Cone { ends: ends(rng), radii: [radius(rng), if i % 3 == 0 { 0.0 } else { radius(rng) }] })
        .collect();
    check(&all, rng, "cones");
    let all: Vec<_> = (0..n)
        .map(|_| {
            let [a, b, c] = canted_obb::frame::orthonormal(rng.signed3(), rng.signed3());
            let axes = [a, b, c].map(|row| row.map(|x| x * radius(rng).max(1e-5)));
            Ellipsoid { center: point(rng), axes }
        })
        .collect();
    check(&all, rng, "ellipsoids");
}
