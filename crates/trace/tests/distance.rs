//! Closest points and overlaps of convex regions against exact rationals.
//!
//! Not covered here: BVHs, which test the same functions on many triangles.

use canted_obb::Obb;
use canted_trace::{Convex, DISTANCE_ERROR, closest_point_on_triangle};
use num_rational::BigRational as Q;
use num_traits::{One, Signed, ToPrimitive, Zero};

type Q3 = [Q; 3];

fn q3(a: [f32; 3]) -> Q3 {
    a.map(|x| Q::from_float(x).expect("finite"))
}

fn sub(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn dot(a: &Q3, b: &Q3) -> Q {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|k| &a[(k + 1) % 3] * &b[(k + 2) % 3] - &a[(k + 2) % 3] * &b[(k + 1) % 3])
}

/// Exact squared distance of a point and a triangle.
fn distance_squared(point: [f32; 3], vertices: &[[f32; 3]; 3]) -> Q {
    let point = q3(point);
    let [a, b, c] = vertices.map(|vertex| sub(&q3(vertex), &point));
    let on_edge = |start: &Q3, end: &Q3| {
        let edge = sub(end, start);
        let length_squared = dot(&edge, &edge);
        let t = if length_squared.is_zero() { Q::zero() } else { -dot(start, &edge) / length_squared };
        let t = t.max(Q::zero()).min(Q::one());
        let closest: Q3 = std::array::from_fn(|k| &start[k] + &t * &edge[k]);
        dot(&closest, &closest)
    };
    let edges = on_edge(&a, &b).min(on_edge(&b, &c)).min(on_edge(&c, &a));
    let (ab, ac) = (sub(&b, &a), sub(&c, &a));
    let normal = cross(&ab, &ac);
    let area_squared = dot(&normal, &normal);
    if area_squared.is_zero() {
        return edges;
    }
    let u = dot(&cross(&ac, &a), &normal) / &area_squared;
    let v = dot(&cross(&a, &ab), &normal) / &area_squared;
    if u.is_negative() || v.is_negative() || &u + &v > Q::one() {
        return edges;
    }
    let height = dot(&a, &normal);
    &height * &height / area_squared
}

/// Random numbers after Steele et al. 2014.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    }

    /// A point of one of several kinds: anywhere, on a small grid, far away, or of mixed scale.
    fn point(&mut self) -> [f32; 3] {
        let kind = self.next() % 5;
        std::array::from_fn(|_| match kind {
            0 | 1 => self.unit(),
            2 => (4.0 * self.unit()).round() / 4.0,
            3 => 1e7 + 16.0 * self.unit(),
            _ => self.unit() * 10_f32.powi(i32::try_from(self.next() % 9).unwrap() - 4),
        })
    }

    /// A triangle: any, a needle, flat in a coordinate, or with equal vertices.
    fn triangle(&mut self) -> [[f32; 3]; 3] {
        let [a, mut b, mut c] = [self.point(), self.point(), self.point()];
        match self.next() % 6 {
            0 => c = b.map(|x| x + x * 3e-7 * self.unit()),
            1 => (b[1], c[1]) = (a[1], a[1]),
            2 => b = a,
            _ => {}
        }
        [a, b, c]
    }
}

fn length(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn closest_points_are_those_of_exact_arithmetic() {
    let mut random = Random(1);
    for i in 0..4_000 {
        let (point, triangle) = (random.point(), random.triangle());
        let found = closest_point_on_triangle(point, &triangle);
        let (found, exact) =
            (found.distance_squared.sqrt(), distance_squared(point, &triangle).to_f64().unwrap().sqrt());
        let between = |a: [f32; 3], b: [f32; 3]| length(std::array::from_fn(|k| f64::from(a[k]) - f64::from(b[k])));
        let far = triangle.iter().map(|&vertex| between(point, vertex)).fold(0.0, f64::max);
        let edge = (0..3).map(|k| between(triangle[k], triangle[(k + 1) % 3])).fold(0.0, f64::max);
        assert!(found >= exact - DISTANCE_ERROR * far, "case {i}: {found} < {exact}");
        assert!(found <= exact + DISTANCE_ERROR * far + 2_f64.powi(-26) * edge, "case {i}: {found} > {exact}");
    }
}

#[test]
fn a_wrong_region_would_be_noticed() {
    // The plane's point where an edge is closest.
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let point = [2.0, 0.5, 1.0];
    let exact = distance_squared(point, &triangle).to_f64().unwrap();
    assert!(exact > 1.0 && (closest_point_on_triangle(point, &triangle).distance_squared - exact).abs() < 1e-12);
}

/// Whether a triangle and a box share a point, by exact clipping. The box grows by `growth` on all sides.
fn overlaps(vertices: &[[f32; 3]; 3], min: [f32; 3], max: [f32; 3], growth: f64) -> bool {
    let growth = Q::from_float(growth).unwrap();
    let (min, max) = (q3(min).map(|x| x - &growth), q3(max).map(|x| x + &growth));
    let mut polygon: Vec<Q3> = vertices.iter().map(|&vertex| q3(vertex)).collect();
    for k in 0..3 {
        for (plane, sign) in [(&min[k], Q::one()), (&max[k], -Q::one())] {
            let height = |p: &Q3| (&p[k] - plane) * &sign;
            let mut clipped: Vec<Q3> = vec![];
            for (i, p) in polygon.iter().enumerate() {
                let next = &polygon[(i + 1) % polygon.len()];
                let (here, there) = (height(p), height(next));
                if !here.is_negative() {
                    clipped.push(p.clone());
                }
                if here.is_negative() != there.is_negative() {
                    let t = &here / (&here - &there);
                    clipped.push(std::array::from_fn(|k| &p[k] + &t * (&next[k] - &p[k])));
                }
            }
            polygon = clipped;
        }
    }
    !polygon.is_empty()
}

#[test]
fn overlaps_of_boxes_and_triangles_are_those_of_exact_clipping() {
    let mut random = Random(2);
    let (mut n_inside, mut n_outside) = (0, 0);
    for i in 0..3_000 {
        let triangle = random.triangle();
        let (a, b) = (random.point(), random.point());
        let (min, mut max): ([f32; 3], [f32; 3]) =
            (std::array::from_fn(|k| a[k].min(b[k])), std::array::from_fn(|k| a[k].max(b[k])));
        if i % 7 == 0 {
            max[i % 3] = min[i % 3];
        }
        let found = Convex::from_aabb(min, max).overlaps_triangle(&triangle);
        let greatest = triangle.iter().flatten().chain(&min).chain(&max).fold(0.0_f32, |most, x| most.max(x.abs()));
        if overlaps(&triangle, min, max, 0.0) {
            assert!(found, "case {i}: {triangle:?} overlaps {min:?} {max:?}");
            n_inside += 1;
        } else if found {
            let slack = f64::from(greatest) * 2_f64.powi(-44);
            assert!(overlaps(&triangle, min, max, slack), "case {i}: {triangle:?} does not touch {min:?} {max:?}");
        } else {
            n_outside += 1;
        }
    }
    assert!(n_inside > 300 && n_outside > 300, "{n_inside} inside, {n_outside} outside");
}

/// A box rotated by 45 degrees misses a triangle that its axis-aligned bounds contain.
#[test]
fn oriented_boxes_and_frusta_are_not_their_bounds() {
    let half = 0.5_f32.sqrt();
    let frame = [[half, half, 0.0], [-half, half, 0.0], [0.0, 0.0, 1.0]];
    let obb = Obb { center: [0.0; 3], frame, half_extents: [1.0, 1.0, 1.0] };
    let corner = [[1.2, 1.2, 0.0], [1.3, 1.2, 0.0], [1.2, 1.3, 0.1]];
    assert!(!Convex::from_obb(&obb).overlaps_triangle(&corner));
    assert!(Convex::from_aabb([-1.5; 3], [1.5; 3]).overlaps_triangle(&corner));
    let face = |s: f32, z: f32| [[-s, -s, z], [s, -s, z], [s, s, z], [-s, s, z]];
    let frustum = Convex::from_frustum(face(0.1, 1.0), face(1.0, 10.0));
    assert!(frustum.overlaps_triangle(&[[0.0, 0.0, 5.0], [3.0, 0.0, 5.0], [3.0, 1.0, 5.0]]));
    assert!(!frustum.overlaps_triangle(&[[0.9, 0.9, 2.0], [3.0, 0.0, 2.0], [3.0, 1.0, 2.0]]));
    let pyramid = Convex::from_frustum(face(0.0, 0.0), face(1.0, 10.0));
    assert!(pyramid.overlaps_triangle(&[[-1.0, 0.0, 0.5], [1.0, 0.01, 0.5], [1.0, -0.01, 0.5]]));
    assert!(!pyramid.overlaps_triangle(&[[-1.0, 0.2, 0.5], [1.0, 0.2, 0.5], [1.0, 0.3, 0.5]]));
}

/// A cube whose top is cut by a slanted plane: no two faces are parallel but the upright ones.
#[test]
fn hexahedra_have_six_faces() {
    let near = [[-1.0, -1.0, 1.2], [1.0, -1.0, 2.8], [1.0, 1.0, 2.8], [-1.0, 1.0, 1.2]];
    let far = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let above = [[-0.9, 0.0, 2.6], [-0.8, 0.0, 2.6], [-0.85, 0.1, 2.6]];
    let below = above.map(|[x, y, z]| [x, y, z - 1.5]);
    for region in [Convex::from_frustum(near, far), Convex::from_frustum(far, near)] {
        assert!(!region.overlaps_triangle(&above));
        assert!(region.overlaps_triangle(&below));
    }
}

/// A quad without volume, and a triangle in its plane: separated within the plane, along no coordinate axis.
#[test]
fn figures_in_one_plane() {
    let quad = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0], [-1.0, 1.0, 0.0]];
    let region = Convex::from_frustum(quad, quad);
    assert!(!region.overlaps_triangle(&[[0.8, 0.3, 0.0], [0.9, 0.3, 0.0], [0.8, 0.2, 0.0]]));
    assert!(region.overlaps_triangle(&[[0.2, 0.3, 0.0], [0.9, 0.3, 0.0], [0.8, 0.2, 0.0]]));
    let point = Convex::from_frustum([[0.8, 0.3, 0.0]; 4], [[0.8, 0.3, 0.0]; 4]);
    assert!(!point.overlaps_triangle(&[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]]));
    assert!(point.overlaps_triangle(&[[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.8, 2.0, 0.0]]));
}

/// Figures of fewer dimensions than two, and boxes without an inside.
#[test]
fn degenerate_regions() {
    let segment = |a: [f32; 3], b: [f32; 3]| Convex::from_frustum([a, b, b, a], [a, b, b, a]);
    let line = [[0.0, 0.0, 0.0], [2.0, 1.0, 3.0], [4.0, 2.0, 6.0]];
    let point = |p: [f32; 3]| Convex::from_frustum([p; 4], [p; 4]);
    // (region, triangle, whether they share a point)
    let cases = [
        (point([2.0, 1.0, 3.0]), line, true),
        (point([1.0, 0.5, 1.5]), line, true),
        // In the box around the line, and beside it.
        (point([2.0, 1.0, 2.0]), line, false),
        (segment([2.0, 1.0, 2.0], [2.0, 1.0, 4.0]), line, true),
        (segment([2.0, 0.0, 2.0], [2.0, 0.0, 4.0]), line, false),
        // In one plane, and on one line.
        (segment([1.0, 0.5, 2.5], [3.0, 1.5, 5.5]), line, false),
        (segment([8.0, 4.0, 12.0], [6.0, 3.0, 9.0]), line, false),
        (segment([8.0, 4.0, 12.0], [4.0, 2.0, 6.0]), line, true),
        (segment([0.2, 0.2, 0.0], [0.4, 0.1, 0.0]), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], true),
        (segment([0.6, 0.6, 0.0], [0.7, 0.5, 0.0]), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], false),
        (segment([0.2, 0.2, 0.1], [0.2, 0.2, 1.0]), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], false),
        (Convex::from_aabb([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]), line, true),
        (Convex::from_aabb([1.0; 3], [0.0; 3]), [[0.5; 3]; 3], false),
        (Convex::from_aabb([f32::NAN; 3], [1.0; 3]), [[0.5; 3]; 3], false),
    ];
    for (region, triangle, overlaps) in cases {
        assert_eq!(region.overlaps_triangle(&triangle), overlaps, "{region:?} {triangle:?}");
    }
}

/// A region and a triangle under a map overlap as they do without it.
#[test]
fn regions_under_affine_maps() {
    let mut state = 31_u64;
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    // A shear with integers, and its inverse: images of short numbers are exact.
    let to = [[1.0, 2.0, 0.0, 5.0], [0.0, 1.0, 0.0, -3.0], [1.0, 0.0, -1.0, 8.0]];
    let from = [[1.0, -2.0, 0.0, -11.0], [0.0, 1.0, 0.0, 3.0], [1.0, -2.0, -1.0, -3.0]];
    let mut counts = [0; 2];
    for i in 0..2000 {
        // Sixteenths from -4 to 4.
        let mut vector = || {
            [0; 3].map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ((state >> 33) % 129) as f32 / 16.0 - 4.0
            })
        };
        let (a, b, c, triangle) = (vector(), vector(), vector(), [vector(), vector(), vector()]);
        let at = |u: f32, v: f32, w: f32| -> [f32; 3] { std::array::from_fn(|k| u * a[k] + v * b[k] + w * c[k]) };
        let thick = if i % 5 == 0 { 0.0 } else { 1.0 };
        let face = |w: f32| [at(-0.5, -0.5, w), at(0.5, -0.5, w), at(0.5, 0.5, w), at(-0.5, 0.5, w)];
        let region = Convex::from_frustum(face(0.0), face(thick));
        let image = |p: [f32; 3]| {
            to.map(|[x, y, z, w]| (x * f64::from(p[0]) + y * f64::from(p[1]) + z * f64::from(p[2]) + w) as f32)
        };
        let expected = region.overlaps_triangle(&triangle);
        assert_eq!(region.transformed(&to, &from).overlaps_triangle(&triangle.map(image)), expected, "{region:?}");
        assert_eq!(region.transformed(&identity, &identity).overlaps_triangle(&triangle), expected);
        counts[usize::from(expected)] += 1;
    }
    assert!(counts[0] > 200 && counts[1] > 200, "{counts:?}");
}
