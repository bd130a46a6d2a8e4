//! Rays, triangles and frames: random and degenerate.

use canted_obb::Obb;

use canted_obb::vector::{cross, dot, sub};
use canted_trace::{Ray, ScaledRay};

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
        let unit = |a: [f32; 3]| a.map(|x| x / dot(a, a).sqrt());
        let x = unit(self.vector(1.0));
        let z = unit(cross(x, self.vector(1.0)));
        [x, cross(z, x), z]
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
        2 => back = sub(triangle[1], triangle[0]).map(|x| x * 3.0),
        3 => back[axis] = 1e-40 * distance,
        _ => {}
    }
    let origin: [f32; 3] = std::array::from_fn(|k| target[k] + back[k]);
    let direction = if rng.below(2) == 0 { sub(target, origin) } else { back.map(|x| -x) };
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
    let ray = ScaledRay::new(&Ray::new(origin, sub(target, origin)));
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
