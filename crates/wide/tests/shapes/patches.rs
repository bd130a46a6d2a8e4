//! Bicubic patches against Newton's method from many starts, closed surfaces of them, and the loop over all patches.

use canted_fixtures::SplitMix64;
use canted_trace::{BezierPatch, Intersect as _, Ray, ScaledRay, Side};
use canted_wide::{Config, Preset, Primitive as _, PrimitiveHit, Refit, SimdPath, WideBvh};

type Vector = [f64; 3];
type Points = [[[f32; 3]; 4]; 4];

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

fn wide(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

fn points(point: impl Fn(usize, usize) -> [f32; 3]) -> Points {
    std::array::from_fn(|i| std::array::from_fn(|j| point(i, j)))
}

/// All hits of a patch, in order.
fn hits(patch: &BezierPatch, ray: &Ray) -> Vec<PrimitiveHit> {
    let mut scaled = ScaledRay::new(ray).expect("a valid ray");
    let mut all = vec![];
    while let Some(hit) = patch.intersect(&scaled, f32::INFINITY) {
        scaled.t_min = hit.t.next_up();
        all.push(PrimitiveHit { t: scaled.caller_t(hit.t), ..hit });
    }
    all
}

/// From gentle to crossing itself many times, folded, bent at right angles, and with edges that are one point.
fn patches(rng: &mut SplitMix64) -> Vec<BezierPatch> {
    let mut all = vec![];
    for wildness in [0.0, 0.2, 0.5, 1.0, 3.0] {
        for _ in 0..4 {
            let mut net = points(|i, j| [i as f32 - 1.5, j as f32 - 1.5, 0.0]);
            for point in net.as_flattened_mut() {
                let off = rng.signed3();
                *point = std::array::from_fn(|k| point[k] + (wildness * off[k]) as f32);
            }
            all.push(BezierPatch { points: net });
        }
    }
    // A quarter of a bowl with a collapsed edge; a fold; a corner of a pipe.
    all.push(BezierPatch {
        points: points(|i, j| {
            let angle = 0.5 * i as f32;
            [j as f32 * angle.cos(), j as f32 * angle.sin(), 0.3 * (j * j) as f32]
        }),
    });
    all.push(BezierPatch { points: points(|i, j| [[0.0, 2.0, 2.0, 0.0][i], j as f32, 0.2 * i as f32]) });
    all.push(BezierPatch { points: points(|i, j| [[0.0, 0.0, 1.0, 2.0][i], j as f32, [2.0, 1.0, 0.0, 0.0][i]]) });
    all
}

/// A ray at a point of the patch or near its hull, from afar and from near; every fourth along a tangent.
fn ray_at(patch: &BezierPatch, rng: &mut SplitMix64, i: usize) -> Ray {
    let at = [rng.unit(), rng.unit()];
    let [target, by_u, by_v] = patch.at(at);
    let mut from = rng.on_sphere();
    if i.is_multiple_of(4) {
        let (a, b) = (rng.signed(), rng.signed());
        let tangent: Vector = std::array::from_fn(|k| a * by_u[k] + b * by_v[k]);
        if length(tangent) > 1e-3 {
            from = tangent.map(|x| x / length(tangent));
        }
    }
    let off = [0.0, 0.0, 0.3][i % 3];
    let side = rng.on_sphere();
    let away = [8.0, 0.5][i / 4 % 2];
    let origin = std::array::from_fn(|k| (target[k] + off * side[k] + away * from[k]) as f32);
    Ray::new(origin, from.map(|x| -x as f32))
}

/// A root by Newton's method: parameters, `t`, and the sine of the angle between ray and surface.
type Root = ([f64; 2], f64, f64);

/// All roots of a line within the patch, with a little around it, from a grid of starts, and from some more.
fn roots(patch: &BezierPatch, ray: &Ray, more: &[PrimitiveHit]) -> Vec<Root> {
    const N: usize = 20;
    let (o, d) = (wide(ray.origin), wide(ray.direction));
    let mut found: Vec<Root> = vec![];
    let grid = (0..N * N).map(|start| [start % N, start / N].map(|i| (i as f64 + 0.5) / N as f64));
    for mut at in grid.chain(more.iter().map(|hit| [hit.u, hit.v].map(f64::from))) {
        let mut is_root = false;
        for _ in 0..30 {
            // p + u·P_u + v·P_v - t·d = 0, by Cramer's rule.
            let [p, by_u, by_v] = patch.at(at);
            let to = sub(o, p);
            let normal = cross(by_u, by_v);
            let determinant = dot(normal, d);
            let step = [dot(cross(to, by_v), d) / determinant, dot(cross(by_u, to), d) / determinant];
            at = [at[0] + step[0], at[1] + step[1]];
            if !at.iter().all(|x| (-0.5..=1.5).contains(x)) {
                break;
            }
            is_root = step[0].abs() + step[1].abs() < 1e-11;
            if is_root {
                break;
            }
        }
        if is_root && !found.iter().any(|(other, ..)| (0..2).all(|k| (other[k] - at[k]).abs() < 1e-7)) {
            let [p, by_u, by_v] = patch.at(at);
            let normal = cross(by_u, by_v);
            let sine = dot(normal, d) / (length(by_u) * length(by_v) * length(d));
            found.push((at, dot(sub(p, o), d) / dot(d, d), sine));
        }
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    found
}

/// Rays whose hits the oracle knows, their hits, rays with several, and rays with other hits on `tested` than the oracle finds.
fn compare(all: &[BezierPatch], tested: &[BezierPatch], n_rays: usize) -> [usize; 4] {
    let mut rng = SplitMix64::new(11);
    let mut counts = [0; 4];
    for (patch, tested) in all.iter().zip(tested) {
        for i in 0..n_rays {
            let ray = ray_at(patch, &mut rng, i);
            // A hit that is no root is not found from there either.
            let found = hits(tested, &ray);
            let roots = roots(patch, &ray, &found);
            // Near an edge, nearly along the surface, near the start, and next to another, a root is not certain.
            // Of two hits with a silhouette between them, the height of the arc over the ray is about this.
            let is_silhouette = |a: &Root, b: &Root| (b.1 - a.1) * a.2.abs().min(b.2.abs()) < 1e-5;
            let near_edge = |x: f64| x.abs() < 1e-6 || (x - 1.0).abs() < 1e-6;
            if roots.iter().any(|&(at, t, sine)| at.into_iter().any(near_edge) || sine.abs() < 1e-4 || t.abs() < 1e-5)
                || roots.windows(2).any(|pair| pair[1].1 - pair[0].1 < 1e-4 || is_silhouette(&pair[0], &pair[1]))
            {
                continue;
            }
            let is_within = |(at, t, _): &&Root| *t > 0.0 && at.iter().all(|x| (0.0..=1.0).contains(x));
            let want: Vec<&Root> = roots.iter().filter(is_within).collect();
            let is_same = want.len() == found.len()
                && want.iter().zip(&found).all(|((at, t, sine), hit)| {
                    let off = (t - f64::from(hit.t)).abs() + 0.1 * (at[0] - f64::from(hit.u)).abs();
                    let side = if *sine < 0.0 { Side::Front } else { Side::Back };
                    off + 0.1 * (at[1] - f64::from(hit.v)).abs() < 2e-5 && hit.side == side
                });
            counts[0] += 1;
            counts[1] += want.len();
            counts[2] += usize::from(want.len() > 1);
            counts[3] += usize::from(!is_same);
        }
    }
    counts
}

#[test]
fn patches_are_hit_where_newton_finds_roots() {
    let all = patches(&mut SplitMix64::new(5));
    let [n, n_hits, n_several, n_other] = compare(&all, &all, 200);
    assert!(n_other == 0 && n > 3000 && n_hits > 3000 && n_several > 400, "{n_other} of {n}, {n_hits}, {n_several}");
}

/// The comparison finds a control point that is off by a little.
#[test]
fn the_comparison_finds_other_patches() {
    let all = patches(&mut SplitMix64::new(5));
    let mut other = all.clone();
    other.iter_mut().for_each(|patch| patch.points[1][2][1] += 0.01);
    let [n, .., n_other] = compare(&all, &other, 50);
    assert!(3 * n_other > n, "{n_other} of {n}");
}

/// Whatever the patch, each hit lies at the point of its parameters, within the stated error.
#[test]
fn hits_lie_on_the_surface() {
    let mut rng = SplitMix64::new(6);
    let mut n_hits = 0;
    for patch in patches(&mut rng) {
        for i in 0..2000 {
            let ray = ray_at(&patch, &mut rng, i);
            for hit in hits(&patch, &ray) {
                n_hits += 1;
                let [p, ..] = patch.at([hit.u, hit.v].map(f64::from));
                let off = sub(ray.at(f64::from(hit.t)), p).into_iter().fold(0.0, |off: f64, x| off.max(x.abs()));
                let to_point = |point: &[f32; 3]| (0..3).map(|k| (point[k] - ray.origin[k]).abs()).fold(0.0, f32::max);
                let reach = patch.points.as_flattened().iter().map(to_point).fold(0.0, f32::max);
                // Parameters are rounded, too: by 2^-25 of derivatives of at most three extents, each twice the reach.
                let error = f64::from(f32::EPSILON) * f64::from(reach) * (6.5 + 6.0);
                assert!(off <= error, "{patch:?} {ray:?} {hit:?}: {off:e} of {error:e}");
            }
        }
    }
    assert!(n_hits > 20_000, "{n_hits}");
}

/// Six patches around a cube, whose control points are on its surface; the same function of the place gives the points that edges share.
fn around_cube(place: impl Fn([i32; 3]) -> [f32; 3]) -> Vec<BezierPatch> {
    let mut all = vec![];
    for axis in 0..3 {
        for side in [-3, 3] {
            let lattice = |i: usize, j: usize| {
                let mut at = [side; 3];
                // Seen from outside, the first parameter runs to the right and the second one up.
                let (a, b) = if side > 0 { (i, j) } else { (j, i) };
                at[(axis + 1) % 3] = 2 * a as i32 - 3;
                at[(axis + 2) % 3] = 2 * b as i32 - 3;
                place(at)
            };
            all.push(BezierPatch { points: points(lattice) });
        }
    }
    all
}

/// A surface of revolution between two poles, each a collapsed edge: as the lid of a teapot, closed below.
fn lid(n_around: usize) -> Vec<BezierPatch> {
    // Radius and height of the control points from pole to pole; four of a quarter circle and its tangents.
    let profile = [[0.0, 2.0], [1.0, 2.2], [0.3, 1.2], [1.0, 1.0], [2.0, 0.7], [1.8, -0.5], [0.5, -1.0], [0.0, -1.0]];
    let profile = |segment: usize, j: usize| profile[if segment == 0 { j } else { 3 + j + usize::from(j == 3) }];
    let around = |corner: usize| {
        let angle = std::f64::consts::TAU * (corner % n_around) as f64 / n_around as f64;
        [angle.cos(), angle.sin()]
    };
    let mut all = vec![];
    for segment in 0..2 {
        for corner in 0..n_around {
            let (a, b) = (around(corner), around(corner + 1));
            let reach = 4.0 / 3.0 * (std::f64::consts::PI / (2.0 * n_around as f64)).tan();
            let circle = [a, [a[0] - reach * a[1], a[1] + reach * a[0]], [b[0] + reach * b[1], b[1] - reach * b[0]], b];
            let point = |i: usize, j: usize| {
                let [radius, height] = profile(segment, j);
                [(radius * circle[i][0]) as f32, (radius * circle[i][1]) as f32, height as f32]
            };
            all.push(BezierPatch { points: points(point) });
        }
    }
    all
}

/// Closed surfaces: like a sphere, wildly crossing themselves, flattened, needles, far away, tiny, with poles.
fn closed_surfaces() -> Vec<Vec<BezierPatch>> {
    let sphere = |at: [i32; 3]| {
        let length = (at.iter().map(|x| x * x).sum::<i32>() as f32).sqrt();
        at.map(|x| 1.7 * x as f32 / length)
    };
    let random = |at: [i32; 3], size: f64| {
        let seed = at.iter().fold(77_u64, |seed, &x| seed * 31 + (x + 7) as u64);
        let off = SplitMix64::new(seed).signed3();
        std::array::from_fn(|k| 0.5 * at[k] as f32 + (size * off[k]) as f32)
    };
    let map = |all: Vec<BezierPatch>, f: &dyn Fn([f32; 3]) -> [f32; 3]| -> Vec<BezierPatch> {
        all.into_iter().map(|patch| BezierPatch { points: patch.points.map(|row| row.map(f)) }).collect()
    };
    vec![
        around_cube(sphere),
        around_cube(|at| random(at, 0.3)),
        around_cube(|at| random(at, 2.0)),
        // The corners of a cube: each face is flat, and rays along it see it edge-on.
        around_cube(|at| at.map(|x| 0.5 * x as f32)),
        around_cube(|at| [random(at, 0.2)[0], random(at, 0.3)[1], 0.0]),
        map(around_cube(|at| random(at, 0.3)), &|[x, y, z]| [x, 1e-4 * y, 1e-6 * z]),
        map(around_cube(|at| random(at, 0.3)), &|[x, y, z]| [x + 1e7, y, z - 3e6]),
        map(around_cube(|at| random(at, 0.5)), &|p| p.map(|x| 1e-6 * x)),
        map(around_cube(sphere), &|[x, y, z]| [x + 40.0 * y, y, -z]),
        around_cube(|_| [0.25; 3]),
        lid(4),
        map(lid(3), &|[x, y, z]| [x, 0.01 * y + x, z]),
        // Only integers, so that lines through corners and edges are exact.
        around_cube(|at| random(at, 1.0).map(f32::round)),
    ]
}

/// Lines at points, edges, corners, silhouettes and axes of a surface that start outside and end behind it.
fn lines(surface: &[BezierPatch], rng: &mut SplitMix64, n: usize) -> Vec<Ray> {
    let all = surface.iter().flat_map(|patch| patch.points.as_flattened().iter());
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for point in all {
        low = std::array::from_fn(|k| low[k].min(point[k]));
        high = std::array::from_fn(|k| high[k].max(point[k]));
    }
    let size = (0..3).map(|k| f64::from(high[k] - low[k])).fold(1e-3, f64::max);
    let line = |i: usize| {
        let patch = &surface[rng.below(surface.len())];
        let steps = [0.0, 0.25, 0.5, 1.0, 1.0 / 3.0, 1e-9, 1.0];
        let mut at = [rng.unit(), rng.unit()];
        match i % 5 {
            // An edge, a corner, a line at which patches are halved.
            0 => at[i / 5 % 2] = [0.0, 1.0][i / 10 % 2],
            1 => at = [steps[rng.below(7)], steps[rng.below(7)]],
            2 => at[i / 5 % 2] = steps[rng.below(7)],
            _ => {}
        }
        let [mut target, by_u, by_v] = patch.at(at);
        let mut from = rng.on_sphere();
        if i.is_multiple_of(3) {
            // At a silhouette, off it by a little.
            let normal = cross(by_u, by_v);
            let tangent = cross(normal, from);
            if length(tangent) > 0.0 {
                from = tangent.map(|x| x / length(tangent));
                let off = size * [0.0, 1e-12, -1e-9, 1e-7, -1e-7, 1e-5][i / 3 % 6];
                target = std::array::from_fn(|k| target[k] + off * normal[k] / length(normal));
            }
        } else if i.is_multiple_of(7) {
            from = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.8, 0.0]][i / 7 % 4];
        }
        let origin: [f32; 3] = std::array::from_fn(|k| (target[k] + 60.0 * size * from[k]) as f32);
        let to_target = |k: usize| (target[k] - f64::from(origin[k])) as f32;
        let direction = if i.is_multiple_of(2) { std::array::from_fn(to_target) } else { from.map(|x| -x as f32) };
        Ray::new(origin, direction)
    };
    (0..n).map(line).filter(|ray| ScaledRay::new(ray).is_some()).collect()
}

/// Lines with as many hits from the front as from the back, others, and hits.
fn balance(surface: &[BezierPatch], lines: &[Ray]) -> [usize; 3] {
    let bvh = WideBvh::over(surface.to_vec()).expect("finite bounds");
    let (mut counts, mut found) = ([0; 3], vec![]);
    for line in lines {
        bvh.all_hits(line, &mut found);
        let n_front = found.iter().filter(|hit| hit.side == Side::Front).count();
        counts[usize::from(2 * n_front != found.len())] += 1;
        counts[2] += found.len();
    }
    counts
}

#[test]
fn closed_surfaces_are_entered_as_often_as_left() {
    let mut rng = SplitMix64::new(3);
    for (i, surface) in closed_surfaces().iter().enumerate() {
        let lines = lines(surface, &mut rng, 20_000);
        let [_, n_odd, n_hits] = balance(surface, &lines);
        assert_eq!(n_odd, 0, "surface {i}: of {} lines", lines.len());
        // Only a surface that is one point has no hits.
        assert!(n_hits > lines.len() / 20 || i == 9, "surface {i}: {n_hits} hits");
    }
}

/// A control point of one side of an edge that is off by a thousandth, and a patch that is missing, are found.
#[test]
fn surfaces_that_are_not_closed_are_found() {
    let mut rng = SplitMix64::new(3);
    for (i, mut surface) in closed_surfaces().into_iter().enumerate().filter(|(i, _)| [0, 1, 2, 10].contains(i)) {
        let lines = lines(&surface, &mut rng, 20_000);
        surface[1].points[3][1][i % 3] += 1e-3;
        let [_, n_odd, _] = balance(&surface, &lines);
        assert!(n_odd > 5, "surface {i}: {n_odd}");
        surface.pop();
        let [_, n_odd, _] = balance(&surface, &lines);
        assert!(n_odd > lines.len() / 20, "surface {i} without a patch: {n_odd}");
    }
}

/// A later start hides hits but does not change those after it, nor does an earlier end.
#[test]
fn hits_do_not_depend_on_the_interval() {
    let mut rng = SplitMix64::new(19);
    let mut n_later = 0;
    let flat = around_cube(|at| [at[0] as f32, at[1] as f32, 0.0]);
    // Two layers at one `t`, and a patch that is folded onto itself.
    let folded = BezierPatch { points: points(|i, j| [[0.0, 2.0, 2.0, 0.0][i], j as f32, 0.0]) };
    for patch in patches(&mut rng).into_iter().chain(flat).chain([folded]) {
        for i in 0..150 {
            let mut scaled = ScaledRay::new(&ray_at(&patch, &mut rng, i)).expect("a valid ray");
            let mut n = 0;
            while let Some(hit) = patch.intersect(&scaled, f32::INFINITY) {
                n += 1;
                assert_eq!(patch.intersect(&scaled, hit.t), Some(hit));
                if hit.t > scaled.t_min {
                    assert_eq!(patch.intersect(&scaled, hit.t.next_down()), None, "{patch:?} {scaled:?}");
                }
                scaled.t_min = hit.t;
                assert_eq!(patch.intersect(&scaled, f32::INFINITY), Some(hit), "{patch:?} {scaled:?}");
                scaled.t_min = hit.t.next_up();
            }
            n_later += usize::from(n > 1);
        }
    }
    assert!(n_later > 400, "{n_later}");
}

/// Both layers of a folded patch are hit, though they are at one place.
#[test]
fn layers_at_one_place_are_two_hits() {
    let folded = BezierPatch { points: points(|i, j| [[0.0, 2.0, 2.0, 0.0][i], j as f32, 0.0]) };
    let found = hits(&folded, &Ray::new([0.7, 1.3, 4.0], [0.0, 0.0, -1.0]));
    let ts: Vec<f32> = found.iter().map(|hit| hit.t).collect();
    assert_eq!(ts, [4.0, 4.0_f32.next_up()], "{found:?}");
    assert_ne!(found[0].side, found[1].side);
    assert!((found[0].u + found[1].u - 1.0).abs() < 1e-6, "{found:?}");
}

/// What bounds nothing, and what rays see edge-on, is missed; the work is bounded.
#[test]
fn degenerate_patches_are_missed() {
    let down = Ray::new([0.5, 0.5, 4.0], [0.0, 0.0, -1.0]);
    let along = Ray::new([-4.0, 0.5, 0.0], [1.0, 0.0, 0.0]);
    // One point, a line, a plane seen edge-on, a curve along the ray in both parameters at once.
    for net in [
        points(|_, _| [0.5, 0.5, 0.0]),
        points(|i, _| [i as f32, 0.5, 0.0]),
        points(|i, j| [0.5, i as f32, j as f32]),
        points(|i, j| [0.5 * (i + j) as f32 - 1.0, 0.1 * ((i + j) as f32 - 2.5), 0.0]),
    ] {
        assert!(hits(&BezierPatch { points: net }, &down).is_empty(), "{net:?}");
    }
    assert!(hits(&BezierPatch { points: points(|i, j| [i as f32, j as f32, 0.0]) }, &along).is_empty());
    // The curve `c(u + v)`, bent, with rays along its straight lines, which no parameter follows.
    let blossom = |i: usize, j: usize| {
        let [i, j] = [i as f32, j as f32];
        let square = 3.0 * (i * (i - 1.0) + j * (j - 1.0)) + 4.0 * i * j + 18.0 - 12.0 * (i + j);
        [6.0 * (i + j) - 18.0, square, i - j]
    };
    let bent = BezierPatch { points: points(blossom) };
    for i in 0..300 {
        let s = i as f32 / 150.0 - 1.0;
        let ray = Ray::new([18.0 * s, 18.0 * s * s, 50.0], [0.0, 0.0, -1.0]);
        assert!(hits(&bent, &ray).is_empty(), "{ray:?}");
    }
    // Control points that are not finite.
    let mut net = points(|i, j| [i as f32, j as f32, 0.0]);
    for bad in [f32::NAN, f32::INFINITY] {
        net[1][2][1] = bad;
        assert!(hits(&BezierPatch { points: net }, &down).is_empty());
        assert!(WideBvh::over(vec![BezierPatch { points: net }]).is_err());
    }
}

/// The loop over all patches gives the same bits with every preset and path: of usual size, far away, and tiny; saved, loaded and
/// refitted, too.
#[test]
fn hits_do_not_depend_on_the_bvh() {
    let mut rng = SplitMix64::new(13);
    let mut all: Vec<BezierPatch> = (0..3).flat_map(|_| patches(&mut rng)).collect();
    all.iter_mut().enumerate().for_each(|(i, patch)| {
        let off = [(i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32];
        patch.points.as_flattened_mut().iter_mut().for_each(|p| *p = std::array::from_fn(|k| p[k] + 2.0 * off[k]));
    });
    let rays: Vec<Ray> = (0..400).map(|i| ray_at(&all[i % all.len()], &mut rng, i)).collect();
    for (scale, shift) in [(1.0, 0.0), (1024.0, 1e7), (1e-6, 0.0)] {
        let place = |p: [f32; 3]| p.map(|x| scale * x + shift);
        let moved: Vec<BezierPatch> =
            all.iter().map(|patch| BezierPatch { points: patch.points.map(|row| row.map(place)) }).collect();
        let bits = |t: f32, u: f32, v: f32, side: Side, i: u32| ([t, u, v].map(f32::to_bits), side, i);
        let wanted = |ray: &Ray| {
            let scaled = ScaledRay::new(ray).unwrap();
            let one = |(i, patch): (u32, &BezierPatch)| Some((patch.intersect(&scaled, f32::INFINITY)?, i));
            let alone = (0..).zip(&moved).filter_map(one);
            let first = alone.min_by(|a, b| a.0.t.total_cmp(&b.0.t).then(a.1.cmp(&b.1)));
            first.map(|(hit, i)| bits(scaled.caller_t(hit.t), hit.u, hit.v, hit.side, i))
        };
        let rays: Vec<Ray> = rays.iter().map(|ray| Ray { origin: place(ray.origin), ..*ray }).collect();
        let wants: Vec<_> = rays.iter().map(wanted).collect();
        assert!(wants.iter().flatten().count() > 200);
        let configs: [Config; 4] =
            [Preset::Dynamic.into(), Preset::Quality.into(), Config::default(), Config::default().axis_aligned()];
        for config in configs {
            let bvh = WideBvh::over_with(moved.clone(), config).unwrap();
            let loaded = WideBvh::<BezierPatch>::from_bytes(&bvh.to_bytes()).unwrap();
            let mut refitted = WideBvh::over_with(all.clone(), config).unwrap();
            let _: Refit = refitted.refit(moved.clone()).unwrap();
            let paths = SimdPath::ALL.into_iter().filter(|path| path.is_available());
            let on_paths = paths.map(|path| bvh.clone().with_path(path));
            for bvh in on_paths.chain([loaded, refitted]) {
                for (ray, want) in rays.iter().zip(&wants) {
                    let hit = bvh.closest_hit(ray).map(|hit| bits(hit.t, hit.u, hit.v, hit.side, hit.primitive.0));
                    assert_eq!(hit, *want, "{ray:?}");
                    assert_eq!(bvh.occluded(ray), want.is_some(), "{ray:?}");
                }
            }
            // All hits, and a filter that rejects every front.
            let mut found = vec![];
            for ray in &rays[..100] {
                bvh.all_hits(ray, &mut found);
                let alone: usize = moved.iter().map(|patch| hits(patch, ray).len()).sum();
                assert_eq!(found.len(), alone, "{ray:?}");
                let back = bvh
                    .closest_hit_with(ray, &mut canted_trace::Accept(|hit: &canted_trace::Hit| hit.side == Side::Back));
                assert_eq!(back, found.iter().find(|hit| hit.side == Side::Back).copied(), "{ray:?}");
            }
        }
    }
}
