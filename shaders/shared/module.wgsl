// Traversal as a module of a program's kernel: what it calls, and where rays that leave a hit start. The names are those of `module.rs`.
//
// # Where a ray leaves
// `origin_beside` moves the point of a hit along the normal to a side of the plane from which the ray does not meet its triangle, nor any triangle of the
// same mesh behind that plane. All bounds are those of the traversal. In object space let n be the normal, exact but for a rounding, |n| the sum of its
// absolute components, a a vertex, K and D origin and direction of the ray as the traversal computes them, D with its largest component in 1..2, E = 2^-23.
//
// *Accepted hits.* A hit that the traversal accepts has a point K + t D within `hit_error` of its triangle in each coordinate (shared/bvh). If the triangle is
// not in front of the plane, then n (K + t D - a) <= hit_error |n|, with the sign of n toward the ray's side. So it suffices that n (K - a) is greater
// than hit_error |n| plus what K + t D may sink toward the plane.
//
// *Sinking.* The side is the sign of n D as computed, with an error of 3.5 E of its terms: 7 E |n|. When the ray is traced, D may be compiled otherwise; both
// are within drift.y / 2 of the CPU's. And t is at most scale + hit_error, because the point is within the reach of the mesh: (7 E + drift.y) (scale + hit_error) |n|.
//
// *Distance of the point.* n (K - a) is measured with an error of 5 E of its terms, and K is within drift.x / 2 of the CPU's, now and when the ray is traced: drift.x |n|.
//
// The roundings of this sum are 10 E of it; `hit_error` has room for them, 60 of its 64 E being proven (shared/triangle).
//
// *Step.* In world space the plane has the normal m, the image of n, with the error of `PlacedNormal`. A step of x m changes n (K - a) by at least x (m m - error |m|), where
// the dot product errs by 3 E of itself; 8 E with the roundings of the step. The new origin is rounded by E of its coordinates, which is E |m| |p|; twice that is added.
//
// *Again.* The bounds depend on the origin, so the new one is tested by its own, and a step that was too short is followed by another. A step of s along n is
// at most 1.4 k s in object space, for the condition number k (1.4 is the greatest quotient of |m| times its largest component and m m), and raises the bounds by
// at most 1.4 k (64 + 7 + 36 + 30 k) E s, and in an instance that moves by 1.4 k (64 + 7 + 126 + 120 k) E s. For k up to 128 and 64 that is 0.09 s. The margin
// is 1/64, so each step leaves less than a tenth of what lacks, and eight are enough even where the point is 1e5 times as far from the plane as rays start.
// use shared/ray/module
// use ?traverse

/// Where a ray met a surface.
struct Surface {
    position: vec3<f32>,
    /// Largest distance of the position from the triangle, in each coordinate.
    error: f32,
    normal: vec3<f32>,
    is_front: bool,
}

/// Place of the best hit.
var<private> best_place: u32;

/// The ray traverses instances whose masks have one of these bits.
var<private> ray_mask: u32;

/// The mask of rays that traverse every instance, whose mask is not zero.
const EVERY: u32 = 0xffffffffu;

/// Loop iterations of a normal: of `scaled_direction`, with those in which its loops end.
const NORMAL_ITERATIONS: u32 = 7u;

/// Steps from a plane at most.
const MAX_STEPS: u32 = 8u;

/// Margin of a step, so that the bounds of the new origin, which are larger, are met.
const MARGIN: f32 = 1.0 + 1.0 / 64.0;

fn module_closest_hit(ray: Ray) -> ModuleHit {
    return closest_hit_masked(ray, EVERY);
}

fn module_occluded(ray: Ray) -> bool {
    return occluded_masked(ray, EVERY);
}

/// The closest hit of the instances whose masks have a bit of `mask`.
fn closest_hit_masked(ray: Ray, mask: u32) -> ModuleHit {
    ray_mask = mask;
    best_place = NONE;
    let hit = traverse(ray, false);
    return at_place(hit, best_place);
}

/// Whether a ray hits an instance whose mask has a bit of `mask`.
fn occluded_masked(ray: Ray, mask: u32) -> bool {
    ray_mask = mask;
    return traverse(ray, true).instance != NONE;
}

fn at_place(hit: Hit, place: u32) -> ModuleHit {
    return ModuleHit(hit.t, hit.u, hit.v, hit.primitive, hit.instance, place);
}

/// The unit normal on the front of a hit triangle, in world space.
fn normal_of(hit: ModuleHit) -> vec3<f32> {
    let normal = within_two(placed_normal(hit.instance, object_normal(hit.place)).normal);
    let square = dot(normal, normal);
    return select(vec3<f32>(0.0, 0.0, 1.0), normal * inverseSqrt(max(square, 1.0)), square > 0.0);
}

/// What a ray met.
fn surface_of(hit: ModuleHit, ray: Ray) -> Surface {
    let step = hit.t * ray.direction;
    let normal = normal_of(hit);
    let far_off = greatest(ray.origin);
    // The first header bounds the errors of all hits in world space. The product and the sum are two roundings.
    let error = (bvhs[0].row_y.w * far_off + bvhs[0].row_z.w) + 2.0 * ROUNDING * (far_off + greatest(step));
    return Surface(ray.origin + step, error, normal, dot(normal, within_two(ray.direction)) < 0.0);
}

/// The origin of a ray that leaves a hit of `ray` in this direction.
fn origin_beside(hit: ModuleHit, ray: Ray, direction: vec3<f32>) -> vec3<f32> {
    var position = ray.origin + hit.t * ray.direction;
    let normal = object_normal(hit.place);
    let placed = placed_normal(hit.instance, normal);
    let power = power_of(placed.normal);
    if power == 0u {
        return position;
    }
    let from_power = bitcast<f32>(0x7f000000u - power);
    let m = placed.normal * from_power;
    let per_step = (1.0 - 8.0 * ROUNDING) * dot(m, m) - dot(placed.error * from_power, abs(m));
    let vertex = vertex_at_place(hit.place, 0u);
    let bvh = bvhs[bvh_of(hit.instance)];
    // A traversal may ask whether a hit counts, and goes on with its own ray afterwards.
    let space_before = space;
    let shear_before = shear;
    let is_exact_before = is_exact;
    let world_ray_before = world_ray;
    for (var n_steps = 0u; n_steps <= MAX_STEPS; n_steps++) {
        iterations += 1u;
        enter_instance(Ray(position, 0.0, direction, FAR), hit.instance);
        let side = select(1.0, -1.0, dot(normal, space.direction) < 0.0);
        let distance = side * dot(normal, space.origin - vertex);
        let apart = distance_apart(bvh, normal, space.origin - vertex);
        // The point of the hit may be farther than necessary.
        if n_steps == MAX_STEPS || (n_steps > 0u && distance >= apart) {
            break;
        }
        let rounding = 2.0 * ROUNDING * dot(abs(m), abs(position)) + TINY;
        let lacking = MARGIN * (apart * from_power + rounding) - distance * from_power;
        position += (side * lacking / per_step) * m;
    }
    space = space_before;
    shear = shear_before;
    is_exact = is_exact_before;
    world_ray = world_ray_before;
    return position;
}

/// How far from a plane the ray of `space` must start, in units of the normal, not to meet what lies in the plane or behind it. The origin is at `away` from a point of
/// the plane.
fn distance_apart(bvh: Bvh, normal: vec3<f32>, away: vec3<f32>) -> f32 {
    let far_off = greatest(space.origin);
    let scale = far_off + bvh.row_x.w;
    let error = hit_error(bvh, far_off, scale);
    let sinking = (7.0 * ROUNDING + space.drift.y) * (scale + error);
    let size = abs(normal.x) + abs(normal.y) + abs(normal.z);
    return size * ((error + space.drift.x) + sinking) + 5.0 * ROUNDING * dot(abs(normal), abs(away));
}

/// The normal of a triangle in object space, its largest component in 1..2; zero where the vertices are on a line. Products of differences are exact but for
/// their 62nd bit, so that needles have normals, too.
fn object_normal(place: u32) -> vec3<f32> {
    iterations += NORMAL_ITERATIONS;
    let a = vertex_at_place(place, 0u);
    let u = exact_difference(vertex_at_place(place, 1u), a);
    let v = exact_difference(vertex_at_place(place, 2u), a);
    var normal: array<Number, 3>;
    normal[0] = added(multiplied(u[1], v[2]), negated(multiplied(u[2], v[1])));
    normal[1] = added(multiplied(u[2], v[0]), negated(multiplied(u[0], v[2])));
    normal[2] = added(multiplied(u[0], v[1]), negated(multiplied(u[1], v[0])));
    let scaled = scaled_direction(normal);
    return vec3<f32>(small_f32(scaled[0]), small_f32(scaled[1]), small_f32(scaled[2]));
}

fn exact_difference(a: vec3<f32>, b: vec3<f32>) -> array<Number, 3> {
    return array<Number, 3>(
        added(from_f32(a.x), negated(from_f32(b.x))),
        added(from_f32(a.y), negated(from_f32(b.y))),
        added(from_f32(a.z), negated(from_f32(b.z))),
    );
}

/// A number of 24 bits up to 2; zero below the normal numbers of f32.
fn small_f32(a: Number) -> f32 {
    // The highest bit of the mantissa is worth 2^(63 + exponent).
    let biased = a.exponent + (63 + 127);
    if a.high == 0u || biased <= 0 {
        return 0.0;
    }
    return bitcast<f32>((u32(a.is_negative) << 31u) | (u32(biased) << 23u) | ((a.high >> 8u) & 0x7fffffu));
}

/// Bits of the power of two at or below the largest component, whose reciprocal is a normal number; zero if there is none.
fn power_of(v: vec3<f32>) -> u32 {
    return min(bitcast<u32>(greatest(v)) & 0x7f800000u, 0x7e800000u);
}

/// `v` times the power of two with which its largest component is in 1..2.
fn within_two(v: vec3<f32>) -> vec3<f32> {
    return v * bitcast<f32>(0x7f000000u - power_of(v));
}

// part counted
// Which hits count, and the place of the best. `module.rs` adds `is_accepted`, which calls the function of the program.

fn accepts(hit: Hit) -> bool {
    if !is_accepted(at_place(hit, tested_place)) {
        return false;
    }
    // It is the best so far.
    best_place = tested_place;
    return true;
}

fn traverses(instance: u32) -> bool {
    return (mask_of(instance) & ray_mask) != 0u;
}
