// Filter importance sampling by a table of the filter's integral, linear between its steps; at most 1024 of them.
// use shared/vector

struct Filtered {
    /// From the pixel's centre, in pixels.
    offset: vec2<f32>,
    weight: f32,
}

/// Share of the integral of the absolute value that lies before each step, the last 1; negative before steps where the filter is.
@group(1) @binding(3) var<storage, read> filter_table: array<f32>;

/// Where a sample lies for a point of the unit square, and what it weighs.
fn filtered(square: vec2<f32>) -> Filtered {
    let x = along(2.0 * square.x - 1.0);
    let y = along(2.0 * square.y - 1.0);
    return Filtered(vec2(x.x, y.x), x.y * y.y);
}

/// The place along one axis, and its weight, for a number from -1 to 1.
fn along(signed: f32) -> vec2<f32> {
    let n_steps = arrayLength(&filter_table) - 1u;
    let share = abs(signed);
    // The step that begins at or before the share: the last of those from `step` on, which is halved ten times.
    var step = 0u;
    for (var half = 512u; half > 0u; half /= 2u) {
        let middle = step + half;
        if middle < n_steps && abs(filter_table[middle]) <= share {
            step = middle;
        }
    }
    let start = abs(filter_table[step]);
    // Steps without width are never found but at the end, where the quotient is kept tame.
    let inside = clamp((share - start) / max(abs(filter_table[step + 1u]) - start, 1e-30), 0.0, 1.0);
    let x = picture.filter_radius * (f32(step) + inside) / f32(n_steps);
    let weight = with_sign(picture.filter_excess, filter_table[step]);
    return vec2(with_sign(x, signed), weight);
}
