// Sampling of triangles by solid angle; twin of crates/renderer/src/light/{triangle,spherical}.rs.
//
// All steps are chosen for f32. The solid angle is 2 atan2(|a b c|, 1 + ab + bc + ca) (Van Oosterom and Strackee 1983), with
// the triple product taken from the edges, which stay precise for far points. A fraction `x` of it is a triangle a, b, c' with
// c' on the arc from a to c. If `h = p a + q c` bisects the angle from a to c', then c' is a mirrored in h, and the tangent of
// half the fraction's solid angle is `q |a b c| / (p (1 + ab) + q (ab + bc))`, which is solved for p and q with products only.
// The point on the arc from b to c' is computed from the chord between them rather than from a difference of cosines. The
// result is the point of Arvo 1995.
// use shared/numbers
// use shared/angle
// use shared/light/incoming

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
