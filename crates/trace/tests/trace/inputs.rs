//! Rays, triangles and frames: random and degenerate.

use canted_obb::{Obb, vector};
use canted_trace::{Ray, ScaledRay, Slabs};
use num_rational::BigRational;
use num_traits::{Signed, Zero};

pub(crate) type Triangle = [[f32; 3]; 3];

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub(crate) fn below(&mut self, n: u64) -> usize {
        usize::try_from(self.bits() % n).expect("small")
    }

    /// Uniform in [-1, 1).
    pub(crate) fn signed(&mut self) -> f32 {
        let cells = u32::try_from(self.bits() >> 40).expect("24 bits");
        let unit = cells as f32 / (1u32 << 24) as f32;
        2.0 * unit - 1.0
    }

    pub(crate) fn vector(&mut self, scale: f32) -> [f32; 3] {
        std::array::from_fn(|_| scale * self.signed())
    }

    /// An orthonormal frame, up to f32.
    pub(crate) fn frame(&mut self) -> [[f32; 3]; 3] {
        let unit = |a: [f32; 3]| a.map(|x| x / vector::dot(a, a).sqrt());
        let x = unit(self.vector(1.0));
        let z = unit(vector::cross(x, self.vector(1.0)));
        [x, vector::cross(z, x), z]
    }

    /// Barycentric coordinates; often on an edge or at a vertex.
    pub(crate) fn weights(&mut self) -> [f32; 3] {
        let [a, b] = [self.signed().abs(), self.signed().abs()];
        match self.below(4) {
            0 => [a * (1.0 - b), a * b, 1.0 - a],
            1 => [1.0 - a, a, 0.0],
            2 => [0.0, 1.0 - b, b],
            _ => [0.0, 0.0, 1.0],
        }
    }

    /// A triangle near `around`: random, needle, in a coordinate plane, on a grid, or with a repeated vertex.
    pub(crate) fn triangle(&mut self, around: [f32; 3], size: f32) -> Triangle {
        let mut corners: Triangle = std::array::from_fn(|_| self.vector(size));
        match self.below(5) {
            0 => corners[2] = std::array::from_fn(|k| corners[0][k] + 1e-4 * (corners[1][k] - corners[0][k])),
            1 => {
                let k = self.below(3);
                corners.iter_mut().for_each(|c| c[k] = 0.0);
            }
            2 => corners = corners.map(|c| c.map(|x| (4.0 * x / size).round() * 0.25 * size)),
            _ => {}
        }
        corners.map(|c| std::array::from_fn(|k| c[k] + around[k]))
    }
}

/// Scales of a case.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting {
    /// Where the triangles are.
    pub(crate) around: [f32; 3],
    /// How large they are.
    pub(crate) size: f32,
    /// How far the rays start.
    pub(crate) distance: f32,
}

pub(crate) const SETTINGS: [Setting; 7] = [
    Setting { around: [0.0; 3], size: 1.0, distance: 2.0 },
    Setting { around: [5.0, -3.0, 7.0], size: 0.01, distance: 3.0 },
    Setting { around: [1e7, -1e7, 3e6], size: 100.0, distance: 1e3 },
    Setting { around: [0.3, 0.2, -0.1], size: 1.0, distance: 1e4 },
    Setting { around: [0.0; 3], size: TWO_POW_60, distance: 3.0 * TWO_POW_60 },
    Setting { around: [0.0; 3], size: 1.0 / TWO_POW_60, distance: 3.0 / TWO_POW_60 },
    Setting { around: [0.0, 1e-21, 0.0], size: 1e-20, distance: 1e-18 },
];

pub(crate) const TWO_POW_60: f32 = (1u64 << 60) as f32;

/// A triangle of `setting` and a ray towards it.
pub(crate) fn case(rng: &mut Rng, setting: &Setting) -> (Triangle, ScaledRay) {
    let triangle = rng.triangle(setting.around, setting.size);
    (triangle, ray_at(rng, &triangle, setting.distance))
}

/// A ray towards a point of `triangle`: from far away, along an axis, in the plane of the face, with tiny components, from a vertex.
pub(crate) fn ray_at(rng: &mut Rng, triangle: &Triangle, distance: f32) -> ScaledRay {
    let weights = rng.weights();
    let target: [f32; 3] = std::array::from_fn(|k| (0..3).map(|i| weights[i] * triangle[i][k]).sum());
    let axis = rng.below(3);
    let mut back = rng.vector(distance);
    match rng.below(6) {
        0 => back = std::array::from_fn(|k| if k == axis { back[k] } else { 0.0 }),
        1 => back[axis] = -0.0,
        2 => back = vector::sub(triangle[1], triangle[0]).map(|x| x * 3.0),
        3 => back[axis] = 1e-40 * distance,
        _ => {}
    }
    let origin: [f32; 3] = std::array::from_fn(|k| target[k] + back[k]);
    let direction = if rng.below(2) == 0 { vector::sub(target, origin) } else { back.map(|x| -x) };
    let stray = [rng.signed(), 1.0, 0.0];
    let direction = if direction == [0.0; 3] { stray } else { direction };
    ScaledRay::new(&Ray::new(origin, direction)).expect("a finite ray with a direction")
}

/// A triangle with arbitrary bits and a ray towards it: subnormal to 2^62, magnitudes up to 2^30 apart.
pub(crate) fn any_bits(rng: &mut Rng) -> (Triangle, ScaledRay) {
    let greatest = rng.below(190);
    let spread = 1 + rng.below(31);
    let mut vector = || {
        std::array::from_fn(|_| {
            let exponent = greatest.saturating_sub(rng.below(spread as u64));
            let bits = u32::try_from(rng.bits() >> 32).expect("32 bits");
            f32::from_bits(bits & 0x807f_ffff | u32::try_from(exponent).expect("below 190") << 23)
        })
    };
    let (triangle, origin, other): (Triangle, [f32; 3], [f32; 3]) =
        ([vector(), vector(), vector()], vector(), vector());
    let weights = rng.weights();
    let target: [f32; 3] = std::array::from_fn(|k| (0..3).map(|i| weights[i] * triangle[i][k]).sum());
    let ray = ScaledRay::new(&Ray::new(origin, vector::sub(target, origin)));
    (triangle, ray.or_else(|| ScaledRay::new(&Ray::new(origin, other))).unwrap_or_else(|| ray_at(rng, &triangle, 1.0)))
}

/// An oriented box: any frame and extents, flat, sheared, or axis-aligned.
pub(crate) fn obb_near(rng: &mut Rng, setting: &Setting) -> Obb {
    let offset = rng.vector(setting.size);
    let mut obb = Obb {
        center: std::array::from_fn(|k| setting.around[k] + offset[k]),
        frame: rng.frame(),
        half_extents: rng.vector(setting.size).map(f32::abs),
    };
    match rng.below(5) {
        0 => obb.half_extents[rng.below(3)] = 0.0,
        1 => obb.frame[0] = std::array::from_fn(|k| 2.0 * obb.frame[0][k] + 1.5 * obb.frame[1][k]),
        2 => obb.frame = Obb::IDENTITY_FRAME,
        _ => {}
    }
    obb
}

/// Relative error of one rounding to `f64`.
pub(crate) const UNIT_ROUNDOFF_F64: f64 = f64::EPSILON / 2.0;

pub(crate) type Q = BigRational;
pub(crate) type Q3 = [Q; 3];

/// The exact number.
pub(crate) fn q(x: impl Into<f64>) -> Q {
    BigRational::from_float(x.into()).expect("a finite number")
}

pub(crate) fn q3(a: [f32; 3]) -> Q3 {
    a.map(q)
}

pub(crate) fn dot(a: &Q3, b: &Q3) -> Q {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub(crate) fn sub(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|k| &a[k] - &b[k])
}

pub(crate) fn cross(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        &a[i] * &b[j] - &a[j] * &b[i]
    })
}

pub(crate) fn at(ray: &ScaledRay, t: &Q) -> Q3 {
    std::array::from_fn(|k| q(ray.origin[k]) + t * q(ray.direction[k]))
}

/// Greatest absolute coordinate.
pub(crate) fn reach(a: &Q3) -> Q {
    a.iter().map(Signed::abs).max().expect("three coordinates")
}

pub(crate) fn contains(slabs: &Slabs, point: &Q3) -> bool {
    (0..3).all(|k| {
        let place = dot(&q3(slabs.rows[k]), point);
        q(slabs.lo[k]) <= place && place <= q(slabs.hi[k])
    })
}

/// The interval of all real `t >= ray.t_min` at which the ray is in the box; without rounding.
pub(crate) fn clip(slabs: &Slabs, ray: &ScaledRay) -> Option<(Q, Option<Q>)> {
    let (mut near, mut far) = (q(ray.t_min), None::<Q>);
    for k in 0..3 {
        let row = q3(slabs.rows[k]);
        let (origin, slope) = (dot(&row, &q3(ray.origin)), dot(&row, &q3(ray.direction)));
        let (below, above) = (q(slabs.lo[k]) - &origin, q(slabs.hi[k]) - &origin);
        if slope.is_zero() {
            if below.is_positive() || above.is_negative() {
                return None;
            }
            continue;
        }
        let (enter, leave) = if slope.is_positive() { (below, above) } else { (above, below) };
        near = near.max(enter / &slope);
        let leave = leave / &slope;
        far = Some(far.map_or(leave.clone(), |far| far.min(leave)));
    }
    far.as_ref().is_none_or(|far| near <= *far).then_some((near, far))
}

/// `(det, u·det, v·det, t·det)` of the line of the ray and the plane of the triangle, with signs such that `det >= 0`.
pub(crate) fn triangle(ray: &ScaledRay, vertices: &[[f32; 3]; 3]) -> (Q, Q, Q, Q) {
    let [v0, v1, v2] = vertices.map(q3);
    let (o, d) = (q3(ray.origin), q3(ray.direction));
    let (e1, e2, s) = (sub(&v1, &v0), sub(&v2, &v0), sub(&o, &v0));
    let (p, n) = (cross(&d, &e2), cross(&s, &e1));
    let solved = (dot(&p, &e1), dot(&p, &s), dot(&n, &d), dot(&n, &e2));
    if solved.0.is_negative() { (-solved.0, -solved.1, -solved.2, -solved.3) } else { solved }
}
