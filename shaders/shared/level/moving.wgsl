// A tree a mesh, and a tree over the instances, of which some move while the shutter is open.
//
// # What the transform adds
// Of what stands still, what shared/level/instances says. A row of a moving instance's inverse is cofactors over the determinant, off by
// 4.5 E and 7.5 E (shared/motion), by 2.5 E for the quotient and E for the product: 15.5 E of the sum of absolute terms, `sizes`. With
// 3 E for products and sums and half an E for the CPU's own a direction is off by 19 E; 20 E leave room for second order, and for
// rows and motions rounded on the CPU in f64. The origin has E more for the difference, and its place is off by 2 E of its own terms,
// for which an eighth of them is added to what 21 E are taken of.
// use shared/motion
// use shared/instance

const MOVING_DIRECTION_ROUNDING: f32 = 20.0 * ROUNDING;
const MOVING_ORIGIN_ROUNDING: f32 = 21.0 * ROUNDING;

/// Takes the ray to the instance that a leaf of the outer tree names; the root of its tree.
fn enter_inner(ray: Ray, word: u32) -> u32 {
    let instance = instance_order[word & LEAF_FIRST];
    let entry = instances[instance];
    let open = vec3<f32>(entry.row_x.w, entry.row_y.w, entry.row_z.w);
    var inverse = still_inverse(entry);
    var away = ray.origin - open;
    var far_away = abs(away);
    var roundings = vec2<f32>(ORIGIN_ROUNDING, DIRECTION_ROUNDING);
    if entry.tree.y != 0u {
        let motion = entry.tree.y - 1u;
        inverse = moving_inverse(motion);
        away = ray.origin - between(open, motions[motion].shift);
        far_away = abs(away) + 0.125 * between(abs(open), abs(motions[motion].shift));
        roundings = vec2<f32>(MOVING_ORIGIN_ROUNDING, MOVING_DIRECTION_ROUNDING);
    }
    return enter_instance(ray, instance, inverse, away, far_away, roundings);
}

/// The inverse on the way.
fn moving_inverse(motion: u32) -> Inverse {
    let weights = weights_of_time();
    // Above 2^-34, by what hosts refuse.
    let share = reciprocal(determinant_of(motion));
    var inverse: Inverse;
    for (var k = 0u; k < 3u; k++) {
        let row = motions[motion].cofactors[k];
        inverse.rows[k] = share * (row * weights);
        inverse.sizes[k] = share * (mat3x3<f32>(abs(row[0]), abs(row[1]), abs(row[2])) * weights);
    }
    return inverse;
}
