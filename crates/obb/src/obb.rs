use crate::{Aabb, Affine};

/// A box that may lean: all points `center + frame · q` with `|q[k]| <= half[k]`.
///
/// `frame[k]` is the direction of axis `k` (a column of the matrix). It is orthonormal up to rounding after a fit and
/// skewed after a shear: an affine image of a box stays exact. `half >= 0`; zero is legal.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Obb {
    /// Midpoint, in the space of the points.
    pub center: [f32; 3],
    /// Directions of the three axes, invertible as a matrix.
    pub frame: [[f32; 3]; 3],
    /// Half-extents along the axes, in units of the axes' lengths.
    pub half: [f32; 3],
}

impl Obb {
    /// The unrotated frame.
    pub const IDENTITY_FRAME: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// The eight corners in `f64`; bit `k` of the index chooses the positive side of axis `k`.
    #[must_use]
    pub fn corners(&self) -> [[f64; 3]; 8] {
        std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                (0..3).fold(f64::from(self.center[k]), |sum, a| {
                    let side = f64::from(self.frame[a][k]) * f64::from(self.half[a]);
                    if i >> a & 1 == 1 { sum + side } else { sum - side }
                })
            })
        })
    }

    /// Surface area in square scene units, exact for skewed frames too.
    #[must_use]
    pub fn area(&self) -> f64 {
        let e: [[f64; 3]; 3] = std::array::from_fn(|a| {
            std::array::from_fn(|k| 2.0 * f64::from(self.frame[a][k]) * f64::from(self.half[a]))
        });
        let face = |a: [f64; 3], b: [f64; 3]| {
            let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt()
        };
        2.0 * (face(e[0], e[1]) + face(e[1], e[2]) + face(e[2], e[0]))
    }

    /// Volume in cubic scene units.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let frame = Affine { columns: [self.frame[0], self.frame[1], self.frame[2], [0.0; 3]] };
        8.0 * frame.determinant().abs() * self.half.iter().map(|&h| f64::from(h)).product::<f64>()
    }

    /// Smallest axis-aligned box around the eight corners, rounded outward.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let mut aabb = Aabb::EMPTY;
        for corner in self.corners() {
            for k in 0..3 {
                // A corner carries four roundings of f64; one unit in the last place of f32 covers them many times over.
                #[expect(clippy::cast_possible_truncation, reason = "widened by one unit in the last place below")]
                let x = corner[k] as f32;
                aabb.min[k] = aabb.min[k].min(x.next_down());
                aabb.max[k] = aabb.max[k].max(x.next_up());
            }
        }
        aabb
    }
}
