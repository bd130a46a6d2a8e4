//! Moving instances, in the layout of `shared/motion.wgsl`.

use bytemuck::{Pod, Zeroable};
use canted_obb::Affine;
use canted_obb::vector::{cross, dot};
use canted_tlas::Instance;

type Vector = [f64; 3];

/// The inverse of a transform that changes linearly from shutter opening to closing: cofactors and determinant by their
/// Bernstein coefficients.
///
/// Kernels divide one by the other. If all coefficients of the determinant have the same sign, the error of the quotient is
/// bounded by [`MotionPolynomials::norm_of_inverse`]. This holds for rotations of less than 120 degrees between transforms of
/// similar scale.
#[derive(Clone, Debug)]
pub struct MotionPolynomials {
    /// Coefficients of the cofactors for each axis: rows of the inverse times the determinant.
    cofactors: [[Vector; 3]; 3],
    determinant: [f64; 4],
    close: Affine,
}

impl MotionPolynomials {
    /// The motion of an instance; `None` if it does not move.
    #[must_use]
    pub fn of(instance: &Instance) -> Option<Self> {
        let open = instance.world_from_object;
        instance.world_from_object_close.filter(|close| *close != open).map(|close| Self::new(&open, close))
    }

    fn new(open: &Affine, close: Affine) -> Self {
        let [m, n] = [open, &close].map(|map| map.columns.map(|column| column.map(f64::from)));
        // Between `M` and `N` the cofactors are `(1-s)² cof M + 2s(1-s) C + s² cof N`, where `C` contains products of both, and
        // similarly for the determinant: polar forms of a square and a cube (Ramshaw 1989).
        let cofactors: [[Vector; 3]; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let (mixed, other) = (cross(m[i], n[j]), cross(n[i], m[j]));
            [cross(m[i], m[j]), std::array::from_fn(|x| 0.5 * (mixed[x] + other[x])), cross(n[i], n[j])]
        });
        let [first, between, last] = cofactors[0];
        let third = |a: f64, b: f64| (a + 2.0 * b) / 3.0;
        let determinant = [
            dot(m[0], first),
            third(dot(n[0], first), dot(m[0], between)),
            third(dot(m[0], last), dot(n[0], between)),
            dot(n[0], last),
        ];
        Self { cofactors, determinant, close }
    }

    /// Upper bound, over all times, of the greatest row sum of absolute terms of the inverse; infinite if coefficients of the
    /// determinant are zero or differ in sign.
    ///
    /// Raised to degree three, cofactors and determinant are means of their coefficients with the same weights. A quotient of
    /// means of nonnegative numbers is at most the greatest quotient.
    #[must_use]
    pub fn norm_of_inverse(&self) -> f64 {
        let sign = self.determinant[0].signum();
        let at = |coefficient: usize| {
            let rows = self.cofactors.map(|[a, b, c]| {
                let [a, b, c] = [a, b, c].map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
                [a, (a + 2.0 * b) / 3.0, (2.0 * b + c) / 3.0, c][coefficient]
            });
            let divisor = sign * self.determinant[coefficient];
            let greatest = rows.into_iter().fold(0.0, f64::max);
            if divisor > 0.0 && greatest.is_finite() { greatest / divisor } else { f64::INFINITY }
        };
        (0..4).map(at).fold(0.0, f64::max)
    }

    /// Divisor of the cofactors, without sign: the greatest coefficient of the determinant.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.determinant.iter().fold(0.0, |all, x| all.max(x.abs()))
    }

    #[expect(clippy::cast_possible_truncation, reason = "roundings are within the kernel's bound")]
    pub(super) fn words(&self) -> MotionData {
        let factor = self.determinant[0].signum() / self.scale();
        let [x, y, z, shift] = self.close.columns;
        let padded = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        MotionData {
            cofactors: self.cofactors.map(|axis| axis.map(|row| padded(row.map(|c| (factor * c) as f32)))),
            determinant: self.determinant.map(|d| (factor * d) as f32),
            columns: [x, y, z, shift].map(padded),
        }
    }
}

/// `Motion` in `shared/motion.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct MotionData {
    cofactors: [[[f32; 4]; 3]; 3],
    determinant: [f32; 4],
    columns: [[f32; 4]; 4],
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use canted_shaders::{Shader, Specialisation};

    use super::*;

    fn about_z(angle: f64, scale: f64) -> Affine {
        #[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
        let column = |c: Vector| c.map(|x| (scale * x) as f32);
        let (sine, cosine) = angle.sin_cos();
        let [x, y, z] = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, -1.0]].map(column);
        Affine { columns: [x, y, z, [1.0, 2.0, 3.0]] }
    }

    /// The inverse at a time, by Gaussian elimination.
    fn inverse(open: &Affine, close: &Affine, time: f64) -> [Vector; 3] {
        let mut rows: [[f64; 6]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| match j {
                0..3 => {
                    let [from, to] = [open, close].map(|map| f64::from(map.columns[j][i]));
                    from + time * (to - from)
                }
                _ => f64::from(u8::from(j - 3 == i)),
            })
        });
        for k in 0..3 {
            let pivot = (k..3).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).unwrap();
            rows.swap(k, pivot);
            let of_pivot = rows[k].map(|x| x / rows[k][k]);
            rows = std::array::from_fn(|i| {
                std::array::from_fn(|j| if i == k { of_pivot[j] } else { rows[i][j] - rows[i][k] * of_pivot[j] })
            });
        }
        rows.map(|row| [row[3], row[4], row[5]])
    }

    #[test]
    fn cofactors_over_determinant_match_the_inverse_at_all_times() {
        for (angle, scale) in [(0.0, 1.0), (0.4, 1.0), (1.5, 1e-3), (2.0, 3.0), (-1.0, 0.2)] {
            let (open, close) = (about_z(0.3, 1.0), about_z(0.3 + angle, scale));
            let motion = MotionPolynomials::new(&open, close);
            let bound = motion.norm_of_inverse();
            let mut greatest = 0.0_f64;
            for step in 0..=64 {
                let time = f64::from(step) / 64.0;
                let rest = 1.0 - time;
                let two = [rest * rest, 2.0 * time * rest, time * time];
                let three =
                    [rest * rest * rest, 3.0 * time * rest * rest, 3.0 * time * time * rest, time * time * time];
                let determinant: f64 = (0..4).map(|i| three[i] * motion.determinant[i]).sum();
                for (row, axis) in inverse(&open, &close, time).into_iter().zip(motion.cofactors) {
                    greatest = greatest.max(row.iter().map(|x| x.abs()).sum());
                    for (k, expected) in row.into_iter().enumerate() {
                        let cofactor: f64 = (0..3).map(|i| two[i] * axis[i][k]).sum();
                        let off = cofactor / determinant - expected;
                        assert!(off.abs() <= 1e-9 * bound, "{angle} {scale} at {time}: {off}");
                    }
                }
            }
            assert!(bound >= greatest && bound <= 8.0 * greatest, "{angle} {scale}: {bound}, {greatest}");
        }
    }

    #[test]
    fn motions_with_cancellation_have_no_bound() {
        // A rotation of 130 degrees, one through a singular matrix, and a mirror.
        for angle in [130.0_f64, 180.0] {
            assert_eq!(
                MotionPolynomials::new(&about_z(0.0, 1.0), about_z(angle.to_radians(), 1.0)).norm_of_inverse(),
                f64::INFINITY
            );
        }
        assert_eq!(MotionPolynomials::new(&Affine::IDENTITY, about_z(0.0, 1.0)).norm_of_inverse(), f64::INFINITY);
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "offsets are small")]
    fn motion_layout_matches_the_kernel() {
        let chosen = Specialisation::none()
            .part("level", "shared/level/moving")
            .part("node_kinds", "shared/node_kinds/any")
            .part("traverse", "shared/traverse/stack")
            .part("mask", "shared/mask/none")
            .part("count", "shared/count/none")
            .number("STACK_SIZE", 4)
            .number("MAX_ITERATIONS", 1000);
        let shader = Shader::new("trace/closest", &chosen).unwrap();
        let layout = shader.layout("Motion").unwrap();
        let columns = offset_of!(MotionData, columns);
        let offsets = [
            offset_of!(MotionData, cofactors),
            offset_of!(MotionData, determinant),
            columns,
            columns + 16,
            columns + 32,
            columns + 48,
        ];
        let found: Vec<u32> = layout.members.iter().map(|(_, offset)| *offset).collect();
        assert_eq!((found, layout.size), (offsets.map(|x| x as u32).to_vec(), size_of::<MotionData>() as u32));
    }
}
