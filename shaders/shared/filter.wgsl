// choice box
// Box filter.

/// Offset of a sample from the pixel center in pixels, from a point of the unit square.
fn filtered(square: vec2<f32>) -> vec2<f32> {
    return picture.filter_radius * (2.0 * square - 1.0);
}

/// Weight of that sample.
fn filter_weight(square: vec2<f32>) -> f32 {
    return 1.0;
}

// choice table
// Filter importance sampling with a table of the filter's integral, linear between its at most 1024 steps.
// use shared/numbers
// use shared/vector

/// Cumulative integral of the absolute value before each step, negative where the filter is; the last entry is 1.
@group(1) @binding(3) var<storage, read> filter_table: array<f32>;

/// Offset of a sample from the pixel center in pixels, from a point of the unit square.
fn filtered(square: vec2<f32>) -> vec2<f32> {
    return vec2(along(2.0 * square.x - 1.0), along(2.0 * square.y - 1.0));
}

/// Weight of that sample: -1 where the filter is negative, else 1.
fn filter_weight(square: vec2<f32>) -> f32 {
    let share = abs(2.0 * square - 1.0);
    return sign_of(filter_table[step_at(share.x)]) * sign_of(filter_table[step_at(share.y)]);
}

/// Offset along one axis from a number in -1..1.
fn along(signed: f32) -> f32 {
    let share = abs(signed);
    let step = step_at(share);
    let start = abs(filter_table[step]);
    // Steps of zero width are found only at the end, where the quotient is guarded.
    let inside = clamp((share - start) / max(abs(filter_table[step + 1u]) - start, 1e-30), 0.0, 1.0);
    return with_sign(picture.filter_radius * (f32(step) + inside) / f32(arrayLength(&filter_table) - 1u), signed);
}

/// The last step that starts at or before a share of the integral, by binary search.
fn step_at(share: f32) -> u32 {
    let n_steps = arrayLength(&filter_table) - 1u;
    var step = 0u;
    for (var half = 512u; half > 0u; half /= 2u) {
        let middle = step + half;
        if middle < n_steps && abs(filter_table[middle]) <= share {
            step = middle;
        }
    }
    return step;
}
