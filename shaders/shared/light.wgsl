// Lights other than triangles and the environment.

// part direct
// Shadow rays to the listed lights.

/// A shadow ray and its contribution.
struct ShadowRay {
    /// Whether there is such a ray.
    exists: bool,
    /// Reflected radiance if the ray is unoccluded.
    radiance: vec3<f32>,
    ray: Ray,
    /// Number of lights visited so far.
    n_visited: u32,
    /// Reflected radiance from lights too close for an occluder in between.
    unshadowed: vec3<f32>,
    /// Reflected radiance from lights that shape lights occlude, as if they did not.
    hidden: vec3<f32>,
}

const NO_RAY: Ray = Ray(vec3<f32>(), 0.0, vec3<f32>(), 0.0);
const NO_SHADOW_RAY: ShadowRay = ShadowRay(false, vec3<f32>(), NO_RAY, 0u, vec3<f32>(), vec3<f32>());

// choice direct/list
// One shadow ray for each listed light. A Lambertian surface of reflectance r reflects r/pi of its irradiance in every
// direction.
// use shared/light/list/lights
// use shared/light/list
// use shared/invocation/iterations

/// First sampler dimension of lights, beyond all bounces; one for each vertex and light.
const FIRST_LIGHT: u32 = 65536u;

fn n_listed_lights() -> u32 {
    return arrayLength(&lights);
}

/// The shadow ray to the next light after the first `n_visited` that may reach the surface on the viewer's side, above the
/// horizons of both the surface and the shading normal.
fn next_shadow_ray(one: PixelSample, vertex: u32, surface: Surface, n_visited: u32) -> ShadowRay {
    let n_lights = n_listed_lights();
    var shadow = NO_SHADOW_RAY;
    shadow.n_visited = n_visited;
    for (var number = n_visited; number < n_lights && !shadow.exists; number++) {
        iterations += 1u;
        shadow.n_visited = number + 1u;
        let dimension = FIRST_LIGHT + vertex * n_lights + number;
        let incoming = incoming_light(lights[number], surface.position, square(one, dimension));
        let cosine = dot(surface.shading_normal, incoming.to_light);
        if incoming.shadow_ray == NO_LIGHT || cosine <= 0.0 || dot(surface.smooth_surface.normal, incoming.to_light) <= 0.0 {
            continue;
        }
        let reflected = surface.base_color * (incoming.radiance * (cosine / PI));
        let is_near = incoming.shadow_ray == FINITE;
        let ray = towards(surface, select(incoming.to_light, incoming.position, is_near), is_near);
        if ray.t_max <= 0.0 {
            shadow.unshadowed += reflected;
        } else if shape_light_occludes(ray, number) {
            shadow.hidden += reflected;
        } else {
            shadow.exists = true;
            shadow.radiance = reflected;
            shadow.ray = ray;
        }
    }
    return shadow;
}

// choice direct/none
// No listed lights.

fn n_listed_lights() -> u32 {
    return 0u;
}

fn next_shadow_ray(one: PixelSample, vertex: u32, surface: Surface, n_visited: u32) -> ShadowRay {
    return NO_SHADOW_RAY;
}

// part point
// Point lights; twin of crates/renderer/src/light/point.rs.
// use shared/numbers
// use shared/light/list

fn incoming_from_point(light: ListLight, at: vec3<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance_squared = dot(delta, delta);
    if distance_squared < MIN_SQUARE {
        return no_incoming_light();
    }
    return incoming_along(light, delta / sqrt(distance_squared), distance_squared, 1.0);
}

/// Light from the position of a light along a unit vector, with a factor of its intensity.
fn incoming_along(light: ListLight, to_light: vec3<f32>, distance_squared: f32, falloff: f32) -> IncomingLight {
    let factor = quotient(falloff, distance_squared);
    if factor <= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(to_light, 0.0, bounded(light.color * factor), FINITE, light.position);
}

// part spot
// Spot lights; twin of crates/renderer/src/light/spot.rs.
// use shared/numbers
// use shared/light/list
// use shared/light/point

fn incoming_from_spot(light: ListLight, at: vec3<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance_squared = dot(delta, delta);
    if distance_squared < MIN_SQUARE {
        return no_incoming_light();
    }
    let to_light = delta / sqrt(distance_squared);
    let falloff = spot_falloff(-dot(light.direction, to_light), light.extent, light.cos_outer);
    return incoming_along(light, to_light, distance_squared, falloff);
}

/// Falloff of a spot light at a cosine to its axis.
fn spot_falloff(cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cosine >= cos_inner {
        return 1.0;
    }
    if cosine <= cos_outer {
        return 0.0;
    }
    let linear = (cosine - cos_outer) / (cos_inner - cos_outer);
    return linear * linear;
}

// part sun
// Directional lights; twin of crates/renderer/src/light/sun.rs.
// use shared/light/list

fn incoming_from_sun(light: ListLight) -> IncomingLight {
    return IncomingLight(-light.direction, 0.0, bounded(light.color), INFINITE, vec3(0.0));
}

// choice sun/suns/none
// No suns.
// use shared/light/sampler

fn sample_sun(choice: f32) -> LightSample {
    return no_light();
}

// choice sun/suns/list
// Suns, chosen with probabilities that are the same for all points.
// use shared/light/list/lights
// use shared/light/sampler
// use shared/invocation/iterations

/// A sun and the probability with which it is chosen.
struct SampledSun {
    /// Index in the list of lights.
    light: u32,
    probability: f32,
}

@group(3) @binding(9) var<storage, read> sampled_suns: array<SampledSun>;

/// Samples the sun whose interval contains a number; the last one also covers the rounding error.
fn sample_sun(choice: f32) -> LightSample {
    let last = arrayLength(&sampled_suns) - 1u;
    var number = 0u;
    var rest = choice;
    loop {
        iterations += 1u;
        if number >= last || rest < sampled_suns[number].probability {
            break;
        }
        rest -= sampled_suns[number].probability;
        number++;
    }
    let sun = sampled_suns[number];
    let incoming = incoming_light(lights[sun.light], vec3(0.0), vec2(0.0));
    return chosen_with(sun.probability, LightSample(incoming, sun.light, false));
}

// part disk
// Disk lights, and densities of planar shapes; twin of crates/renderer/src/light/disk.rs.
// use shared/numbers
// use shared/angle
// use shared/sampling
// use shared/light/list

/// Samples a disk uniformly by area; its back does not emit.
fn incoming_from_disk(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let point = light.position + basis_about(light.direction) * vec3(light.extent * uniform_disk(square), 0.0);
    let delta = point - at;
    let density = area_density(delta, light.direction, PI * light.extent * light.extent);
    if density <= 0.0 || dot(delta, light.direction) >= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(normalize(delta), density, bounded(light.color * quotient(1.0, density)), FINITE, point);
}

/// Density of `incoming_from_disk` for a unit direction that hits the disk; 0 from behind.
fn disk_density(light: ListLight, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    if dot(direction, light.direction) >= 0.0 {
        return 0.0;
    }
    return plane_density(at, direction, light.position, light.direction, PI * light.extent * light.extent);
}

/// Density per steradian of a uniform point of a planar shape, from the vector to it; 0 if seen edge-on.
fn area_density(delta: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let distance_squared = dot(delta, delta);
    let height = abs(dot(delta, unit_normal));
    // dA * cos = r^2 * dw, and r * cos is the height above the plane.
    if distance_squared < MIN_SQUARE || height < 1e-18 * sqrt(distance_squared) {
        return 0.0;
    }
    let stretch = min(sqrt(distance_squared) / height, MAX_QUOTIENT);
    return min(quotient(distance_squared, area) * stretch, MAX_QUOTIENT);
}

/// The same for the point where a unit direction hits the plane; 0 for a miss.
fn plane_density(at: vec3<f32>, direction: vec3<f32>, point: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let slope = dot(direction, unit_normal);
    let height = dot(point - at, unit_normal);
    if height * slope <= 0.0 || abs(slope) < 1e-18 {
        return 0.0;
    }
    let distance = quotient(abs(height), abs(slope));
    return area_density(distance * direction, unit_normal, area);
}

// part disk/hit
// use shared/numbers

/// Includes the edge; rays in the plane of the disk miss.
fn disk_crossing(light: ListLight, ray: Ray) -> Crossing {
    let slope = dot(ray.direction, light.direction);
    let height = dot(light.position - ray.origin, light.direction);
    // As quotients of absolute values, which stay in range.
    let t = quotient(abs(height), abs(slope)) * sign_of(height) * sign_of(slope);
    // A nearly parallel ray would reach the plane so far away that a long direction overflows; it misses the disk anyway.
    let delta = abs(light.position - ray.origin);
    let length = abs(ray.direction);
    let farthest = 2.0 * (max(delta.x, max(delta.y, delta.z)) + light.extent);
    let is_near = abs(t) <= quotient(farthest, max(length.x, max(length.y, length.z)));
    let from_center = (ray.origin + select(0.0, t, is_near) * ray.direction) - light.position;
    let is_inside = is_near && dot(from_center, from_center) <= light.extent * light.extent;
    let is_within = slope != 0.0 && ray.t_min <= t && t <= ray.t_max;
    return Crossing(select(NO_CROSSING, t, is_inside && is_within), slope < 0.0);
}

// part sphere
// Sphere lights; twin of crates/renderer/src/light/sphere.rs.
//
// Close to a sphere the cap height changes with the square root of the distance, and so does its error.
// use shared/numbers
// use shared/angle
// use shared/sampling
// use shared/light/list

/// One minus the cosine of the half-angle under which a point sees a sphere; 0 from inside.
fn cap_height(radius: f32, distance: f32) -> f32 {
    if distance <= radius {
        return 0.0;
    }
    let sine = radius / distance;
    // As a product, to keep precision for near and far points.
    let cosine = sqrt((1.0 - sine) * (1.0 + sine));
    return sine * sine / (1.0 + cosine);
}

/// Samples the cone in which the point sees the sphere, uniformly in solid angle.
fn incoming_from_sphere(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance = length(delta);
    let height = cap_height(light.extent, distance);
    if height <= 0.0 {
        return no_incoming_light();
    }
    let below = square.x * height;
    let cosine = 1.0 - below;
    let sine_squared = below * (2.0 - below);
    // Half of the chord that the sphere cuts from the ray. Rounding may make it negative at the silhouette.
    let sine = sqrt(sine_squared);
    let across = distance * sine;
    let half_chord = sqrt(max((light.extent - across) * (light.extent + across), 0.0));
    let to_light = basis_about(delta / distance) * vec3(sine * circle(square.y), cosine);
    let point = at + to_light * (distance * cosine - half_chord);
    let solid_angle = TAU * height;
    return IncomingLight(to_light, quotient(1.0, solid_angle), bounded(light.color * solid_angle), FINITE, point);
}

/// Density of `incoming_from_sphere` for all directions that hit the sphere; 0 from inside.
fn sphere_density(light: ListLight, at: vec3<f32>) -> f32 {
    let height = cap_height(light.extent, length(light.position - at));
    return select(0.0, quotient(1.0, TAU * height), height > 0.0);
}

// part sphere/hit
// use shared/numbers

/// The discriminant uses the distance from the center to the line, so small and far spheres keep precision (Haines et al.
/// 2019).
fn sphere_crossing(light: ListLight, ray: Ray) -> Crossing {
    let from_center = ray.origin - light.position;
    let d_squared = dot(ray.direction, ray.direction);
    let closest = -dot(from_center, ray.direction) / max(d_squared, MIN_SQUARE);
    let distance = length(from_center + closest * ray.direction);
    let chord_squared = (light.extent - distance) * (light.extent + distance);
    if chord_squared < 0.0 || d_squared < MIN_SQUARE {
        return Crossing(NO_CROSSING, false);
    }
    let half_chord = sqrt(chord_squared / d_squared);
    let enters = closest - half_chord;
    if ray.t_min <= enters && enters <= ray.t_max {
        return Crossing(enters, true);
    }
    let leaves = closest + half_chord;
    let is_within = ray.t_min <= leaves && leaves <= ray.t_max;
    return Crossing(select(NO_CROSSING, leaves, is_within), false);
}

// part shape_lights
// choice shape_lights/none
// No sphere or disk lights.

/// Whether a shape light other than `except` occludes a ray.
fn shape_light_occludes(ray: Ray, except: u32) -> bool {
    return false;
}

/// Closest shape light along a ray, up to `t_max`.
struct ShapeLightHit {
    is_hit: bool,
    number: u32,
    radiance: vec3<f32>,
    t: f32,
}

fn intersect_shape_lights(ray: Ray) -> ShapeLightHit {
    return ShapeLightHit(false, 0u, vec3(0.0), ray.t_max);
}

/// Unit normal of a shape light at one of its points.
fn shape_light_normal(number: u32, point: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}

// choice shape_lights/list
// The closest shape light along a ray. Shape lights occlude each other.
// use shared/light/list/lights
// use shared/light/list/hit
// use shared/invocation/iterations

/// Whether a shape light other than `except` occludes a ray.
fn shape_light_occludes(ray: Ray, except: u32) -> bool {
    iterations += arrayLength(&lights);
    for (var number = 0u; number < arrayLength(&lights); number++) {
        if number != except && shape_light_crossing(lights[number], ray).t <= ray.t_max {
            return true;
        }
    }
    return false;
}

/// Closest shape light along a ray; ties go to the first of the list.
struct ShapeLightHit {
    is_hit: bool,
    /// Index in the list.
    number: u32,
    radiance: vec3<f32>,
    t: f32,
}

fn intersect_shape_lights(ray: Ray) -> ShapeLightHit {
    iterations += arrayLength(&lights);
    var light_hit = ShapeLightHit(false, 0u, vec3(0.0), ray.t_max);
    for (var number = 0u; number < arrayLength(&lights); number++) {
        let crossing = shape_light_crossing(lights[number], ray);
        if crossing.t < light_hit.t || (crossing.t == light_hit.t && !light_hit.is_hit) {
            light_hit = ShapeLightHit(true, number, select(vec3(0.0), lights[number].color, crossing.emits), crossing.t);
        }
    }
    return light_hit;
}

/// Unit normal of a shape light at one of its points.
fn shape_light_normal(number: u32, point: vec3<f32>) -> vec3<f32> {
    return normal_of_light(lights[number], point);
}
