// Where instances that move are at the time of the ray.
//
// Each number of a transform goes in a straight line from opening to closing, so cofactors are polynomials of degree two in time,
// and the determinant is one of degree three. They come by their Bernstein coefficients, computed in f64: their weights are not
// negative, and hosts refuse motions of whose determinant not all coefficients have one sign, so sums of it lose no digits.
//
// # How far cofactors, determinant and place are off
// With E = 2^-23: the time is a multiple of 2^-24 in 0..1, so one minus it is exact. A weight of degree two is off by E of itself,
// one of degree three by 3 E. A cofactor is off by half an E for its coefficients, E for weights, E for products, 2 E for sums: 4.5 E
// of the sum of absolute terms. The determinant likewise by (0.5 + 3 + 1 + 3) E = 7.5 E of itself, and a place by 2 E of its terms.
// use shared/time/ray_time

struct Motion {
    /// For each axis the coefficients of its cofactors, at the opening, between and at the closing, over a common factor. They are
    /// rows of the inverse times the determinant.
    cofactors: array<mat3x3<f32>, 3>,
    /// Coefficients of the determinant over the same factor: all above zero, the greatest is 1.
    determinant: vec4<f32>,
    /// Columns of the transform at the closing.
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    shift: vec3<f32>,
}

@group(0) @binding(5) var<storage, read> motions: array<Motion>;

/// The weights of coefficients of degree two.
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

/// A column on its way.
fn between(open: vec3<f32>, close: vec3<f32>) -> vec3<f32> {
    return (1.0 - ray_time) * open + ray_time * close;
}
