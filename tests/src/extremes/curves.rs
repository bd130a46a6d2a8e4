//! Round segments, round cubic curves, ribbons and spheres at their limits: thin, of changing radius, bent more than they are thick, far away and tiny.

use canted_fixtures::SplitMix64;
use canted_obb::PrimId;
use canted_trace::{
    HIT_ERROR, Hit, InstanceId, Intersect, Ray, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment, ScaledRay, Sphere,
};
use canted_wide::{Moves, Moving, Preset, Primitive, PrimitiveHit, SimdPath, WideBvh};

use super::{Oracle, Promise, Row, hierarchy::SAME};

/// The distance of reported points from the surface.
pub(super) const NEAR: &str = "hits lie on the surface";
/// Misses of lines that pass through by more than the error.
const FOUND: &str = "a line through the inside is a hit";
/// Entries and exits of a closed chain.
const EVEN: &str = "a line enters a closed chain as often as it leaves it";

/// A ball: center and radius.
type Ball = [f64; 4];

/// A primitive that is a union of balls, or in it.
trait Balls: Primitive + Clone {
    /// Whether it is the union. A ribbon is in it, and lines between its ends and those of the balls miss it.
    const IS_UNION: bool = true;

    /// The ball at a position in 0..=1.
    fn ball(&self, at: f64) -> Ball;

    /// Positions between which the distance has one minimum, about.
    const N_PARTS: u32;

    /// The signed distance of a point from the union of all balls: the least over all parts, by ternary search in each.
    fn distance(&self, point: [f64; 3]) -> f64 {
        let at = |s: f64| {
            let [x, y, z, radius] = self.ball(s);
            (0..3).map(|k| (point[k] - [x, y, z][k]).powi(2)).sum::<f64>().sqrt() - radius
        };
        let in_part = |part: u32| {
            let n = f64::from(Self::N_PARTS);
            let (mut low, mut high) = (f64::from(part) / n, f64::from(part + 1) / n);
            let ends = at(low).min(at(high));
            for _ in 0..80 {
                let (s, t) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if at(s) < at(t) { high = t } else { low = s }
            }
            ends.min(at(low))
        };
        (0..Self::N_PARTS).map(in_part).fold(f64::INFINITY, f64::min)
    }
}

impl Balls for RoundSegment {
    const N_PARTS: u32 = 1;

    fn ball(&self, s: f64) -> Ball {
        let [a, b] = self.ends.map(|end| end.map(f64::from));
        let [r, q] = self.radii.map(f64::from);
        let at = |k: usize| a[k] + s * (b[k] - a[k]);
        [at(0), at(1), at(2), r + s * (q - r)]
    }
}

impl Balls for RoundCubic {
    const N_PARTS: u32 = 64;

    fn ball(&self, s: f64) -> Ball {
        self.ball(s).0
    }
}

impl Balls for RibbonSegment {
    const IS_UNION: bool = false;
    const N_PARTS: u32 = 1;

    fn ball(&self, s: f64) -> Ball {
        RoundSegment { ends: self.ends, radii: self.radii }.ball(s)
    }
}

impl Balls for RibbonCubic {
    const IS_UNION: bool = false;
    const N_PARTS: u32 = 64;

    fn ball(&self, s: f64) -> Ball {
        Balls::ball(&RoundCubic { points: self.points, radii: self.radii }, s)
    }
}

impl Balls for Sphere {
    const N_PARTS: u32 = 1;

    fn ball(&self, _: f64) -> Ball {
        let [x, y, z] = self.center.map(f64::from);
        [x, y, z, self.radius.into()]
    }
}

/// Sizes and places of a scene.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) name: &'static str,
    pub(super) scale: f32,
    pub(super) offset: f32,
}

pub(super) const PLACES: [Place; 3] = [
    Place { name: "of size 1", scale: 1.0, offset: 0.0 },
    Place { name: "at 1e7", scale: 1.0, offset: 1e7 },
    Place { name: "of size 1e-6", scale: 1e-6, offset: 0.0 },
];

fn point(rng: &mut SplitMix64, place: Place, size: f64) -> [f32; 3] {
    rng.signed3().map(|x| place.offset + place.scale * (size * x) as f32)
}

/// Kinds of segments: length and radii, relative to the scene.
const SEGMENTS: [(&str, f64, [f32; 2]); 5] = [
    ("segments, radius 1e-6 of the length", 1.0, [1e-6, 1e-6]),
    ("segments, radius changing 1000-fold", 1.0, [0.2, 2e-4]),
    ("segments, thick as long", 0.1, [0.1, 0.05]),
    ("segments without length", 0.0, [0.05, 0.02]),
    ("segments that begin in a point", 0.7, [0.0, 0.03]),
];

fn segments(rng: &mut SplitMix64, place: Place, length: f64, radii: [f32; 2]) -> Vec<RoundSegment> {
    let segment = |_| {
        let (a, along) = (point(rng, place, 1.0), rng.on_sphere());
        let b = std::array::from_fn(|k| a[k] + place.scale * (length * along[k]) as f32);
        RoundSegment { ends: [a, b], radii: radii.map(|radius| place.scale * radius) }
    };
    (0..120).map(segment).collect()
}

/// Control points of a curve from random ones.
type Form = fn([[f32; 3]; 4]) -> [[f32; 3]; 4];

/// Kinds of cubic curves, with their radii.
const CUBICS: [(&str, Form, [f32; 4]); 5] = [
    ("curves with loops", |[a, b, c, _]| [a, b, c, a], [0.02; 4]),
    ("curves with a cusp", |[a, b, _, d]| [a, d, b, a], [0.01, 0.05, 0.05, 0.01]),
    ("curves of coincident control points", |[a, ..]| [a; 4], [0.1, 0.1, 0.05, 0.05]),
    ("curves bent more than they are thick", |points| points, [0.5; 4]),
    ("curves, radius 1e-6 of the length", |points| points, [1e-6; 4]),
];

fn cubics(rng: &mut SplitMix64, place: Place, form: Form, radii: [f32; 4]) -> Vec<RoundCubic> {
    let curve = |_| {
        let points = form(std::array::from_fn(|_| point(rng, place, 1.0)));
        RoundCubic { points, radii: radii.map(|radius| place.scale * radius) }
    };
    (0..40).map(curve).collect()
}

/// The ribbon with the silhouette of a segment, followed by one at a right angle.
fn ribbon(segment: &RoundSegment) -> RibbonSegment {
    let RoundSegment { ends: [a, b], radii } = *segment;
    RibbonSegment { ends: [a, b], radii, next: [b[0] + (b[1] - a[1]), b[1] - (b[0] - a[0]), b[2]] }
}

/// The ribbon with the silhouette of a curve, followed by one that leads back to its start.
fn cubic_ribbon(curve: &RoundCubic) -> RibbonCubic {
    RibbonCubic { points: curve.points, radii: curve.radii, next: curve.points[0] }
}

/// Rays at the middle, the silhouette and beside of balls, from outside and within.
fn rays<P: Balls>(rng: &mut SplitMix64, place: Place, all: &[P], n: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let [x, y, z, radius] = all[rng.below(all.len())].ball(rng.unit());
        let off = radius * [0.0, 0.9, 1.0, 1.0 + 1e-6, 1.3][i % 5];
        let (from, side) = (rng.on_sphere(), rng.on_sphere());
        let away = [0.0, 3.0, 50.0][i / 5 % 3] * f64::from(place.scale);
        // Across the view, so that the line touches the ball where it is off by the radius.
        let along: f64 = (0..3).map(|k| from[k] * side[k]).sum();
        let across: [f64; 3] = std::array::from_fn(|k| side[k] - along * from[k]);
        let length = across.iter().map(|x| x * x).sum::<f64>().sqrt();
        let target: [f64; 3] = std::array::from_fn(|k| [x, y, z][k] + off * across[k] / length);
        let origin: [f32; 3] = std::array::from_fn(|k| (target[k] + away * from[k]) as f32);
        let direction: [f32; 3] =
            std::array::from_fn(
                |k| if away == 0.0 { from[k] as f32 } else { (target[k] - f64::from(origin[k])) as f32 },
            );
        Ray::new(origin, direction)
    };
    (0..n).map(ray).filter(|ray| ray.direction.iter().any(|&d| d != 0.0)).collect()
}

/// What a loop over all primitives hits first.
pub(super) fn looped<P: Primitive>(all: &[P], ray: &Ray) -> Option<Hit> {
    let scaled = ScaledRay::new(ray)?;
    let one = |(i, primitive): (u32, &P)| {
        let PrimitiveHit { t, u, v, side } = primitive.intersect(&scaled, scaled.t_max)?;
        Some(Hit { t: scaled.caller_t(t), u, v, side, primitive: PrimId(i), instance: InstanceId(0) })
    };
    (0..).zip(all).filter_map(one).reduce(|first, hit| if hit.t < first.t { hit } else { first })
}

/// The stated error at a primitive, as a distance.
fn error<P: Balls>(primitive: &P, ray: &Ray) -> f64 {
    let bounds = primitive.bounds();
    let reach = (0..3).map(|k| (bounds.min[k] - ray.origin[k]).abs().max((bounds.max[k] - ray.origin[k]).abs()));
    3.0_f64.sqrt() * f64::from(HIT_ERROR) * f64::from(reach.fold(0.0, f32::max))
}

/// Whether the line passes through the inside of a primitive after its start, by more than the error: at the points nearest to some of its balls.
fn passes<P: Balls>(primitive: &P, ray: &Ray) -> bool {
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let squared: f64 = d.iter().map(|x| x * x).sum();
    let error = error(primitive, ray);
    (0..=32).any(|i| {
        let [x, y, z, radius] = primitive.ball(f64::from(i) / 32.0);
        let t = (0..3).map(|k| ([x, y, z][k] - o[k]) * d[k]).sum::<f64>() / squared;
        let off: f64 = (0..3).map(|k| ([x, y, z][k] - o[k] - t * d[k]).powi(2)).sum::<f64>().sqrt();
        t > 0.0 && radius - off > error
    })
}

/// The rows of one case; `tested` are the primitives that the loop tests, which are the same but in a test of these rows.
fn rows_of<P: Balls>(case: &'static str, place: Place, [all, tested]: [&[P]; 2], rays: &[Ray]) -> Vec<Row> {
    let same = Promise::none("curve", leaked(case, place), SAME, Oracle::Loop, "rays");
    let near = Promise { promise: NEAR, oracle: Oracle::Structure, bound: 1.0, unit: "of the stated error", ..same };
    let found = Promise { promise: FOUND, oracle: Oracle::Structure, ..same };
    let wants: Vec<Option<Hit>> = rays.iter().map(|ray| looped(tested, ray)).collect();
    let key = |hit: Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.u.to_bits(), hit.primitive, hit.side));
    let mut rows = vec![];
    for (name, preset) in [("dynamic", Preset::Dynamic), ("balanced", Preset::Balanced), ("quality", Preset::Quality)] {
        let bvh = WideBvh::over_with(all.to_vec(), preset).expect("bounds are finite");
        for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
            let bvh = bvh.clone().with_path(path);
            let differs = |(ray, want): (&Ray, &Option<Hit>)| {
                key(bvh.closest_hit(ray)) != key(*want) || bvh.occluded(ray) != want.is_some()
            };
            let n_other = rays.iter().zip(&wants).filter(|&pair| differs(pair)).count();
            rows.push(same.count(format!("WideBvh {name}, {}", path.name()), rays.len(), n_other));
        }
    }
    let hits = || rays.iter().zip(&wants).filter_map(|(ray, hit)| Some((ray, hit.as_ref()?)));
    let off = |(ray, hit): (&Ray, &Hit)| {
        let primitive = &all[hit.primitive.index()];
        let distance = primitive.distance(ray.at(f64::from(hit.t)));
        (if P::IS_UNION { distance.abs() } else { distance.max(0.0) }) / error(primitive, ray)
    };
    rows.push(near.row("the primitive's test", hits().count(), hits().map(off).fold(0.0, f64::max)));
    if !P::IS_UNION {
        return rows;
    }
    let through = |ray: &Ray| all.iter().any(|primitive| passes(primitive, ray));
    let certain: Vec<_> = rays.iter().zip(&wants).filter(|(ray, _)| through(ray)).collect();
    let n_lost = certain.iter().filter(|(_, want)| want.is_none()).count();
    rows.push(found.count_certain("the primitive's test", certain.len(), n_lost));
    rows
}

/// A row of primitives that move to others of `all` while the shutter is open, by as much as the scene is wide; the loop tests those `between` both at
/// the time of each ray.
pub(super) fn row_of_motion<P: Moves>(
    stage: &'static str,
    case: &str,
    place: Place,
    all: &[P],
    rays: &[Ray],
    between: impl Fn(&P, &P, f32) -> P,
) -> Row {
    let promise = Promise::none(stage, leaked(&format!("moving {case}"), place), SAME, Oracle::Loop, "rays");
    let shapes: Vec<Moving<P>> = (1..).zip(all).map(|(i, &open)| Moving { open, close: all[i % all.len()] }).collect();
    let bvh = WideBvh::over_with(shapes.clone(), Preset::Quality).expect("bounds are finite");
    let key = |hit: Option<Hit>| hit.map(|hit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.primitive, hit.side));
    let times = [0.0, 1.0 / 3.0, 0.7, 1.0];
    let differs = |(i, ray): (usize, &Ray)| {
        let ray = ray.at_time(times[i % times.len()]);
        let at_time: Vec<P> = shapes.iter().map(|Moving { open, close }| between(open, close, ray.time)).collect();
        key(bvh.closest_hit(&ray)) != key(looped(&at_time, &ray))
    };
    let n_other = rays.iter().enumerate().filter(|&pair| differs(pair)).count();
    promise.count("WideBvh quality", rays.len(), n_other)
}

/// The name of a case at a place; rows refer to it for as long as the program runs.
pub(super) fn leaked(case: &str, place: Place) -> &'static str {
    Box::leak(format!("{case}, {}", place.name).into_boxed_str())
}

/// The name of the same case of ribbons.
fn leaked_ribbons(case: &str) -> &'static str {
    Box::leak(format!("ribbons: {case}").into_boxed_str())
}

/// A closed chain: each segment is a solid, so that all of its entries and exits are as many.
fn chains(effort: usize) -> Row {
    let mut rng = SplitMix64::new(31);
    let promise = Promise::none("curve", "closed chains of segments", EVEN, Oracle::Structure, "lines");
    let (mut n_lines, mut n_odd, mut hits) = (0, 0, vec![]);
    for _ in 0..20 {
        let corners: Vec<[f32; 3]> = (0..12).map(|_| rng.signed3().map(|x| x as f32)).collect();
        let radii: Vec<f32> = (0..12).map(|i| [0.05, 1e-3][i % 2]).collect();
        let segment = |i: usize| RoundSegment {
            ends: [corners[i], corners[(i + 1) % 12]],
            radii: [radii[i], radii[(i + 1) % 12]],
        };
        let all: Vec<_> = (0..12).map(segment).collect();
        let bvh = WideBvh::over(all.clone()).expect("bounds are finite");
        for i in 0..100 * effort {
            // From far outside, at joints and between them.
            let [x, y, z, radius] = all[i % 12].ball([0.0, rng.unit()][i % 2]);
            let (from, side) = (rng.on_sphere(), rng.on_sphere());
            let origin: [f32; 3] = from.map(|x| 9.0 * x as f32);
            let target: [f64; 3] = std::array::from_fn(|k| [x, y, z][k] + radius * side[k]);
            let ray = Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32));
            if ScaledRay::new(&ray).is_some() {
                n_lines += 1;
                bvh.all_hits(&ray, &mut hits);
                n_odd += usize::from(!hits.len().is_multiple_of(2));
            }
        }
    }
    promise.count("WideBvh balanced", n_lines, n_odd)
}

/// The rows of all kinds of curves.
#[must_use]
pub fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    for place in PLACES {
        let mut rng = SplitMix64::new(30);
        for (case, length, radii) in SEGMENTS {
            let all = segments(&mut rng, place, length, radii);
            let rays = rays(&mut rng, place, &all, 300 * effort);
            rows.extend(rows_of(case, place, [&all; 2], &rays));
            rows.push(row_of_motion("curve", case, place, &all, &rays, Moves::between));
            let ribbons: Vec<_> = all.iter().map(ribbon).collect();
            rows.extend(rows_of(leaked_ribbons(case), place, [&ribbons; 2], &rays));
        }
        for (case, form, radii) in CUBICS {
            let all = cubics(&mut rng, place, form, radii);
            let rays = rays(&mut rng, place, &all, 60 * effort);
            rows.extend(rows_of(case, place, [&all; 2], &rays));
            rows.push(row_of_motion("curve", case, place, &all, &rays, Moves::between));
            let ribbons: Vec<_> = all.iter().map(cubic_ribbon).collect();
            rows.extend(rows_of(leaked_ribbons(case), place, [&ribbons; 2], &rays));
        }
        let sphere = |_| Sphere { center: point(&mut rng, place, 1.0), radius: place.scale * 0.05 };
        let all: Vec<Sphere> = (0..120).map(sphere).collect();
        let rays = rays(&mut rng, place, &all, 300 * effort);
        rows.extend(rows_of("spheres", place, [&all; 2], &rays));
        rows.push(row_of_motion("curve", "spheres", place, &all, &rays, Moves::between));
    }
    rows.push(chains(effort));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinner_segments_break_every_promise() {
        let mut rng = SplitMix64::new(1);
        let (case, length, radii) = SEGMENTS[2];
        let all = segments(&mut rng, PLACES[0], length, radii);
        let thinner: Vec<_> =
            all.iter().map(|segment| RoundSegment { radii: radii.map(|r| 0.5 * r), ..*segment }).collect();
        let rays = rays(&mut rng, PLACES[0], &all, 300);
        assert!(rows_of(case, PLACES[0], [&all; 2], &rays).iter().all(Row::holds));
        assert!(rows_of(case, PLACES[0], [&all, &thinner], &rays).iter().all(Row::is_broken));
    }

    #[test]
    fn what_stands_still_breaks_the_promise_of_motion() {
        let mut rng = SplitMix64::new(1);
        let (case, length, radii) = SEGMENTS[2];
        let all = segments(&mut rng, PLACES[0], length, radii);
        let rays = rays(&mut rng, PLACES[0], &all, 300);
        assert!(row_of_motion("curve", case, PLACES[0], &all, &rays, Moves::between).holds());
        assert!(row_of_motion("curve", case, PLACES[0], &all, &rays, |open, _, _| *open).is_broken());
    }

    #[test]
    fn wider_ribbons_break_every_promise() {
        let mut rng = SplitMix64::new(1);
        let (case, form, radii) = CUBICS[0];
        let all: Vec<_> = cubics(&mut rng, PLACES[0], form, radii).iter().map(cubic_ribbon).collect();
        let wider: Vec<_> = all.iter().map(|ribbon| RibbonCubic { radii: radii.map(|r| 2.0 * r), ..*ribbon }).collect();
        let rays = rays(&mut rng, PLACES[0], &all, 300);
        assert!(rows_of(case, PLACES[0], [&all; 2], &rays).iter().all(Row::holds));
        assert!(rows_of(case, PLACES[0], [&all, &wider], &rays).iter().all(Row::is_broken));
    }
}
