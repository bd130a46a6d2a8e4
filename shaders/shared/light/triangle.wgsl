// Emissive triangles of instances that do not move, sampled by solid angle; twin of crates/renderer/src/light/triangle.rs.
//
// `?emission` gives the radiance at a point. All steps are chosen for f32. The solid angle is 2 atan2(|a b c|, 1 + ab + bc + ca) (Van Oosterom and Strackee 1983), with
// the triple product taken from the edges, which stay precise for far points. A fraction `x` of it is a triangle a, b, c' with
// c' on the arc from a to c. If `h = p a + q c` bisects the angle from a to c', then c' is a mirrored in h, and the tangent of
// half the fraction's solid angle is `q |a b c| / (p (1 + ab) + q (ab + bc))`, which is solved for p and q with products only.
// The point on the arc from b to c' is computed from the chord between them rather than from a difference of cosines. The
// result is the point of Arvo 1995.
// use shared/numbers
// use shared/angle
// use shared/light/disk
// use shared/light/sampler
// use shared/light/tree
// use shared/invocation/iterations
// use ?emission

/// Range of solid angles that are sampled uniformly, in steradians; others are sampled by area.
const MIN_SOLID_ANGLE: f32 = 1e-4;
const MAX_SOLID_ANGLE: f32 = 6.2;

/// A triangle as seen from a point.
struct SphericalTriangle {
    /// Unit vectors to the vertices.
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    /// Absolute triple product.
    triple: f32,
    /// Steradians; 0 if the triangle should be sampled by area.
    solid_angle: f32,
}

/// A sampled point of a triangle.
struct TriangleSample {
    /// Weights of the second and third vertex.
    weights: vec2<f32>,
    /// Per steradian; 0 for no sample.
    density: f32,
}

/// The triangle of a vertex and the edges from it, as seen from `at`.
fn spherical_triangle(corner: vec3<f32>, first: vec3<f32>, second: vec3<f32>, at: vec3<f32>) -> SphericalTriangle {
    let delta = corner - at;
    let deltas = mat3x3(delta, delta + first, delta + second);
    let squares = vec3(dot(deltas[0], deltas[0]), dot(deltas[1], deltas[1]), dot(deltas[2], deltas[2]));
    if any(squares < vec3(MIN_SQUARE)) {
        return SphericalTriangle(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0);
    }
    let a = deltas[0] / sqrt(squares.x);
    let b = deltas[1] / sqrt(squares.y);
    let c = deltas[2] / sqrt(squares.z);
    let triple = quotient(abs(dot(a, cross(first, second))), sqrt(squares.y) * sqrt(squares.z));
    let solid_angle = 2.0 * angle_of(triple, 1.0 + dot(a, b) + dot(b, c) + dot(c, a));
    let is_sampled = solid_angle >= MIN_SOLID_ANGLE && solid_angle < MAX_SOLID_ANGLE;
    return SphericalTriangle(a, b, c, triple, select(0.0, solid_angle, is_sampled));
}

/// A unit direction, uniform in solid angle.
fn direction_into(spherical: SphericalTriangle, square: vec2<f32>) -> vec3<f32> {
    let turned = circle(square.x * (0.5 / TAU) * spherical.solid_angle);
    let one = 1.0 + dot(spherical.a, spherical.b);
    let other = dot(spherical.a, spherical.c) + dot(spherical.b, spherical.c);
    let halved = (spherical.triple * turned.x - other * turned.y) * spherical.a + (one * turned.y) * spherical.c;
    // Zero only where rounding leaves nothing of a sliver.
    let third = (2.0 * dot(halved, spherical.a) / max(dot(halved, halved), MIN_SQUARE)) * halved - spherical.a;
    let chord = third - spherical.b;
    // One minus the cosine of the arc from b.
    let height = 0.5 * dot(chord, chord);
    let fraction = sqrt(square.y * (2.0 - square.y * height) / max(2.0 - height, 1e-7));
    return normalize(spherical.b + fraction * chord + (height * (fraction - square.y)) * spherical.b);
}

/// Samples a triangle by solid angle, or by area where both are equivalent.
fn sample_triangle(
    corner: vec3<f32>,
    first: vec3<f32>,
    second: vec3<f32>,
    at: vec3<f32>,
    square: vec2<f32>,
) -> TriangleSample {
    let twice = cross(first, second);
    let area = 0.5 * length(twice);
    let spherical = spherical_triangle(corner, first, second, at);
    if spherical.solid_angle > 0.0 {
        let direction = direction_into(spherical, square);
        return TriangleSample(weights_along(corner - at, first, second, direction), 1.0 / spherical.solid_angle);
    }
    let weights = uniform_weights(square);
    let delta = (corner - at) + weights.x * first + weights.y * second;
    return TriangleSample(weights, area_density(delta, normal_of(twice), area));
}

/// Density of `sample_triangle` for a unit direction that hits the triangle.
fn triangle_density(corner: vec3<f32>, first: vec3<f32>, second: vec3<f32>, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    let spherical = spherical_triangle(corner, first, second, at);
    if spherical.solid_angle > 0.0 {
        return 1.0 / spherical.solid_angle;
    }
    let twice = cross(first, second);
    return plane_density(at, direction, corner, normal_of(twice), 0.5 * length(twice));
}

/// Unit normal from the cross product of the edges, which is not zero.
fn normal_of(twice: vec3<f32>) -> vec3<f32> {
    return twice / max(length(twice), 1e-18);
}

/// Barycentric weights of the point that a direction hits, clamped to the triangle.
fn weights_along(delta: vec3<f32>, first: vec3<f32>, second: vec3<f32>, direction: vec3<f32>) -> vec2<f32> {
    let twice = cross(first, second);
    let normal = normal_of(twice);
    let distance = quotient(abs(dot(delta, normal)), abs(dot(direction, normal)));
    let within = distance * direction - delta;
    let area = max(length(twice), 1e-18);
    let u = clamp(dot(cross(within, second), normal) / area, 0.0, 1.0);
    let v = clamp(dot(cross(first, within), normal) / area, 0.0, 1.0 - u);
    return vec2(u, v);
}

/// Uniform barycentric weights of two vertices from a point of the unit square (Heitz 2019).
fn uniform_weights(square: vec2<f32>) -> vec2<f32> {
    if square.x < square.y {
        return vec2(0.5 * square.x, square.y - 0.5 * square.x);
    }
    return vec2(square.x - 0.5 * square.y, 0.5 * square.y);
}

/// An emissive triangle. Emitters are ordered by instance and primitive.
struct Emitter {
    /// First vertex, world space.
    corner: vec3<f32>,
    instance: u32,
    /// From the first vertex to the second.
    first: vec3<f32>,
    primitive: u32,
    /// From the first vertex to the third.
    second: vec3<f32>,
    /// Leaf in the light tree.
    leaf: u32,
    /// Emitted radiance, before textures.
    radiance: vec3<f32>,
    /// Distance along each axis that rays keep from the triangle.
    slack: f32,
}

@group(3) @binding(5) var<storage, read> emitters: array<Emitter>;

/// Light from a point of an emitter; none where it is black or transparent.
fn sample_emitter(number: u32, at: vec3<f32>, square: vec2<f32>) -> LightSample {
    let emitter = emitters[number];
    let point = sample_triangle(emitter.corner, emitter.first, emitter.second, at, square);
    let position = emitter.corner + (point.weights.x * emitter.first + point.weights.y * emitter.second);
    let delta = (emitter.corner - at) + (point.weights.x * emitter.first + point.weights.y * emitter.second);
    if point.density <= 0.0 || dot(delta, delta) < MIN_SQUARE {
        return no_light();
    }
    let to_light = normalize(delta);
    let radiance = emitted_by(emitter, point.weights, to_light);
    if all(radiance <= vec3(0.0)) {
        return no_light();
    }
    // The ray ends as far from the emitter as rays start from it, so that rounding never makes it end behind the emitter.
    let normal = normal_of(cross(emitter.first, emitter.second));
    let off = normal * (-sign_of(dot(normal, delta)) * emitter.slack * dot(abs(normal), vec3(1.0)));
    let weighted = bounded(radiance * quotient(1.0, point.density));
    return LightSample(IncomingLight(to_light, point.density, weighted, FINITE, position + off), NO_SHAPE_LIGHT, true);
}

/// Index of the emitter of a hit; the number of emitters if it moves, has no area or is black.
fn emitter_of(instance: u32, primitive: u32) -> u32 {
    let n = arrayLength(&emitters);
    var first = 0u;
    var last = n;
    // Binary search.
    loop {
        iterations += 1u;
        if first >= last {
            break;
        }
        let middle = first + (last - first) / 2u;
        let emitter = emitters[middle];
        if emitter.instance < instance || emitter.instance == instance && emitter.primitive < primitive {
            first = middle + 1u;
        } else {
            last = middle;
        }
    }
    if first < n && emitters[first].instance == instance && emitters[first].primitive == primitive {
        return first;
    }
    return n;
}

/// Density of a unit direction that hits a triangle, including the probability of choosing it.
fn emitter_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    let number = emitter_of(instance, primitive);
    if number >= arrayLength(&emitters) {
        return 0.0;
    }
    let emitter = emitters[number];
    let density = triangle_density(emitter.corner, emitter.first, emitter.second, receiver.position, direction);
    return light_probability(emitter.leaf, receiver) * density;
}

// choice emission/constant
// Emitters with constant radiance and no alpha.

fn emitted_by(emitter: Emitter, weights: vec2<f32>, direction: vec3<f32>) -> vec3<f32> {
    return emitter.radiance;
}

// choice emission/textured
// Emitters with textures or alpha: the texture scales the radiance, alpha the probability of being hit.
// use ?alpha

fn emitted_by(emitter: Emitter, weights: vec2<f32>, direction: vec3<f32>) -> vec3<f32> {
    let hit = Hit(1.0, weights.x, weights.y, emitter.primitive, emitter.instance);
    let triangle = triangles[triangle_of(hit)];
    let material = triangle.material & 0x7fffffffu;
    let corners = triangle.vertices;
    let at = vec3(1.0 - weights.x - weights.y, weights);
    // Looked up at a point: a cone of zero width averages nothing.
    let line = Cone(0.0, 0.0, 0.0, false);
    let winding = normal_world(emitter.instance, triangle.normal);
    let lookup = TextureLookup(corners, at, emitter.instance, winding, area_root(emitter.instance, triangle), direction, line);
    return emitter.radiance * texel(materials[material].emission_slot, lookup).rgb * presence(material, corners, at);
}
