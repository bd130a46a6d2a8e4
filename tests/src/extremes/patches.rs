//! Bicubic patches at their limits: crossing themselves, folded, with collapsed edges, coincident control points, far away and tiny.

use canted_fixtures::SplitMix64;
use canted_trace::{BezierPatch, HIT_ERROR, Hit, Intersect, Ray, ScaledRay, Side};
use canted_wide::{Moves, Preset, SimdPath, WideBvh};

use super::curves::{NEAR, PLACES, Place, leaked, looped, row_of_motion};
use super::{Oracle, Promise, Row, hierarchy::SAME};

/// Hits from the front and from the back.
const EVEN: &str = "a line enters a closed surface as often as it leaves it";

type Points = [[[f32; 3]; 4]; 4];

/// Control points from random ones.
type Form = fn(Points) -> Points;

const FORMS: [(&str, Form); 6] = [
    ("patches", |points| points),
    ("patches with a collapsed edge", |mut points| {
        points[0] = [points[0][0]; 4];
        points
    }),
    ("patches folded flat", |points| [points[0], points[1], points[1], points[0]]),
    ("patches of coincident control points", |points| points.map(|[a, b, ..]| [a, b, b, b])),
    ("patches that are a curve", |points| points.map(|[a, ..]| [a; 4])),
    ("patches in a plane", |points| points.map(|row| row.map(|[x, y, _]| [x, y, 0.25 * x]))),
];

fn patches(rng: &mut SplitMix64, place: Place, form: Form) -> Vec<BezierPatch> {
    let patch = |_| {
        let center = rng.signed3();
        let mut points = Points::default();
        for (i, row) in points.iter_mut().enumerate() {
            for (j, point) in row.iter_mut().enumerate() {
                let (grid, off) = ([0.2 * i as f64, 0.2 * j as f64, 0.0], rng.signed3());
                *point = std::array::from_fn(|k| (center[k] + grid[k] + 0.25 * off[k]) as f32);
            }
        }
        BezierPatch { points: form(points).map(|row| row.map(|p| p.map(|x| place.offset + place.scale * x))) }
    };
    (0..40).map(patch).collect()
}

/// Six patches around a cube, whose control points are moved at random.
fn closed(seed: u64, place: Place) -> Vec<BezierPatch> {
    let corner = |at: [i32; 3]| -> [f32; 3] {
        let hash = at.iter().fold(seed, |seed, &x| seed.wrapping_mul(31).wrapping_add((x + 7) as u64));
        let off = SplitMix64::new(hash).signed3();
        std::array::from_fn(|k| place.offset + place.scale * (0.3 * f64::from(at[k]) + 0.6 * off[k]) as f32)
    };
    let side = |n: usize| {
        let (axis, at) = (n / 2, [-3, 3][n % 2]);
        let point = |i: i32, j: i32| {
            let mut lattice = [at; 3];
            let (a, b) = if at > 0 { (i, j) } else { (j, i) };
            (lattice[(axis + 1) % 3], lattice[(axis + 2) % 3]) = (2 * a - 3, 2 * b - 3);
            corner(lattice)
        };
        BezierPatch { points: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| point(i, j))) }
    };
    (0..6).map(side).collect()
}

/// Lines at points, edges and corners, every other one along the surface.
fn lines(rng: &mut SplitMix64, place: Place, all: &[BezierPatch], n: usize) -> Vec<Ray> {
    let line = |i: usize| {
        let mut at = [rng.unit(), rng.unit()];
        match i % 4 {
            0 => at[i / 4 % 2] = [0.0, 1.0, 0.5][i / 8 % 3],
            1 => at = [[0.0, 1.0][i / 4 % 2], [0.0, 1.0][i / 8 % 2]],
            _ => {}
        }
        let [target, by_u, by_v] = all[rng.below(all.len())].at(at);
        let mut from = rng.on_sphere();
        if i.is_multiple_of(2) {
            let (a, b) = (rng.signed(), rng.signed());
            let tangent: [f64; 3] = std::array::from_fn(|k| a * by_u[k] + b * by_v[k]);
            let length = tangent.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.0 {
                from = tangent.map(|x| x / length);
            }
        }
        let away = f64::from(place.scale) * 20.0;
        let origin: [f32; 3] = std::array::from_fn(|k| (target[k] + away * from[k]) as f32);
        Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
    };
    (0..n).map(line).filter(|ray| ScaledRay::new(ray).is_some()).collect()
}

/// The distance of a hit from the point at its parameters, relative to the stated error and what the rounding of both parameters adds.
fn off(patch: &BezierPatch, ray: &Ray, hit: &Hit) -> f64 {
    let points = patch.points.as_flattened();
    let reach = points.iter().flat_map(|p| (0..3).map(|k| (p[k] - ray.origin[k]).abs())).fold(0.0, f32::max);
    let [point, by_u, by_v] = patch.at([hit.u, hit.v].map(f64::from));
    let at = ray.at(f64::from(hit.t));
    // Half a unit in the last place of a parameter is 2^-25 at most.
    let rounding = |k: usize| (by_u[k].abs() + by_v[k].abs()) / f64::from(1 << 25);
    let part = |k: usize| (at[k] - point[k]).abs() / (f64::from(HIT_ERROR) * f64::from(reach) + rounding(k));
    (0..3).map(part).fold(0.0, f64::max)
}

/// The rows of one case; `tested` are the patches that the loop tests, which are the same but in a test of these rows.
fn rows_of(case: &str, place: Place, [all, tested]: [&[BezierPatch]; 2], rays: &[Ray]) -> Vec<Row> {
    let same = Promise::none("patch", leaked(case, place), SAME, Oracle::Loop, "rays");
    let near = Promise { promise: NEAR, oracle: Oracle::Structure, bound: 1.0, unit: "of the stated error", ..same };
    let wants: Vec<Option<Hit>> = rays.iter().map(|ray| looped(tested, ray)).collect();
    let key = |hit: Option<Hit>| hit.map(|hit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.primitive, hit.side));
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
    let hits: Vec<_> = rays.iter().zip(&wants).filter_map(|(ray, hit)| Some((ray, hit.as_ref()?))).collect();
    // A patch that is a curve has no surface.
    if !hits.is_empty() {
        let worst = hits.iter().map(|(ray, hit)| off(&all[hit.primitive.index()], ray, hit)).fold(0.0, f64::max);
        rows.push(near.row("the patch's test", hits.len(), worst));
    }
    rows
}

/// Lines through closed surfaces; `open` is the distance by which a control point of one patch is moved.
fn closed_row(place: Place, effort: usize, open: f32) -> Row {
    let mut rng = SplitMix64::new(33);
    let promise = Promise::none("patch", leaked("closed surfaces", place), EVEN, Oracle::Structure, "lines");
    let (mut n_lines, mut n_odd, mut hits) = (0, 0, vec![]);
    for seed in 0..10 {
        let mut surface = closed(seed, place);
        let lines = lines(&mut rng, place, &surface, 200 * effort);
        surface[0].points[0][1][1] += place.scale * open;
        let bvh = WideBvh::over(surface).expect("bounds are finite");
        for line in &lines {
            bvh.all_hits(line, &mut hits);
            let n_front = hits.iter().filter(|hit| hit.side == Side::Front).count();
            n_odd += usize::from(2 * n_front != hits.len());
        }
        n_lines += lines.len();
    }
    promise.count("WideBvh balanced", n_lines, n_odd)
}

/// The rows of all kinds of patches.
pub(super) fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    for place in PLACES {
        let mut rng = SplitMix64::new(32);
        for (case, form) in FORMS {
            let all = patches(&mut rng, place, form);
            let rays = lines(&mut rng, place, &all, 60 * effort);
            rows.extend(rows_of(case, place, [&all; 2], &rays));
            rows.push(row_of_motion("patch", case, place, &all, &rays, Moves::between));
        }
        rows.push(closed_row(place, effort, 0.0));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_patches_break_every_promise() {
        let mut rng = SplitMix64::new(1);
        let (case, form) = FORMS[0];
        let all = patches(&mut rng, PLACES[0], form);
        let moved =
            |patch: &BezierPatch| BezierPatch { points: patch.points.map(|row| row.map(|p| p.map(|x| x + 0.01))) };
        let other: Vec<_> = all.iter().map(moved).collect();
        let rays = lines(&mut rng, PLACES[0], &all, 300);
        assert!(rows_of(case, PLACES[0], [&all; 2], &rays).iter().all(Row::holds));
        assert!(rows_of(case, PLACES[0], [&all, &other], &rays).iter().all(Row::is_broken));
        assert!(closed_row(PLACES[0], 1, 0.0).holds() && closed_row(PLACES[0], 10, 0.01).is_broken());
    }
}
