//! The offset at which secondary rays of the GPU start.
//!
//! The derivation is that of `placement` with GPU arithmetic: `E = 2⁻²³` bounds the rounding of a sum or product in any rounding
//! mode, fused or not. `W` is the greatest absolute coordinate in world space, of all instances with one level, otherwise of the
//! instance. Along each axis,
//!
//! - tracing accepts points within `64·E·S` of a triangle, `S <= 2·W` for origins on it: `128 E`;
//! - the hit point is three products of vertices and weights, of which `1 - u - v` has an error of `2 E`, in two sums: `5 E`; its
//!   transform adds four terms, `4 E`; the offset along the normal, `E`: together `10 E`;
//! - the normal comes from `f64`, rounded and normalized: it is tilted by `3 E`, and a ray that leaves a tilted plane gets below
//!   the true one by that share of its length, at most `2·√3·W` within the instance: `11 E`;
//! - in world space the normal is that of the triangle before its vertices were rounded, each by half an `E`: within the triangle
//!   the two planes are no farther apart, at either end of a ray along it; with a margin, `2 E`;
//! - the sign of a product with the normal selects the side; it is exact but for `3 E`, as above: `11 E`.
//!
//! The transform of an instance adds, with `κ` the greatest row sum of `|M⁻¹|·|M|`: direction and origin in object space have an
//! error of `2·(6 + 5) E` of sums of absolute products, at most `2 κ` of the reach; and cofactors tilt a normal by `4 E` of
//! `‖M‖·‖M⁻¹‖` in Frobenius norms.
//!
//! For a moving instance, `W` and `‖M‖` are the maxima over the motion and `‖M⁻¹‖` is of absolute terms, all greatest row sums, with
//! `k` their product. The numbers of the transform have a relative error of `2 E`, once for coordinates and once for the shift: `4 E`.
//! In object space a direction has an error of `2·20 E` and an origin of `2·21 E·9/8` of `‖M⁻¹‖` times at most `2·W`, which `‖M‖` scales
//! to `175 E·k` of `W`, with a margin; cofactors have an error of `4.5 E`, their products of `3 E`, so a normal is tilted by `8 E` of
//! Frobenius norms, which are at most `3·k`.

use canted_gpu::MotionPolynomials;
use canted_obb::Affine;
use glam::DVec3;

use crate::surface::Pose;

/// Relative bound of one rounding.
const E: f64 = f32::EPSILON as f64;

/// Margin for second-order terms and subnormals.
const MARGIN: f64 = 1.0 + 1.0 / 1024.0;

/// Error along each axis relative to `W`, for vertices in world space.
const IN_WORLD: f64 = (128.0 + 10.0 + 11.0 + 2.0 + 11.0) * E;

/// Error along each world axis between the plane of a triangle and a ray that leaves it, for vertices in world space with
/// greatest absolute coordinate `reach`.
pub(super) fn in_world(reach: f32) -> f32 {
    rounded_up(IN_WORLD * f64::from(reach))
}

/// The same for an instance of a mesh with greatest absolute coordinate `reach_object`.
pub(super) fn of_instance(world_from_object: &Affine, reach_object: f32) -> f32 {
    let Pose { columns: m, cofactor } = Pose::fixed(world_from_object);
    let reach_world = world_from_object.reach(reach_object);
    // Rows of the inverse are the columns of cofactors over the determinant.
    let inverse = cofactor.map(|row| row / m[0].dot(cofactor[0]));
    let row_sum =
        |i: usize| -> f64 { (0..3).map(|j| (0..3).map(|k| (inverse[i][k] * m[j][k]).abs()).sum::<f64>()).sum() };
    let kappa = (0..3).map(row_sum).fold(0.0, f64::max);
    let frobenius = |rows: [DVec3; 3]| DVec3::from(rows.map(DVec3::length)).length();
    let condition = frobenius([m[0], m[1], m[2]]) * frobenius(inverse);
    let tilt = 4.0 * 2.0 * 3.0_f64.sqrt() * condition;
    rounded_up((IN_WORLD + (2.0 * 22.0 * kappa + tilt) * E) * reach_world)
}

/// The same for an instance that moves between two transforms.
pub(super) fn of_moving(
    ends: impl Iterator<Item = Affine> + Clone,
    motion: &MotionPolynomials,
    reach_object: f32,
) -> f32 {
    let reach_world = ends.clone().map(|end| end.reach(reach_object)).fold(0.0, f64::max);
    let forward = ends.map(|end| end.row_sum_norm()).fold(0.0, f64::max);
    let condition = forward * motion.norm_of_inverse();
    let tilt = 8.0 * 2.0 * 3.0_f64.sqrt() * 3.0 * condition;
    rounded_up((IN_WORLD + (4.0 + 175.0 * condition + tilt) * E) * reach_world)
}

fn rounded_up(slack: f64) -> f32 {
    (MARGIN * slack).min(f64::from(f32::MAX)) as f32 + f32::MIN_POSITIVE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slack_grows_with_coordinates_and_shear() {
        // Two roundings, and that of their quotient.
        assert!((in_world(2.0) / in_world(1.0) - 2.0).abs() <= 3.0 * f32::EPSILON);
        let plain = of_instance(&Affine::IDENTITY, 1.0);
        assert!(plain > in_world(1.0));
        let mut sheared = Affine::IDENTITY;
        sheared.columns[1][0] = 50.0;
        // Coordinates are 51 times as large, and the shear amplifies errors.
        assert!(of_instance(&sheared, 1.0) > 2.0 * 51.0 * plain);
    }
}
