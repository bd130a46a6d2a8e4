// choice box
// A filter that weighs all of its square alike.

/// Where a sample lies from the pixel's centre, in pixels, for a point of the unit square.
fn filtered(square: vec2<f32>) -> vec2<f32> {
    return picture.filter_radius * (2.0 * square - 1.0);
}

// choice table
// Filter importance sampling by a table of the filter's integral, linear between its steps; at most 1024 of them.
// use shared/vector

/// Share of the integral of the absolute value that lies before each step, the last 1.
@group(1) @binding(3) var<storage, read> filter_table: array<f32>;

/// Where a sample lies from the pixel's centre, in pixels, for a point of the unit square.
fn filtered(square: vec2<f32>) -> vec2<f32> {
    return vec2(along(2.0 * square.x - 1.0), along(2.0 * square.y - 1.0));
}

/// The place along one axis for a number from -1 to 1.
fn along(signed: f32) -> f32 {
    let n_steps = arrayLength(&filter_table) - 1u;
    let share = abs(signed);
    // The step that begins at or before the share: the last of those from `step` on, which is halved ten times.
    var step = 0u;
    for (var half = 512u; half > 0u; half /= 2u) {
        let middle = step + half;
        if middle < n_steps && filter_table[middle] <= share {
            step = middle;
        }
    }
    let start = filter_table[step];
    // Steps without width are never found but at the end, where the quotient is kept tame.
    let inside = clamp((share - start) / max(filter_table[step + 1u] - start, 1e-30), 0.0, 1.0);
    return with_sign(picture.filter_radius * (f32(step) + inside) / f32(n_steps), signed);
}
