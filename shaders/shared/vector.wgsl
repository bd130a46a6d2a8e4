// Vectors whose length may be anything.
// use shared/numbers

/// The unit vector along `v`; zero where `v` has no direction, or is so short or long that quotients may leave the range.
fn unit(v: vec3<f32>) -> vec3<f32> {
    let most = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if most < 1e-36 || most > 1e37 {
        return vec3(0.0);
    }
    // Of parts up to 1, no square leaves the range.
    let scaled = v * (1.0 / most);
    return scaled * inverseSqrt(dot(scaled, scaled));
}

/// The length of `v`, whose square may leave the range.
fn size(v: vec3<f32>) -> f32 {
    let most = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if most < 1e-36 {
        return 0.0;
    }
    return most * length(v * (1.0 / most));
}

/// `size`, which is not negative, with the sign of `side`; that of -0.0 is negative.
fn with_sign(size: f32, side: f32) -> f32 {
    return size * sign_of(side);
}
