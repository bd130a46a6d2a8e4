// Directions over the hemisphere around a unit normal, with densities; twin of crates/renderer/src/sampling.rs.
// use shared/numbers
// use shared/angle

/// A right-handed orthonormal frame whose third column is a unit normal (Duff et al. 2017).
///
/// Matrix times vector maps local to world coordinates, vector times matrix maps world to local.
fn basis_about(normal: vec3<f32>) -> mat3x3<f32> {
    let sign = sign_of(normal.z);
    // The divisor is at least 1 in absolute value for either sign.
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let first = vec3(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    let second = vec3(b, sign + normal.y * normal.y * a, -normal.y);
    return mat3x3(first, second, normal);
}

/// A direction around +z with density `cos/pi`, from a point of the unit square; never exactly at the horizon.
fn cosine_hemisphere(square: vec2<f32>) -> vec3<f32> {
    let turned = circle(square.y);
    return vec3(sqrt(square.x) * turned, sqrt(1.0 - square.x));
}

/// Density of `cosine_hemisphere` for a cosine.
fn cosine_density(cosine: f32) -> f32 {
    return max(cosine, 0.0) / PI;
}

/// A uniform point of the unit disk from a point of the unit square (Shirley and Chiu 1997).
fn uniform_disk(square: vec2<f32>) -> vec2<f32> {
    let p = 2.0 * square - 1.0;
    if p.x == 0.0 && p.y == 0.0 {
        return vec2(0.0);
    }
    // An eighth of a turn to each side of an axis.
    if abs(p.x) > abs(p.y) {
        return p.x * circle(0.125 * (p.y / p.x));
    }
    return p.y * circle(0.25 - 0.125 * (p.x / p.y));
}
