//! Fits, moments and extents along fixed directions: the extreme cases by name, against exact containment, rational arithmetic, plain
//! loops and the axis-aligned box.

use canted_obb::{
    Aabb, Fit, FitError, Moments, Obb, bound,
    dop::{self, DIRECTIONS, Dop, N_FRAMES},
    fit, frame,
};
use num_rational::BigRational;
use num_traits::Zero;

use super::common::{ExactBox, Random, all_clouds, exact, exact_point, placed, to_f64};

const METHODS: [Fit; 5] = [Fit::Aabb, Fit::Pca, Fit::AreaPca, Fit::Dito, Fit::Dop];

/// Consecutive points as triangles: enough to give `AreaPca` a surface.
fn strip(points: &[[f32; 3]]) -> Vec<[u32; 3]> {
    (2..points.len() as u32).map(|i| [i - 2, i - 1, i]).collect()
}

/// Fits by every method and checks what every fit promises.
#[track_caller]
fn check(name: &str, points: &[[f32; 3]]) -> [Obb; 5] {
    let aligned = Obb::from_aabb(&Aabb::from_points(points.iter().copied()));
    METHODS.map(|method| {
        let fitted = fit(points, &strip(points), method).expect("finite points");
        let oracle = ExactBox::of(&fitted);
        for &point in points {
            assert!(oracle.contains(&exact_point(point)), "{name}, {method:?}: {point:?} outside {fitted:?}");
        }
        assert!(fitted.area() <= aligned.area(), "{name}, {method:?}: more area than the aligned box");
        assert!(fitted.half_extents.iter().all(|&half| half >= 0.0 && half.is_finite()), "{name}, {method:?}");
        assert_eq!(fitted.frame, frame::right_handed(fitted.frame), "{name}, {method:?}");
        fitted
    })
}

#[test]
fn every_cloud_is_contained_with_no_more_area_than_the_aligned_box() {
    for (name, points) in all_clouds() {
        check(&name, &points);
    }
}

/// Units in the last place of half a segment by which its box may be longer: rounding outward, the center's rounding, and the length
/// of the axis.
const SEGMENT_ULPS: f64 = 3.0;

#[test]
fn no_point_one_point_two_points() {
    for method in METHODS {
        assert_eq!(fit(&[], &[], method), Err(FitError::Empty));
    }
    for fitted in check("one", &[[0.1, -7.0, 1e7]]) {
        assert_eq!(fitted, Obb { center: [0.1, -7.0, 1e7], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] });
    }
    let pair = [[1.0, 2.0, 3.0], [4.0, -2.0, 3.5]];
    let [_, pca, _, dito, _] = check("two", &pair);
    for fitted in [pca, dito] {
        // Along the segment: the other extents are the rounding of a direction, half a unit in the last place.
        let [long, rest @ ..] = fitted.half_extents;
        let bound = SEGMENT_ULPS * f64::from(long.next_up() - long);
        assert!((f64::from(long) - 0.5 * 25.25_f64.sqrt()).abs() <= bound, "{fitted:?}");
        assert!(rest.iter().all(|&half| half <= 4.0 * f32::EPSILON * long), "{fitted:?}");
    }
}

#[test]
fn collinear_and_coplanar_sets_give_rotations() {
    for (name, points) in all_clouds() {
        if ["collinear", "oblique line", "oblique plane", "flat in a wall"].contains(&name.as_str()) {
            for fitted in check(&name, &points) {
                assert!(frame::is_orthonormal(fitted.frame), "{name}: {fitted:?}");
            }
        }
    }
}

#[test]
fn coincident_points_give_an_aligned_box_of_zero_extent() {
    let points = vec![[0.1, -3.3, 7.7e5]; 100_000];
    for method in METHODS {
        let fitted = fit(&points, &[[0, 1, 2]], method).expect("finite points");
        assert_eq!(fitted, Obb { center: points[0], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] });
    }
}

#[test]
fn equal_eigenvalues_never_exceed_the_area_of_the_aligned_box() {
    let cube = Aabb { min: [-1.0; 3], max: [1.0; 3] }.corners();
    for fitted in check("cube", &cube) {
        assert_eq!(fitted, Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0; 3] });
    }
    let mut random = Random(21);
    for _ in 0..20 {
        let rotated = random.frame();
        let points = cube.map(|p| placed(rotated, [1.0; 3], [0.0; 3], p.map(f64::from)));
        let fits = check("rotated cube", &points);
        assert_eq!(fits, check("rotated cube", &points), "the same input gives the same box");
        // The ditetrahedron finds an edge of any cube: 24 is the area, four roundings of f32 the excess.
        assert!(fits[3].area() <= 24.0 * (1.0 + 8.0 * f64::from(f32::EPSILON)), "{:?}", fits[3]);
    }
}

#[test]
fn needles_keep_their_minor_axes() {
    let mut random = Random(22);
    for _ in 0..20 {
        let rotated = random.frame();
        let scale = [1.0, 3e-5, 1e-6];
        let points: Vec<_> = (0..200).map(|_| placed(rotated, scale, [0.0; 3], random.vector())).collect();
        let pca = check("needle", &points)[1];
        // The points themselves are rounded by half a unit in the last place of one.
        let ideal = 8.0 * (scale[0] * scale[1] + scale[0] * scale[2]);
        assert!(pca.area() < 1.25 * ideal + 8.0 * f64::from(f32::EPSILON), "{} for {ideal}", pca.area());
    }
}

/// How far the area of a box of 3 x 1 x 0.25 may be off that is fitted to its rounded corners, relative.
///
/// Corners at up to 8 are rounded by 2⁻²² a coordinate, `ε = √3 · 2⁻²²` in all. An axis along an edge of length `l` tilts by `2ε/l`,
/// along the shortest by `4ε`: that carries its own faces out by `4ε·(3 + 1)` and the others by `4ε·0.25`. Along the next it tilts by
/// `ε`, its own faces go out by `3ε` and the longest's by `ε`; and every face moves by `ε`. That is `22ε` of the area
/// `8·(h₁h₂ + h₂h₃ + h₃h₁)`; the rest is for the frame's rounding and what is of second order.
const RECOVERED_ERROR: f64 = 24.0 * 1.7321 / 4_194_304.0;

#[test]
fn a_rotated_box_is_recovered() {
    let mut random = Random(23);
    for _ in 0..50 {
        let (rotated, half) = (random.frame(), [3.0, 1.0, 0.25]);
        let corners = Aabb { min: [-1.0; 3], max: [1.0; 3] }.corners();
        let points = corners.map(|p| placed(rotated, half, [0.5, 0.25, -4.0], p.map(f64::from)));
        let ideal = 8.0 * (half[0] * half[1] + half[1] * half[2] + half[2] * half[0]);
        let [_, pca, _, dito, _] = check("box", &points);
        for fitted in [pca, dito] {
            assert!((fitted.area() / ideal - 1.0).abs() <= RECOVERED_ERROR, "{} for {ideal}", fitted.area());
        }
    }
}

#[test]
fn tessellation_does_not_move_the_area_weighted_box() {
    // One dense corner: every triangle of a bent sheet split again and again nearby its first vertex.
    let points = vec![[0.0, 0.0, 0.0], [4.0, 1.0, 0.5], [4.5, 3.0, 2.0], [0.25, 2.0, -1.0]];
    let sheet = [[0, 1, 2], [0, 2, 3]];
    let (mut dense_points, mut dense) = (points.clone(), Vec::new());
    for [a, b, c] in sheet {
        let (mut b, mut c) = (b, c);
        for _ in 0..12 {
            let mid = |i: u32, points: &[[f32; 3]]| [0, 1, 2].map(|k| 0.5 * (points[0][k] + points[i as usize][k]));
            let n = dense_points.len() as u32;
            let (to_b, to_c) = (mid(b, &dense_points), mid(c, &dense_points));
            dense_points.extend([to_b, to_c]);
            dense.extend([[b, c, n + 1], [b, n + 1, n]]);
            (b, c) = (n, n + 1);
        }
        dense.push([a, b, c]);
    }
    let area = |points: &[[f32; 3]], triangles: &[[u32; 3]], method| fit(points, triangles, method).unwrap().area();
    let (coarse, fine) = (area(&points, &sheet, Fit::AreaPca), area(&dense_points, &dense, Fit::AreaPca));
    // Halving is exact here, so only the last digit of the eigenvectors differs.
    assert!((coarse / fine - 1.0).abs() < 4.0 * f64::from(f32::EPSILON), "{coarse} {fine}");
    let (coarse, fine) = (area(&points, &sheet, Fit::Pca), area(&dense_points, &dense, Fit::Pca));
    assert!((coarse / fine - 1.0).abs() > 0.01, "vertices alone should have been drawn to the dense corner");
}

#[test]
fn an_offset_of_1e7_with_detail_of_1e_3_is_contained() {
    let mut random = Random(26);
    for offset in [[1e7; 3], [1e7, 0.0, -3.0], [-1e7, 1e7, 0.25]] {
        let rotated = random.frame();
        let points: Vec<_> = (0..100).map(|_| placed(rotated, [2e-3, 1e-3, 1e-3], offset, random.vector())).collect();
        for fitted in check("far", &points) {
            // Coordinates at 1e7 are integers: content and center round by at most one each.
            assert!(fitted.half_extents.iter().all(|&half| half <= 4.0), "{offset:?} {fitted:?}");
        }
    }
}

#[test]
fn denormals_are_points_like_others() {
    let least = f32::from_bits(1);
    let pair = [[0.0; 3], [least, 2.0 * least, 3.0 * least]];
    for fitted in check("denormal pair", &pair) {
        assert!(fitted.half_extents.iter().all(|&half| half < 8.0 * least), "{fitted:?}");
    }
    check("denormal triangle", &[[0.0; 3], [1e-40, 0.0, 0.0], [0.0, 3e-42, -2e-41]]);
}

#[test]
fn powers_of_two_scale_every_bit() {
    for (name, points) in all_clouds() {
        let reach = points.iter().flatten().fold(0.0, |reach: f32, x| reach.max(x.abs()));
        if !(1e-4..1e8).contains(&reach) {
            continue;
        }
        for exponent in [-60, -7, 3, 66] {
            let scale = 2.0_f32.powi(exponent);
            let scaled: Vec<_> = points.iter().map(|p| p.map(|x| x * scale)).collect();
            for method in METHODS {
                let (one, other) = (fit(&points, &strip(&points), method), fit(&scaled, &strip(&points), method));
                let (one, other) = (one.unwrap(), other.unwrap());
                assert_eq!(other.frame, one.frame, "{name}, {method:?}, 2^{exponent}");
                assert_eq!(other.center, one.center.map(|x| x * scale), "{name}, {method:?}, 2^{exponent}");
                assert_eq!(other.half_extents, one.half_extents.map(|x| x * scale), "{name}, {method:?}, 2^{exponent}");
            }
        }
    }
}

#[test]
fn invalid_input_is_reported_with_its_index() {
    let mut points = vec![[0.0; 3]; 5];
    assert_eq!(
        fit(&points, &[[0, 1, 2], [3, 4, 5]], Fit::Pca),
        Err(FitError::IndexOutOfRange { triangle: 1, index: 5, n_points: 5 })
    );
    points[3][1] = f32::NAN;
    points[4][2] = f32::INFINITY;
    let error = fit(&points, &[], Fit::Dito).unwrap_err();
    assert_eq!(error, FitError::NotFinite { index: 3 });
    assert_eq!(error.to_string(), "point 3 is not finite");
}

#[test]
fn no_box_beats_an_exhaustive_search_and_dito_comes_near() {
    let mut random = Random(24);
    let mut excess = Vec::new();
    for _ in 0..16 {
        let points: Vec<[f32; 3]> = (0..6).map(|_| random.vector().map(|x| x as f32)).collect();
        let searched = searched_area(&points);
        let ratios = check("six points", &points).map(|fitted| fitted.area() / searched);
        // The search ends within 1e-5 rad of a minimum, not always the least.
        assert!(ratios.iter().all(|&ratio| ratio > 0.98), "{ratios:?}");
        excess.push(ratios[3] - 1.0);
    }
    let mean = excess.iter().sum::<f64>() / excess.len() as f64;
    assert!(mean < 0.15, "the ditetrahedron costs {mean} over the least area: {excess:?}");
}

/// Least area over a grid of rotations, then over ever smaller rotations about the three axes.
fn searched_area(points: &[[f32; 3]]) -> f64 {
    let area = |q: canted_obb::Quaternion| canted_obb::bound(q.frame(), points.iter().copied()).area();
    let mut random = Random(25);
    let mut best =
        (0..2_000).map(|_| random.rotation()).map(|q| (area(q), q)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    let mut angle = 0.1;
    while angle > 1e-5 {
        let rotations = (0..6).map(|i| {
            let mut axis = [0.0; 3];
            axis[i / 2] = 1.0;
            canted_obb::Quaternion::from_axis_angle(axis, if i % 2 == 0 { angle } else { -angle })
                .times(best.1)
                .normalized()
        });
        let next = rotations.map(|q| (area(q), q)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        if next.0 < best.0 { best = next } else { angle *= 0.7 }
    }
    best.0
}

/// Mean and scatter of points in rational arithmetic.
fn exactly(points: &[[f32; 3]]) -> ([f64; 3], [f64; 6]) {
    let n = exact(points.len() as f32);
    let points: Vec<_> = points.iter().map(|&p| exact_point(p)).collect();
    let mean: [BigRational; 3] = std::array::from_fn(|k| points.iter().map(|p| &p[k]).sum::<BigRational>() / &n);
    let entry = |i: usize, j: usize| {
        let sum = points.iter().fold(BigRational::zero(), |sum, p| sum + (&p[i] - &mean[i]) * (&p[j] - &mean[j]));
        to_f64(&sum)
    };
    let scatter = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    (mean.map(|x| to_f64(&x)), scatter)
}

/// Differences relative to the greatest entry, or to the square of the rounding of coordinates where that is more.
#[track_caller]
fn assert_close(name: &str, found: &Moments, mean: [f64; 3], scatter: [f64; 6]) {
    let reach = mean.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let spread = scatter.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    // One rounding a point for the mean and a few for the scatter; the mean's own rounding enters by its product with
    // the spread.
    let n = found.weight;
    let coordinate = (n + 8.0) * f64::EPSILON * (reach + (spread / n).sqrt());
    let limit = (n + 8.0) * 4.0 * f64::EPSILON * spread + 4.0 * coordinate * (n * spread).sqrt();
    assert!((0..3).all(|k| (found.mean[k] - mean[k]).abs() <= coordinate), "{name}: {found:?} {mean:?}");
    assert!((0..6).all(|k| (found.scatter[k] - scatter[k]).abs() <= limit), "{name}: {found:?} {scatter:?}");
}

#[test]
fn points_in_any_order_of_merging() {
    for (name, points) in all_clouds() {
        if points.iter().flatten().any(|x| x.abs() > 1e30) {
            continue;
        }
        let (mean, scatter) = exactly(&points);
        assert_close(&name, &Moments::from_points(points.iter().copied()), mean, scatter);
        let mut parts: Vec<Moments> = points.iter().map(|&p| Moments::from_point(p)).collect();
        while parts.len() > 1 {
            parts = parts.chunks(2).map(|pair| pair[1..].iter().fold(pair[0], |a, b| a.merged(b))).collect();
        }
        assert_close(&name, &parts[0], mean, scatter);
    }
}

#[test]
fn a_triangle_equals_the_quadrature_of_its_midpoints() {
    let mut random = Random(71);
    for _ in 0..200 {
        let corners: [[f32; 3]; 3] = std::array::from_fn(|_| random.vector().map(|x| x as f32));
        let found = Moments::from_triangle(corners);
        let [a, b, c] = corners.map(|p| p.map(f64::from));
        // The rule of three edge midpoints, each a third of the area, is exact for polynomials of degree two.
        let midpoints = [(a, b), (b, c), (c, a)].map(|(p, q)| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k])));
        let mean = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
        let entry = |i: usize, j: usize| {
            midpoints.iter().map(|m| (m[i] - mean[i]) * (m[j] - mean[j])).sum::<f64>() * found.weight / 3.0
        };
        let scatter = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        let heron = {
            let side = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
            let (x, y, z) = (side(a, b), side(b, c), side(c, a));
            ((x + y + z) * (x + y - z) * (y + z - x) * (z + x - y)).sqrt() / 4.0
        };
        assert!((found.weight - heron).abs() < 1e-9, "{corners:?}");
        assert!((0..3).all(|k| (found.mean[k] - mean[k]).abs() <= 4.0 * f64::EPSILON), "{corners:?}");
        assert!((0..6).all(|k| (found.scatter[k] - scatter[k]).abs() <= 32.0 * f64::EPSILON), "{corners:?}");
    }
}

#[test]
fn corners_of_a_box_in_closed_form() {
    let mut random = Random(72);
    for _ in 0..100 {
        let obb = Obb {
            center: [1.0, 2.0, -3.0],
            frame: random.frame(),
            half_extents: random.vector().map(|x| x.abs() as f32),
        };
        let found = Moments::from_box_corners(&obb, 8.0);
        let corners = obb.corners();
        let entry =
            |i: usize, j: usize| corners.iter().map(|c| (c[i] - found.mean[i]) * (c[j] - found.mean[j])).sum::<f64>();
        let scatter = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        assert!((0..6).all(|k| (found.scatter[k] - scatter[k]).abs() <= 64.0 * f64::EPSILON), "{obb:?}");
    }
}

#[test]
fn no_points_have_weight_zero() {
    let point = Moments::from_point([1.0, 2.0, 3.0]);
    let needle = Moments::from_triangle([[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]);
    assert_eq!(needle.weight, 0.0);
    for nothing in [Moments::EMPTY, needle] {
        assert_eq!(point.merged(&nothing), point);
        assert_eq!(nothing.merged(&point), point);
    }
    assert_eq!(Moments::EMPTY.axes(1e-6), Obb::IDENTITY_FRAME);
}

/// Rounding of a unit direction and a dot product of three terms in `f32`: four roundings to each term, of which the
/// sum of absolute terms is at most √3 times the greatest coordinate.
const ALONG: f64 = 4.0 * 1.733 * f32::EPSILON as f64;

fn unit(k: usize) -> [f64; 3] {
    let direction = DIRECTIONS[k].map(f64::from);
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    direction.map(|x| x / length)
}

#[test]
fn intervals_are_those_of_all_points() {
    for (name, points) in all_clouds() {
        let reach = points.iter().flatten().fold(0.0, |a: f64, &b| a.max(f64::from(b.abs())));
        if !(1e-30..1e37).contains(&reach) {
            continue;
        }
        let dop = Dop::from_points(points.iter().copied());
        for k in 0..DIRECTIONS.len() {
            let along = points.iter().map(|p| (0..3).map(|j| unit(k)[j] * f64::from(p[j])).sum::<f64>());
            let expected = along.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)]);
            let found = dop.interval(k).map(f64::from);
            assert!((0..2).all(|i| (found[i] - expected[i]).abs() <= ALONG * reach), "{name}, direction {k}");
        }
        let (front, back) = points.split_at(points.len() / 2);
        let joined = Dop::from_points(front.iter().copied()).union(&Dop::from_points(back.iter().copied()));
        assert_eq!(joined, dop, "{name}: a union is exactly that of all points");
    }
}

#[test]
fn frames_are_sixteen_rotations_and_the_first_is_the_identity() {
    assert_eq!(dop::frames()[0], Obb::IDENTITY_FRAME);
    for (i, &axes) in dop::frames().iter().enumerate() {
        assert!(frame::is_orthonormal(axes), "{i}");
        assert_eq!(frame::right_handed(axes), axes, "{i}");
        assert!(dop::frames()[..i].iter().all(|&other| other != axes), "{i}");
    }
}

#[test]
fn areas_are_those_of_the_boxes() {
    let mut random = Random(81);
    for _ in 0..50 {
        let scale = random.vector();
        let rotated = random.frame();
        let points: Vec<_> = (0..20).map(|_| placed(rotated, scale, [0.0; 3], random.vector())).collect();
        let dop = Dop::from_points(points.iter().copied());
        let mut least = f64::MAX;
        for (&axes, area) in dop::frames().iter().zip(dop.areas()) {
            let boxed = bound(axes, points.iter().copied());
            // Six faces, each a product of two extents of up to four.
            assert!((boxed.area() - area).abs() <= 6.0 * 2.0 * 4.0 * 4.0 * ALONG, "{axes:?}");
            least = least.min(area);
        }
        assert_eq!(dop.best().1, least);
    }
}

#[test]
fn empty_sets_and_ties_give_the_identity_frame() {
    assert_eq!(Dop::from_points([[1.0, 2.0, 3.0]]).best(), (Obb::IDENTITY_FRAME, 0.0));
    let dop = Dop::from_points([[1.0, 2.0, 3.0], [2.0, 2.5, 3.5]]);
    assert_eq!(dop.union(&Dop::EMPTY), dop);
    assert_eq!(dop.areas().len(), N_FRAMES);
}

/// Extents of subnormal coordinates underflow; boxes contain their points anyway, decided exactly.
#[test]
fn boxes_of_subnormal_points_contain_them() {
    let mut random = Random(9);
    let mut n_oriented = 0;
    for exponent in [-120, -124, -130, -140, -146, -148] {
        let unit = 2.0_f64.powi(exponent);
        for _ in 0..2_000 {
            // Thin along a diagonal, so that the best frame is not the identity.
            let points: Vec<[f32; 3]> = (0..4)
                .map(|_| {
                    let along = random.signed();
                    [0, 1, 2].map(|_| (unit * (along + 0.05 * random.signed())) as f32)
                })
                .collect();
            let Some(obb) = Dop::from_points(points.iter().copied()).best_box() else { continue };
            n_oriented += 1;
            for &point in &points {
                assert!(obb.contains(point), "2^{exponent}: {obb:?} does not contain {point:?}");
            }
        }
    }
    assert!(n_oriented > 1_000, "{n_oriented}");
}
