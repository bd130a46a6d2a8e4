//! Bodies and random numbers of the tests.
#![allow(dead_code, reason = "each test program uses some of it")]

use elastic::{Body, Material};

/// Without losses.
pub(crate) const ELASTIC: Material = Material { viscosity_s: 0.0, ..Material::RUBBER };

/// Spacing of the phyxels, m.
pub(crate) const SPACING: f32 = 0.1;

/// Points of a cubic lattice with a notch, so that the body has no symmetry.
pub(crate) fn lattice(n: u8, offset: [f32; 3]) -> Vec<[f32; 3]> {
    let cells = (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| [x, y, z])));
    let is_in_notch = |[x, y, z]: [u8; 3]| x + 1 >= n && y + 2 >= n && z <= n / 2;
    cells
        .filter(|&cell| !is_in_notch(cell))
        .map(|cell| std::array::from_fn(|k| offset[k] + SPACING * f32::from(cell[k])))
        .collect()
}

/// A body of `n³` phyxels, less a notch.
pub(crate) fn body(n: u8, material: &Material) -> Body {
    Body::new(&lattice(n, [0.3, -0.2, 0.1]), f64::from(SPACING).powi(3), material).unwrap()
}

/// Pseudo-random numbers in `[-1, 1)`.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let upper = (self.0 >> 32) as u32;
        f64::from(upper) / f64::from(1_u32 << 31) - 1.0
    }

    pub(crate) fn vector(&mut self, scale: f64) -> [f64; 3] {
        std::array::from_fn(|_| scale * self.next())
    }
}

/// Independent random displacements and velocities of the phyxels.
pub(crate) fn shake(body: &mut Body, seed: u64, displacement: f64, velocity: f64) {
    let random = std::cell::RefCell::new(Random(seed));
    body.set_state(|_| {
        let mut random = random.borrow_mut();
        [random.vector(displacement), random.vector(velocity)]
    });
}

/// The image of a point under a rotation about the z axis, then about the x axis.
pub(crate) fn rotated([x, y, z]: [f64; 3], about_z_rad: f64, about_x_rad: f64) -> [f64; 3] {
    let ((s, c), (t, d)) = (about_z_rad.sin_cos(), about_x_rad.sin_cos());
    let [x, y] = [c * x - s * y, s * x + c * y];
    [x, d * y - t * z, t * y + d * z]
}

/// Length of a vector.
pub(crate) fn length(v: [f64; 3]) -> f64 {
    v.map(|x| x * x).iter().sum::<f64>().sqrt()
}

/// The difference of two vectors.
pub(crate) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}
