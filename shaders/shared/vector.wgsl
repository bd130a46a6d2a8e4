// Vectors of any length.
// use shared/numbers

/// The unit vector along `v`; zero if `v` has no direction or quotients would leave the range.
fn unit(v: vec3<f32>) -> vec3<f32> {
    let most = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if most < 1e-36 || most > 1e37 {
        return vec3(0.0);
    }
    // Components up to 1 have squares within the range.
    let scaled = v * (1.0 / most);
    return scaled * inverseSqrt(dot(scaled, scaled));
}

/// The length of `v`, whose square may overflow or underflow.
fn size(v: vec3<f32>) -> f32 {
    let most = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if most < 1e-36 {
        return 0.0;
    }
    return most * length(v * (1.0 / most));
}

/// The nonnegative `size` with the sign of `side`; -0.0 counts as negative.
fn with_sign(size: f32, side: f32) -> f32 {
    return size * sign_of(side);
}
