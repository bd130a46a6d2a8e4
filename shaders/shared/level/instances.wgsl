// A tree a mesh, and a tree over the instances.
//
// # What the transform adds
// The CPU takes a ray to object space in f64 and rounds once. Here each component is three products of the inverse's rows,
// rounded from f64, with the direction, and with the origin from where the instance stands. With E = 2^-23 a component of the
// direction is off by half an E for its row, 3 E for products and sums, half an E for the CPU's own, of the sum of absolute
// products; 5 E are more. The origin has one E more for the difference. A sheared coordinate of a triangle within M differs
// by twice the origin's, and by twice the direction's over its greatest component for each unit of M.
// use shared/instance

/// Takes the ray to the instance that a leaf of the outer tree names; the root of its tree.
fn enter_inner(ray: Ray, word: u32) -> u32 {
    let instance = instance_order[word & LEAF_FIRST];
    let entry = instances[instance];
    let away = ray.origin - vec3<f32>(entry.row_x.w, entry.row_y.w, entry.row_z.w);
    return enter_instance(ray, instance, still_inverse(entry), away, abs(away), vec2<f32>(ORIGIN_ROUNDING, DIRECTION_ROUNDING));
}
