// Moving instances at the time of the ray.
//
// Each entry of a transform is linear in time between shutter opening and closing, so cofactors are polynomials of degree two
// and the determinant is one of degree three. They are given by their Bernstein coefficients, computed in f64. The weights are
// not negative, and the host rejects motions whose determinant has coefficients of both signs, so the sums do not cancel.
//
// # Error of cofactors, determinant and position
// With E = 2^-23: the time is a multiple of 2^-24 in 0..1, so one minus it is exact. A weight of degree two errs by E, one of
// degree three by 3 E. A cofactor errs by E / 2 for its coefficients, E for weights, E for products and 2 E for sums: 4.5 E of
// the sum of absolute terms. Likewise the determinant errs by (0.5 + 3 + 1 + 3) E = 7.5 E, and a position by 2 E of its terms.
// use shared/time/ray_time

struct Motion {
    /// For each axis the coefficients of its cofactors at opening, between, and at closing, divided by a common factor. They
    /// are rows of the inverse times the determinant.
    cofactors: array<mat3x3<f32>, 3>,
    /// Coefficients of the determinant, divided by the same factor: all positive, the largest is 1.
    determinant: vec4<f32>,
    /// Columns of the transform at closing.
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    shift: vec3<f32>,
}

@group(0) @binding(5) var<storage, read> motions: array<Motion>;

/// Bernstein weights of degree two.
fn weights_of_time() -> vec3<f32> {
    let rest = 1.0 - ray_time;
    return vec3(rest * rest, 2.0 * ray_time * rest, ray_time * ray_time);
}

fn determinant_of(motion: u32) -> f32 {
    let rest = 1.0 - ray_time;
    let weights = vec4(rest * rest * rest, 3.0 * ray_time * (rest * rest), 3.0 * (ray_time * ray_time) * rest,
        ray_time * ray_time * ray_time);
    return dot(weights, motions[motion].determinant);
}

/// A column at the time of the ray.
fn between(open: vec3<f32>, close: vec3<f32>) -> vec3<f32> {
    return (1.0 - ray_time) * open + ray_time * close;
}
