// Sine, cosine and arc tangent. WGSL promises only 2^-11 for `sin` and 4,096 ULP for `atan2`; these are accurate to a few ULP
// on every device, which lookups and CPU twins need.
// use shared/numbers

/// Cosine and sine of an angle in turns, in -2..=2, each within 4 * 2^-24.
///
/// Subtracts the nearest quarter exactly. The remainder is at most an eighth of a turn, where the truncated Taylor series err
/// by less than 2^-28.
fn circle(turns: f32) -> vec2<f32> {
    let quarter = round(4.0 * turns);
    let x = TAU * (turns - 0.25 * quarter);
    let y = x * x;
    let c = 1.0 + y * (-1.0 / 2.0 + y * (1.0 / 24.0 + y * (-1.0 / 720.0 + y * (1.0 / 40320.0 - y / 3628800.0))));
    let s = x * (1.0 + y * (-1.0 / 6.0 + y * (1.0 / 120.0 + y * (-1.0 / 5040.0 + y / 362880.0))));
    switch i32(quarter) & 3 {
        case 0: { return vec2(c, s); }
        case 1: { return vec2(-s, c); }
        case 2: { return vec2(-c, -s); }
        default: { return vec2(s, -c); }
    }
}

/// Angle in -pi..=pi of the point `(x, y)` from the x axis, with a relative error of at most 6 * 2^-24; 0 at the origin.
fn angle_of(y: f32, x: f32) -> f32 {
    let most = max(abs(x), abs(y));
    if most == 0.0 {
        return 0.0;
    }
    // Reduce to the first octant, then to half of it, so that the series only needs tangents up to that of a sixteenth of a
    // turn.
    let tangent = min(abs(x), abs(y)) / most;
    let is_far = tangent > 0.41421356;
    var angle = arc(select(tangent, (tangent - 1.0) / (tangent + 1.0), is_far));
    angle = select(angle, 0.25 * PI + angle, is_far);
    angle = select(angle, 0.5 * PI - angle, abs(y) > abs(x));
    angle = select(angle, PI - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}

/// Arc tangent up to `sqrt(2) - 1`; the relative truncation error is below 2^-24.
fn arc(t: f32) -> f32 {
    let y = t * t;
    let low = 1.0 + y * (-1.0 / 3.0 + y * (1.0 / 5.0 - y / 7.0));
    let high = 1.0 / 9.0 + y * (-1.0 / 11.0 + y * (1.0 / 13.0 - y / 15.0));
    return t * (low + (y * y) * (y * y) * high);
}
