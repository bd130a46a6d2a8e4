// What kernels of all kinds share. Parts keep their names: `shared/angle` and so on.

// part numbers
// Constants, and arithmetic that never produces infinity or NaN.

const PI: f32 = 3.14159265;
const TAU: f32 = 6.28318531;

/// Upper bound of quotients: two of them and a color can be multiplied without overflow.
const MAX_QUOTIENT: f32 = 1e18;

/// Upper bound of radiance: even 1e8 times as much is finite.
const MAX_RADIANCE: f32 = 1e28;

/// Smaller squared lengths may have been flushed to zero; vectors that short have no direction.
const MIN_SQUARE: f32 = 1e-36;

/// `a / b` of nonnegative numbers, at most `MAX_QUOTIENT`.
fn quotient(a: f32, b: f32) -> f32 {
    // Larger divisors are not flushed to zero.
    let divisor = max(b, 1e-37);
    return min(a, MAX_QUOTIENT * min(divisor, 1.0)) / divisor;
}

/// A nonnegative color, clamped so that products do not overflow.
fn bounded(color: vec3<f32>) -> vec3<f32> {
    return min(color, vec3(MAX_RADIANCE));
}

/// 1 or -1, by the sign bit: -0 is negative.
fn sign_of(x: f32) -> f32 {
    return select(1.0, -1.0, (bitcast<u32>(x) >> 31u) != 0u);
}

// part vector
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

// part angle
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

// part sampling
// Directions over the hemisphere around a unit normal, with densities; twin of crates/renderer/src/sampling.rs.
// use shared/numbers
// use shared/angle

/// A right-handed orthonormal frame whose third column is a unit normal (Duff et al. 2017).
///
/// Matrix times vector maps local to world coordinates, vector times matrix maps world to local.
fn basis_about(normal: vec3<f32>) -> mat3x3<f32> {
    let sign = sign_of(normal.z);
    // The divisor is at least 1 in absolute value for either sign.
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let first = vec3(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    let second = vec3(b, sign + normal.y * normal.y * a, -normal.y);
    return mat3x3(first, second, normal);
}

/// A direction around +z with density `cos/pi`, from a point of the unit square; never exactly at the horizon.
fn cosine_hemisphere(square: vec2<f32>) -> vec3<f32> {
    let turned = circle(square.y);
    return vec3(sqrt(square.x) * turned, sqrt(1.0 - square.x));
}

/// Density of `cosine_hemisphere` for a cosine.
fn cosine_density(cosine: f32) -> f32 {
    return max(cosine, 0.0) / PI;
}

/// A uniform point of the unit disk from a point of the unit square (Shirley and Chiu 1997).
fn uniform_disk(square: vec2<f32>) -> vec2<f32> {
    let p = 2.0 * square - 1.0;
    if p.x == 0.0 && p.y == 0.0 {
        return vec2(0.0);
    }
    // An eighth of a turn to each side of an axis.
    if abs(p.x) > abs(p.y) {
        return p.x * circle(0.125 * (p.y / p.x));
    }
    return p.y * circle(0.25 - 0.125 * (p.x / p.y));
}

// choice hemisphere/cosine
// Diffuse directions in proportion to the cosine to the normal.
// use shared/sampling

/// A direction around +z, from a point of the unit square.
fn hemisphere_direction(square: vec2<f32>) -> vec3<f32> {
    return cosine_hemisphere(square);
}

/// Density of `hemisphere_direction` for a cosine.
fn hemisphere_density(cosine: f32) -> f32 {
    return cosine_density(cosine);
}

/// Lambert's density over `hemisphere_density`.
fn hemisphere_weight(cosine: f32) -> f32 {
    return 1.0;
}

// choice hemisphere/uniform
// Diffuse directions uniformly over the hemisphere.
// use shared/numbers
// use shared/angle

/// A direction around +z, from a point of the unit square; never exactly at the horizon.
fn hemisphere_direction(square: vec2<f32>) -> vec3<f32> {
    // 1 - z^2 without cancellation.
    return vec3(sqrt(square.x * (2.0 - square.x)) * circle(square.y), 1.0 - square.x);
}

/// Density of `hemisphere_direction` for a cosine.
fn hemisphere_density(cosine: f32) -> f32 {
    return select(0.0, 0.5 / PI, cosine > 0.0);
}

/// Lambert's density over `hemisphere_density`.
fn hemisphere_weight(cosine: f32) -> f32 {
    return 2.0 * cosine;
}

// part hash
// 32-bit hashes and numbers of the unit interval.

/// A bijection in which every input bit flips about half of the output bits: two rounds of xor-shift and odd multiplication
/// with constants found by Wellons (2018).
fn mix_bits(bits: u32) -> u32 {
    var x = bits + 0x9e3779b9u;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

/// `steps` times 2^-24, for fewer than 2^24 steps.
fn unit_interval(steps: u32) -> f32 {
    return f32(steps) * 0x1p-24f;
}

// part hash/ray_key
// A key per ray and the sample of the pixel, for stochastic alpha.

var<private> ray_key: u32;
var<private> ray_sample: u32;

/// Sampler dimension of ray keys, separate from those that are counted up.
const ALPHA_DIMENSION: u32 = 0xfffffffdu;

/// The key of ray `number` derived from `key`. Derived keys form a tree.
fn derived_key(key: u32, number: u32) -> u32 {
    return mix_bits(key ^ number);
}

// part invocation/index
// One axis of a dispatch allows only 65,535 work-groups, so work-groups lie in rows.

/// Builtins of an entry point.
struct Invocation {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
}

/// Index of a work-group in a dispatch.
fn group_index(id: Invocation) -> u32 {
    return id.group.y * id.groups.x + id.group.x;
}

/// Index of an invocation in a dispatch whose work-groups have `size` invocations.
fn invocation(id: Invocation, size: u32) -> u32 {
    return group_index(id) * size + id.local;
}

// part invocation/iterations
// Loop iterations of this invocation so far. Some drivers end long loops early, so traversal counts and stops before.

var<private> iterations: u32;

// part invocation/incomplete
// Whether a traversal of this invocation stopped after `MAX_ITERATIONS`. The result may then not be the closest hit, or may miss.

var<private> is_incomplete: bool;

// part ray
// Rays and hits in the layout of the host.

/// No primitive, no instance; the instance of a miss.
const NONE: u32 = 0xffffffffu;

/// Instance of a ray whose traversal ended early: the result is unknown.
const INCOMPLETE: u32 = 0xfffffffeu;

/// Stands for infinity.
const FAR: f32 = 3e38;

/// `origin + t * direction` for `t_min <= t <= t_max`. All numbers are finite, the direction is not zero, `0 <= t_min` and
/// `t_max <= FAR`.
struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
}

/// Hit of a triangle: weights `u` and `v` of the second and third vertex, `t` in units of the ray's direction.
struct Hit {
    t: f32,
    u: f32,
    v: f32,
    primitive: u32,
    instance: u32,
}

/// No hit.
fn miss() -> Hit {
    return Hit(FAR, 0.0, 0.0, NONE, NONE);
}

/// Whether `a` precedes `b`: smallest `t`, then lowest instance, then lowest primitive.
fn before(a: Hit, b: Hit) -> bool {
    if a.t != b.t {
        return a.t < b.t;
    }
    if a.instance != b.instance {
        return a.instance < b.instance;
    }
    return a.primitive < b.primitive;
}

// part ray/module
// Rays and hits of a program's kernel.

/// A hit that tells where its triangle lies.
struct ModuleHit {
    t: f32,
    u: f32,
    v: f32,
    primitive: u32,
    instance: u32,
    place: u32,
}

/// A ray from its origin on.
fn module_ray(origin: vec3<f32>, direction: vec3<f32>, t_max: f32) -> Ray {
    return Ray(origin, 0.0, direction, t_max);
}

// part time/ray_time
// Time of the rays of an invocation: 0 at shutter opening, below 1 until it closes, a multiple of 2^-24.

var<private> ray_time: f32;

// choice time/still
// No motion.
// use shared/picture

fn choose_time(one: PixelSample) {}

// choice time/shutter
// Samples are distributed over the shutter interval.
// use shared/picture
// use shared/time/ray_time

/// Sampler dimension of the time, separate from those that integrators count up.
const TIME: u32 = 0xffffffffu;

fn choose_time(one: PixelSample) {
    ray_time = single(picture.sampler, one.pixel, one.sample, TIME);
}

// part motion
// Moving instances at the time of the ray.
//
// Each entry of a transform is linear in time between shutter opening and closing, so cofactors are polynomials of degree two
// and the determinant is one of degree three. They are given by their Bernstein coefficients, computed in f64. The weights are
// not negative, and the host rejects motions whose determinant has coefficients of both signs, so the sums do not cancel.
//
// # Error of cofactors, determinant and position
// With E = 2^-23: the time is a multiple of 2^-24 in 0..1, so one minus it is exact. A weight of degree two errs by E, one of
// degree three by 3 E. A cofactor errs by E / 2 for its coefficients, E for weights, E for products and 2 E for sums: 4.5 E of
// the sum of absolute terms. Likewise the determinant errs by (0.5 + 3 + 1 + 3) E = 7.5 E, and a position by 2 E of its terms.
// use shared/time/ray_time

struct Motion {
    /// For each axis the coefficients of its cofactors at opening, between, and at closing, divided by a common factor. They
    /// are rows of the inverse times the determinant.
    cofactors: array<mat3x3<f32>, 3>,
    /// Coefficients of the determinant, divided by the same factor: all positive, the largest is 1.
    determinant: vec4<f32>,
    /// Columns of the transform at closing.
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    shift: vec3<f32>,
}

@group(0) @binding(5) var<storage, read> motions: array<Motion>;

/// Bernstein weights of degree two.
fn weights_of_time() -> vec3<f32> {
    let rest = 1.0 - ray_time;
    return vec3(rest * rest, 2.0 * ray_time * rest, ray_time * ray_time);
}

fn determinant_of(motion: u32) -> f32 {
    let rest = 1.0 - ray_time;
    let weights = vec4(rest * rest * rest, 3.0 * ray_time * (rest * rest), 3.0 * (ray_time * ray_time) * rest,
        ray_time * ray_time * ray_time);
    return dot(weights, motions[motion].determinant);
}

/// A column at the time of the ray.
fn between(open: vec3<f32>, close: vec3<f32>) -> vec3<f32> {
    return (1.0 - ray_time) * open + ray_time * close;
}

// part cone
// Ray cones, whose width selects the texture level.
// use shared/numbers

struct Cone {
    /// Diameter at the origin of the ray, in world units.
    width: f32,
    /// Growth of the diameter with distance.
    spread: f32,
    /// Fraction of a pixel, or of a scattering lobe, that the sample represents, as a ratio of lengths.
    scale: f32,
    /// Whether only mirrors lie between the ray and the camera.
    is_direct: bool,
}

/// The cone of the pixel sample with this index; `width` and `spread` are those of the pixel.
fn cone_of_pixel(width: f32, spread: f32, sample: u32) -> Cone {
    let scale = inverseSqrt(f32(sample) + 1.0);
    return Cone(width * scale, spread * scale, scale, true);
}

/// The cone after `distance` world units.
fn grown(cone: Cone, distance: f32) -> Cone {
    return Cone(cone.width + cone.spread * distance, cone.spread, cone.scale, cone.is_direct);
}

/// The cone of a scattered direction sampled with this density per steradian.
fn scattered(cone: Cone, density: f32) -> Cone {
    // At most the projected hemisphere, as for a diffuse surface.
    let solid_angle = 1.0 / max(density, 1.0 / PI);
    let spread = sqrt(cone.spread * cone.spread + solid_angle * cone.scale * cone.scale);
    return Cone(cone.width, spread, cone.scale, false);
}

// choice count/none
// No counters.

fn count_boxes(n: u32) {}

fn count_triangles(n: u32) {}

fn n_tested() -> vec2<u32> {
    return vec2(0u);
}

// choice count/tests
// Counters of box and triangle tests.

/// Boxes, then triangles, for all rays of this invocation.
var<private> tested: vec2<u32>;

fn count_boxes(n: u32) {
    tested.x += n;
}

fn count_triangles(n: u32) {
    tested.y += n;
}

fn n_tested() -> vec2<u32> {
    return tested;
}

// part facing
// Which faces the ray of an invocation passes; only scenes with single-sided materials read it.

/// What the camera sees, by mirrors and clear glass, too.
const SEEN: u32 = 0u;
/// What a surface scatters.
const SCATTERED: u32 = 1u;
/// Whether light arrives.
const ARRIVING: u32 = 2u;

/// Direction of the ray.
var<private> facing_direction: vec3<f32>;

/// What the ray is for.
var<private> facing_rays: u32;

fn face_along(direction: vec3<f32>, rays: u32) {
    facing_direction = direction;
    facing_rays = rays;
}

// part facing/scattered
// A ray that a surface scattered ends at the first face it hits, but light from beyond may pass that face, if it is hidden. So the ray is traced again, as one along
// which light arrives: if it leaves the scene then, it did not hit the face.
// use shared/facing
// use shared/invocation/incomplete
// use shared/ray
// use ?mask

fn face_ray(direction: vec3<f32>, is_scattered: bool, is_arriving: bool) {
    face_along(direction, select(select(SEEN, SCATTERED, is_scattered), ARRIVING, is_arriving));
}

/// Whether a ray is traced again after a hit. `hidden` is a miss before the first time, then the hidden face; after the second time it is a miss again, and the
/// hit is where the ray ends.
fn is_traced_again(hit: ptr<function, Hit>, hidden: ptr<function, Hit>, is_scattered: bool) -> bool {
    if (*hidden).instance != NONE {
        if (*hit).instance != NONE {
            *hit = *hidden;
        }
        *hidden = miss();
        return false;
    }
    if is_scattered && (*hit).instance != NONE && is_hidden(*hit) && !is_incomplete {
        *hidden = *hit;
        return true;
    }
    return false;
}

// choice mask/none
// All hits count.
// use shared/mask_no_faces
// use shared/mask_no_instances

fn accepts(hit: Hit) -> bool {
    return true;
}

// choice mask/alpha
// Hits count by alpha.
// use shared/mask_alpha
// use shared/mask_no_faces
// use shared/mask_no_instances

fn accepts(hit: Hit) -> bool {
    return is_present(hit);
}

// choice mask/faces
// Hits count by the side of their face.
// use shared/mask_faces
// use shared/mask_no_instances

fn accepts(hit: Hit) -> bool {
    return !is_passed(hit);
}

// choice mask/both
// Hits count by the side of their face and by alpha.
// use shared/mask_alpha
// use shared/mask_faces
// use shared/mask_no_instances

fn accepts(hit: Hit) -> bool {
    return !is_passed(hit) && is_present(hit);
}

// part mask_no_instances
// Rays traverse all instances.

fn traverses(instance: u32) -> bool {
    return true;
}

// part mask_no_faces
// All faces are hit from both sides.

fn is_hidden(hit: Hit) -> bool {
    return false;
}

// part mask_faces
// Faces of single-sided materials; twin of crates/renderer/src/hit_filter.rs, which says what rays pass and why.
// use shared/camera
// use shared/facing
// use shared/surface

/// Whether light passes the face at a hit of the ray: it is hit from the front, and the eye is behind it.
fn is_hidden(hit: Hit) -> bool {
    let face = face_at(hit);
    return dot(face.normal, facing_direction) < 0.0 && dot(face.normal, towards_eye(point_world(hit.instance, face.position))) < 0.0;
}

fn is_passed(hit: Hit) -> bool {
    if facing_rays == SEEN {
        return dot(face_at(hit).normal, facing_direction) > 0.0;
    }
    return facing_rays == ARRIVING && is_hidden(hit);
}

/// A point of the face at a hit, object space, and the unit normal on its front, world space; zero where its material is not single-sided.
fn face_at(hit: Hit) -> SmoothSurface {
    let triangle = triangles[triangle_of(hit)];
    if materials[triangle.material & 0x7fffffffu].single_sided == 0u {
        return SmoothSurface(vec3(0.0), vec3(0.0));
    }
    let face = object_face_at(hit, triangle);
    let winding = normal_world(hit.instance, face.normal);
    let is_mirrored = ((triangle.material >> 31u) == 1u) != mirrors(hit.instance);
    return SmoothSurface(face.position, select(winding, -winding, is_mirrored));
}

// part mask_alpha
// Alpha test: a hit counts with the probability given by alpha.
// use shared/hash
// use ?alpha
// use shared/hash/ray_key
// use shared/sampler/net

fn is_present(hit: Hit) -> bool {
    let triangle = triangles[triangle_of(hit)];
    let material = triangle.material & 0x7fffffffu;
    if materials[material].cutoff < 0.0 {
        return true;
    }
    prepare_alpha(hit, triangle);
    let opacity = presence(material, triangle.vertices, vec3(1.0 - hit.u - hit.v, hit.u, hit.v));
    // Independent of traversal order: depends only on key, sample, instance and triangle.
    let seed = mix_bits(mix_bits(ray_key ^ hit.instance) ^ hit.primitive);
    return unit_interval(net_single(ray_sample, seed) >> 8u) < opacity;
}

// part picture
// Parameters of a picture, and the samples that a dispatch takes.
// use shared/sampler

struct Picture {
    eye: vec3<f32>,
    /// Side of a pixel, on the plane at distance 1 for a perspective camera.
    pixel: f32,
    /// Unit vector along the view axis.
    forward: vec3<f32>,
    /// 0 for a pinhole.
    lens_radius: f32,
    /// Step of one pixel to the right, on that plane.
    right: vec3<f32>,
    focus_distance: f32,
    /// Step of one pixel down, on that plane.
    down: vec3<f32>,
    /// Radius of the filter in pixels.
    filter_radius: f32,
    /// Columns and rows of pixels.
    size: vec2<u32>,
    bounces: u32,
    /// Reciprocal of the ambient occlusion radius; 0 for an infinite radius.
    inverse_ao_radius: f32,
    sampler: Sampler,
    /// Mean radiance of the environment.
    ambient: vec3<f32>,
    /// Error along each axis between the plane of a triangle and a ray that leaves it, for a single-level scene.
    slack: f32,
    /// What camera rays see in place of the environment, if `has_background` is not 0.
    background: vec3<f32>,
    has_background: u32,
    /// Greatest radiance of light that several surfaces scattered.
    limit: f32,
    /// Instance of the ground that was added to a scene; `NONE` without one.
    ground: u32,
}

/// Work-groups of a dispatch. Each takes one sample of each of the 64 pixels of a cell.
struct Slice {
    /// Index of the first work-group among those of all cells and samples.
    first_group: u32,
    /// One past the last.
    end_group: u32,
    first_sample: u32,
    /// Samples per pixel, and work-groups per cell.
    n_samples: u32,
    /// Index of the first of `cells` among those whose samples are summed together.
    first_cell: u32,
}

@group(1) @binding(0) var<uniform> picture: Picture;
@group(1) @binding(1) var<uniform> slice: Slice;
/// Position of each cell: column in the lower 16 bits, row in the upper.
@group(1) @binding(2) var<storage, read> cells: array<u32>;

/// One sample of a pixel.
struct PixelSample {
    /// Column and row of the pixel.
    at: vec2<u32>,
    /// Index of the pixel.
    pixel: u32,
    sample: u32,
    /// False outside the picture or the dispatch.
    is_inside: bool,
}

/// The sample of an invocation. A cell takes one sample of all its pixels after the other.
fn taken(group: u32, local: u32) -> PixelSample {
    let number = slice.first_group + group;
    if number >= slice.end_group {
        return PixelSample(vec2(0u), 0u, 0u, false);
    }
    let cell = cells[number / slice.n_samples];
    let at = 8u * vec2(cell & 0xffffu, cell >> 16u) + vec2(local % 8u, local / 8u);
    let is_inside = at.x < picture.size.x && at.y < picture.size.y;
    return PixelSample(at, at.y * picture.size.x + at.x, slice.first_sample + number % slice.n_samples, is_inside);
}

/// Light after so many surfaces scattered it, within the limit of the picture. Mirrors and clear glass in front of the first surface do
/// not count.
fn limited(light: vec3<f32>, n_scattered: u32) -> vec3<f32> {
    let greatest = max(light.x, max(light.y, light.z));
    if n_scattered < 2u || greatest <= picture.limit {
        return light;
    }
    return light * (picture.limit / greatest);
}

/// Sampler dimension of the position in the pixel.
const PIXEL_POSITION: u32 = 0u;

/// The point of the unit square of a sample for `dimension`.
fn square(one: PixelSample, dimension: u32) -> vec2<f32> {
    return pair(picture.sampler, one.pixel, one.sample, dimension);
}

// part fiber
// The hair at a hit.

struct Fiber {
    /// Absorption per radius.
    absorption: vec3<f32>,
    /// Roughness along the hair and around it, 0..=1.
    roughness: f32,
    roughness_around: f32,
    /// Angle of the scales.
    tilt_rad: f32,
    ior: f32,
    /// Whether the surface is one.
    is_on: bool,
}

var<private> fiber: Fiber;
