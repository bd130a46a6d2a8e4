// Oriented boxes as slabs.
//
// # Half-extents
// A point of the box is `c + F q` with `|q_j| <= h_j`, for any columns F: boxes of instances may be scaled and
// skewed. Along an axis w, the stored unit vector along a column, it lies within the sum of `|w F_j| h_j`. With E = 2^-23, a dot
// product errs by 3 E of its absolute terms, less than 4 E as computed; the sum and the products with h_j take four more
// roundings, and 6 E covers these.
// use shared/build/enclosure

/// The unit vector along a column, and the half-extent of the box along it.
fn slab_of(columns: mat3x3<f32>, half_extents: vec3<f32>, k: u32) -> vec4<f32> {
    var all = columns;
    let axis = unit_along(all[k]);
    let along = abs(vec3<f32>(dot(axis, columns[0]), dot(axis, columns[1]), dot(axis, columns[2])));
    let size = abs(axis);
    let sizes = vec3<f32>(dot(size, abs(columns[0])), dot(size, abs(columns[1])), dot(size, abs(columns[2])));
    return vec4<f32>(axis, dot(along + 4.0 * ROUNDING * sizes, half_extents) * (1.0 + 6.0 * ROUNDING) + TINY);
}

/// The unit vector along a column, of any length above 1e-30. Its own rounding moves the axis, not the half-extent along it.
fn unit_along(v: vec3<f32>) -> vec3<f32> {
    let size = max(abs(v.x), max(abs(v.y), abs(v.z)));
    return normalize(v / max(size, 1e-30));
}
