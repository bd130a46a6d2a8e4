//! Point sets by name, extreme and random; the same on every run.

use canted_obb::{Frame, Quaternion};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [-1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    pub(crate) fn vector(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.signed())
    }

    /// Uniform over all rotations (Marsaglia's rejection in four dimensions).
    pub(crate) fn rotation(&mut self) -> Quaternion {
        loop {
            let q = Quaternion { w: self.signed(), x: self.signed(), y: self.signed(), z: self.signed() };
            let square = q.dot(q);
            if square > 0.01 && square <= 1.0 {
                return q.normalized();
            }
        }
    }

    pub(crate) fn frame(&mut self) -> Frame {
        self.rotation().frame()
    }
}

/// `frame · (scale ∘ x) + offset`, rounded to `f32`.
pub(crate) fn placed(frame: Frame, scale: [f64; 3], offset: [f64; 3], x: [f64; 3]) -> [f32; 3] {
    std::array::from_fn(|k| ((0..3).map(|a| f64::from(frame[a][k]) * scale[a] * x[a]).sum::<f64>() + offset[k]) as f32)
}

fn cloud(seed: u64, n: usize, scale: [f64; 3], offset: [f64; 3]) -> Vec<[f32; 3]> {
    let mut random = Random(seed);
    let frame = random.frame();
    (0..n).map(|_| placed(frame, scale, offset, random.vector())).collect()
}

/// Every set has at least one point; all are finite.
pub(crate) fn all() -> Vec<(String, Vec<[f32; 3]>)> {
    let mut sets: Vec<(String, Vec<[f32; 3]>)> = Vec::new();
    let mut add = |name: &str, points: Vec<[f32; 3]>| sets.push((name.to_owned(), points));
    add("one point", vec![[0.1, -7.3, 1e6]]);
    add("two points", vec![[0.1, 0.2, 0.3], [-4.7, 1.1, 9.9]]);
    add("copies of a point", vec![[0.1, -3.7, 123.456]; 50]);
    add("negative zeros", vec![[-0.0, 0.0, -0.0], [0.0, -0.0, 1.0], [-0.0, 1.0, -0.0]]);
    add("collinear", (0..40).map(|i| [0.3 * i as f32, 0.7 * i as f32, -1.1 * i as f32]).collect());
    add("flat in a wall", (0..60).map(|i| [2.5, (i % 7) as f32 * 0.1, (i % 11) as f32 * 0.3]).collect());
    let corners = |side: f32| (0..8).map(move |i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { side } else { -side }));
    add("cube", corners(1.0).collect());
    add("box", corners(1.0).map(|[x, y, z]| [x, 5.0 * y, 0.1 * z]).collect());
    add(
        "octahedron",
        vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
    );
    add("tetrahedron", vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]);
    let bits = |seed| {
        let mut random = Random(seed);
        (0..40).map(|_| [0; 3].map(|_: u32| f32::from_bits((random.bits() as u32) & 0x807f_ffff))).collect()
    };
    add("denormals", bits(1));
    let mut random = Random(2);
    let any = std::iter::repeat_with(|| f32::from_bits(random.bits() as u32)).filter(|x| x.is_finite());
    let any: Vec<f32> = any.take(120).collect();
    add("any bits", any.chunks(3).map(|c| [c[0], c[1], c[2]]).collect());
    add("full range", vec![[f32::MAX, f32::MAX, f32::MIN], [f32::MIN, f32::MAX, 0.0], [0.0, f32::MIN, f32::MIN]]);
    for seed in 10..16 {
        add("random", cloud(seed, 60, [3.0, 1.0, 0.3], [1.0, -2.0, 5.0]));
        add("needle", cloud(seed, 40, [1e3, 1e-3, 1e-3], [0.0; 3]));
        add("oblique plane", cloud(seed, 60, [4.0, 3.0, 0.0], [0.1, 0.2, 0.3]));
        add("oblique line", cloud(seed, 30, [4.0, 0.0, 0.0], [9.0, 0.0, 0.0]));
        add("far away", cloud(seed, 60, [5.0, 2.0, 1.0], [1e7, -1e7, 3e6]));
        add("far on one axis", cloud(seed, 60, [1e-3, 2e-3, 1e-3], [1e7, 0.0, -0.5]));
        add("tiny", cloud(seed, 40, [1e-20, 2e-20, 1e-21], [0.0; 3]));
        add("huge", cloud(seed, 40, [1e20, 2e20, 1e19], [-1e20; 3]));
        add("near denormal", cloud(seed, 40, [1e-38, 2e-38, 1e-39], [0.0; 3]));
    }
    sets
}
