// Camera rays: filter, lens, and ray cone.
//
// `?view` is the projection, `?lens` a pinhole or a thin lens, `?filter` the pixel filter.
//
// Positions are relative to the center of the picture, so they round by at most 2^-13 of a pixel in pictures up to 4096 pixels
// wide. Directions round by about 2^-22.
// use shared/picture
// use shared/ray
// use shared/cone
// use ?view
// use ?lens
// use ?filter

/// Sampler dimension of the position on the lens, separate from those that integrators count up.
const LENS: u32 = 0xfffffffeu;

struct CameraRay {
    ray: Ray,
    cone: Cone,
}

fn camera_ray(one: PixelSample) -> CameraRay {
    let offset = filtered(square(one, PIXEL_POSITION));
    let position = (vec2<f32>(one.at) + 0.5 - 0.5 * vec2<f32>(picture.size)) + offset;
    let line = through_lens(line_of(position), one);
    return CameraRay(line, pixel_cone(position, one.sample));
}

/// A ray with infinite `t_max`.
fn infinite_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    return Ray(origin, 0.0, direction, FAR);
}

// choice view/perspective
// Perspective projection.

/// The ray through a position in pixels relative to the center of the picture.
fn line_of(position: vec2<f32>) -> Ray {
    let direction = picture.forward + (position.x * picture.right + position.y * picture.down);
    // At least as long as the unit vector forward, to which the other two are perpendicular.
    return infinite_ray(picture.eye, normalize(direction));
}

/// A vector from a point to the eye.
fn towards_eye(point: vec3<f32>) -> vec3<f32> {
    return picture.eye - point;
}

/// The cone of a pixel: its spread is the root of the pixel's solid angle.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    let offset = position * picture.pixel;
    // The image plane is at distance 1: the solid angle falls with the squared distance and the cosine.
    let cosine = inverseSqrt(1.0 + dot(offset, offset));
    return cone_of_pixel(0.0, picture.pixel * cosine * sqrt(cosine), sample);
}

// choice view/orthographic
// Orthographic projection.

/// The ray through a position in pixels relative to the center of the picture.
fn line_of(position: vec2<f32>) -> Ray {
    return infinite_ray(picture.eye + (position.x * picture.right + position.y * picture.down), picture.forward);
}

/// A vector from a point towards the eye, which is infinitely far away.
fn towards_eye(point: vec3<f32>) -> vec3<f32> {
    return -picture.forward;
}

/// The cone of a pixel.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    return cone_of_pixel(picture.pixel, 0.0, sample);
}

// choice lens/disk
// A thin lens: rays through one pixel position converge in the focal plane.
// use shared/sampling

fn through_lens(line: Ray, one: PixelSample) -> Ray {
    let point = picture.lens_radius * uniform_disk(square(one, LENS));
    // The two pixel steps are perpendicular and equally long.
    let shift = (point.x / picture.pixel) * picture.right + (point.y / picture.pixel) * picture.down;
    // The direction is a unit vector; its progress along the view axis is its cosine.
    let delta = line.direction * (picture.focus_distance / dot(line.direction, picture.forward));
    return infinite_ray(line.origin + shift, normalize(delta - shift));
}

// choice lens/pinhole
// A pinhole.

fn through_lens(line: Ray, one: PixelSample) -> Ray {
    return line;
}

// choice filter/box
// Box filter.

/// Offset of a sample from the pixel center in pixels, from a point of the unit square.
fn filtered(square: vec2<f32>) -> vec2<f32> {
    return picture.filter_radius * (2.0 * square - 1.0);
}

/// Weight of that sample.
fn filter_weight(square: vec2<f32>) -> f32 {
    return 1.0;
}

// choice filter/table
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

// part first/triangle
// The plane of a triangle that a rasterizer saw.
// use shared/surface

/// Intersection of a ray with the plane of a triangle that covers the pixel, clamped to the triangle.
fn in_triangle(ray: Ray, instance: u32, primitive: u32) -> Hit {
    let corners = triangles[triangle_of(Hit(0.0, 0.0, 0.0, primitive, instance))].vertices;
    let sides = edges(corners);
    let first = vector_world(instance, sides[0]);
    let second = vector_world(instance, sides[1]);
    // From the first vertex to the origin of the ray.
    let away = ray.origin - point_world(instance, position_of(corners.x));
    let across = cross(ray.direction, second);
    let along = cross(away, first);
    // Signed double area, projected along the ray.
    let area = dot(first, across);
    let inverse = sign_of(area) / max(abs(area), 1e-30);
    let u = clamp(dot(away, across) * inverse, 0.0, 1.0);
    let v = clamp(dot(ray.direction, along) * inverse, 0.0, 1.0 - u);
    return Hit(max(dot(second, along) * inverse, 0.0), u, v, primitive, instance);
}

// choice first/trace
// Camera rays start without knowledge of what they hit.
// use shared/ray

/// How far a camera ray is traced at first.
fn first_reach(ray: Ray, pixel: u32) -> f32 {
    return ray.t_max;
}

// choice first/raster
// Camera rays start with the triangle that a raster pass saw at the center of their pixel: boxes behind it need no visit.
//
// The triangle is a guess, as samples lie beside the center, alpha tests may reject it, and instances may move. A ray that hits
// nothing before it is traced again to its end, so every hit is that of a ray that was traced at once.
// use shared/camera/first/triangle

/// Instance and primitive at the center of each pixel, row by row; no instance for the background.
@group(1) @binding(12) var<storage, read> first_seen: array<vec2<u32>>;

/// Part of the distance to the guess by which a ray goes beyond it: the samples of a pixel differ in it.
const FIRST_SLACK: f32 = 0.0625;

/// How far a camera ray is traced at first.
fn first_reach(ray: Ray, pixel: u32) -> f32 {
    let seen = first_seen[pixel];
    if seen.x == NONE {
        return ray.t_max;
    }
    let t = in_triangle(ray, seen.x, seen.y).t;
    return select(ray.t_max, min(t + FIRST_SLACK * t, ray.t_max), t > ray.t_min);
}

// part film
// What is kept of samples: the host downloads it, or `render/sum` sums it.
// use shared/picture
// use shared/invocation/incomplete

/// Linear RGB radiance of each sample, and the number of rays traced, -1 if one was incomplete. 64 pixels per work-group, row
/// by row.
@group(1) @binding(4) var<storage, read_write> samples: array<vec4<f32>>;

/// Whether a sample is dropped because its radiance is not finite. By integers: compilers may assume that a float is finite.
fn is_dropped(radiance: vec3<f32>) -> bool {
    return any((bitcast<vec3<u32>>(radiance) & vec3(0x7f800000u)) == vec3(0x7f800000u));
}

fn keep(group: u32, local: u32, one: PixelSample, radiance: vec3<f32>, n_rays: u32) {
    if one.is_inside {
        samples[64u * group + local] = vec4(radiance, select(f32(n_rays), -1.0, is_incomplete));
    }
}

// part first_light
// What the first surface reflects of the listed lights and of the environment, as if nothing occluded them, and what arrives of both.

// choice first_light/none
// It is not kept.

const KEEPS_FIRST_LIGHT: bool = false;

fn start_first_light(index: u32) {}

fn resume_first_light(index: u32) {}

fn add_diffuse(vertex: u32, light: vec3<f32>) {}

fn add_arriving(vertex: u32, light: vec3<f32>) {}

fn keep_ambient(unoccluded: vec3<f32>, arriving: vec3<f32>) {}

fn clear_first_light() {}

// choice first_light/four
// It is kept sample by sample, as `samples` are, and added up there: no register waits for more of it.

const KEEPS_FIRST_LIGHT: bool = true;

/// Numbers of a part of a sample: linear RGB.
alias Light = array<f32, 3>;

/// Of each sample: listed lights as if nothing occluded them, what arrives of them, the environment as if nothing occluded it, and what arrives of it.
/// 64 pixels per work-group, row by row.
@group(1) @binding(13) var<storage, read_write> first_light: array<array<Light, 4>>;

/// The place of the sample.
var<private> first_light_at: u32;

fn start_first_light(index: u32) {
    first_light_at = index;
    clear_first_light();
}

/// Continues with the light that is kept of a sample.
fn resume_first_light(index: u32) {
    first_light_at = index;
}

/// Adds light of a listed light at a vertex, of which the first counts.
fn add_diffuse(vertex: u32, light: vec3<f32>) {
    add_first_light(0u, vertex, light);
}

/// Adds what arrives of it.
fn add_arriving(vertex: u32, light: vec3<f32>) {
    add_first_light(1u, vertex, light);
}

fn add_first_light(part: u32, vertex: u32, light: vec3<f32>) {
    if vertex == 0u && any(light != vec3(0.0)) {
        first_light[first_light_at][part][0] += light.x;
        first_light[first_light_at][part][1] += light.y;
        first_light[first_light_at][part][2] += light.z;
    }
}

/// Keeps light of the environment, and what arrives of it.
fn keep_ambient(unoccluded: vec3<f32>, arriving: vec3<f32>) {
    first_light[first_light_at][2] = Light(unoccluded.x, unoccluded.y, unoccluded.z);
    first_light[first_light_at][3] = Light(arriving.x, arriving.y, arriving.z);
}

/// Makes it zero, for a sample that begins or is dropped.
fn clear_first_light() {
    first_light[first_light_at] = array<Light, 4>();
}

// part components
// The light of a sample by how many surfaces scattered it on its way to the camera: none, one, or more.

// choice components/none
// It is not kept.

fn start_components(index: u32) {}

fn resume_components(index: u32) {}

fn add_component(n_scattered: u32, light: vec3<f32>) {}

fn clear_components() {}

// choice components/three
// It is kept sample by sample, as `samples` are, and added up there: no register waits for more of it.

/// Linear RGB of a sample, of each part. 64 pixels per work-group, row by row.
@group(1) @binding(5) var<storage, read_write> components: array<array<array<f32, 3>, 3>>;

/// The place of the sample.
var<private> components_at: u32;

fn start_components(index: u32) {
    components_at = index;
    clear_components();
}

/// Continues with the components that are kept of a sample.
fn resume_components(index: u32) {
    components_at = index;
}

/// Adds light that this many surfaces scattered, mirrors and glass included.
fn add_component(n_scattered: u32, light: vec3<f32>) {
    if any(light != vec3(0.0)) {
        let part = min(n_scattered, 2u);
        components[components_at][part][0] += light.x;
        components[components_at][part][1] += light.y;
        components[components_at][part][2] += light.z;
    }
}

/// Makes them zero, for a sample that begins or is dropped.
fn clear_components() {
    components[components_at] = array<array<f32, 3>, 3>();
}
