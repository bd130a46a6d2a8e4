// Triangles that shine, as a point sees them; twin of crates/renderer/src/light/{triangle,spherical}.rs.
//
// Every step is chosen for f32. The solid angle is 2 atan2(|a b c|, 1 + ab + bc + ca) (Van Oosterom and Strackee 1983), its
// triple product taken from the edges, which a far point does not blur. A share `x` of it is a triangle a, b, c' with c' on
// the arc from a to c: if `h = p a + q c` triangle_blocks the angle from a to c', then c' is a mirrored in h, and the tangent of half
// the share's solid angle is `q |a b c| / (p (1 + ab) + q (ab + bc))`, which is solved for p and q by products alone. The
// point on the arc from b to c' comes from the chord between them, not from a difference of cosines. It is the same point
// that Arvo 1995 finds.
// use shared/numbers
// use shared/angle
// use shared/light/incoming

/// Solid angles that are sampled uniformly, in steradians; others by area.
const LEAST_SOLID_ANGLE: f32 = 1e-4;
const GREATEST_SOLID_ANGLE: f32 = 6.2;

/// A triangle about a point.
struct SphericalTriangle {
    /// Unit vectors to the corners.
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    /// The absolute product of the three.
    triple: f32,
    /// Steradians; 0 where a uniform point of the triangle serves as well.
    solid_angle: f32,
}

/// A point of a triangle.
struct TriangleSample {
    /// Weights of the second and third corner.
    weights: vec2<f32>,
    /// Per steradian; 0 where there is none.
    density: f32,
}

/// The triangle of a corner and the edges from it, seen from `at`.
fn spherical_triangle(corner: vec3<f32>, first: vec3<f32>, second: vec3<f32>, at: vec3<f32>) -> SphericalTriangle {
    let way = corner - at;
    let ways = mat3x3(way, way + first, way + second);
    let squares = vec3(dot(ways[0], ways[0]), dot(ways[1], ways[1]), dot(ways[2], ways[2]));
    if any(squares < vec3(LEAST_SQUARE)) {
        return SphericalTriangle(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0);
    }
    let a = ways[0] / sqrt(squares.x);
    let b = ways[1] / sqrt(squares.y);
    let c = ways[2] / sqrt(squares.z);
    let triple = quotient(abs(dot(a, cross(first, second))), sqrt(squares.y) * sqrt(squares.z));
    let solid_angle = 2.0 * angle_of(triple, 1.0 + dot(a, b) + dot(b, c) + dot(c, a));
    let is_sampled = solid_angle >= LEAST_SOLID_ANGLE && solid_angle < GREATEST_SOLID_ANGLE;
    return SphericalTriangle(a, b, c, triple, select(0.0, solid_angle, is_sampled));
}

/// A unit direction, uniform over the solid angle.
fn direction_into(spherical: SphericalTriangle, square: vec2<f32>) -> vec3<f32> {
    let turned = circle(square.x * (0.5 / TAU) * spherical.solid_angle);
    let one = 1.0 + dot(spherical.a, spherical.b);
    let other = dot(spherical.a, spherical.c) + dot(spherical.b, spherical.c);
    let halved = (spherical.triple * turned.x - other * turned.y) * spherical.a + (one * turned.y) * spherical.c;
    // Zero only where rounding leaves nothing of a sliver.
    let third = (2.0 * dot(halved, spherical.a) / max(dot(halved, halved), LEAST_SQUARE)) * halved - spherical.a;
    let chord = third - spherical.b;
    // One minus the cosine of the arc from b.
    let height = 0.5 * dot(chord, chord);
    let share = sqrt(square.y * (2.0 - square.y * height) / max(2.0 - height, 1e-7));
    return normalize(spherical.b + share * chord + (height * (share - square.y)) * spherical.b);
}

/// A point of the triangle: uniform over the solid angle, or over the area where that comes to the same.
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
    let way = (corner - at) + weights.x * first + weights.y * second;
    return TriangleSample(weights, area_density(way, normal_of(twice), area));
}

/// Density with which `sample_triangle` finds a unit direction that meets the triangle.
fn triangle_density(corner: vec3<f32>, first: vec3<f32>, second: vec3<f32>, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    let spherical = spherical_triangle(corner, first, second, at);
    if spherical.solid_angle > 0.0 {
        return 1.0 / spherical.solid_angle;
    }
    let twice = cross(first, second);
    return plane_density(at, direction, corner, normal_of(twice), 0.5 * length(twice));
}

/// The unit normal of a triangle by the cross product of its edges, of which none is zero.
fn normal_of(twice: vec3<f32>) -> vec3<f32> {
    return twice / max(length(twice), 1e-18);
}

/// Weights of the point that a direction meets, rounded into the triangle.
fn weights_along(way: vec3<f32>, first: vec3<f32>, second: vec3<f32>, direction: vec3<f32>) -> vec2<f32> {
    let twice = cross(first, second);
    let normal = normal_of(twice);
    let distance = quotient(abs(dot(way, normal)), abs(dot(direction, normal)));
    let within = distance * direction - way;
    let area = max(length(twice), 1e-18);
    let u = clamp(dot(cross(within, second), normal) / area, 0.0, 1.0);
    let v = clamp(dot(cross(first, within), normal) / area, 0.0, 1.0 - u);
    return vec2(u, v);
}

/// Weights of two corners, uniform over the triangle, from a point of the unit square (Heitz 2019).
fn uniform_weights(square: vec2<f32>) -> vec2<f32> {
    if square.x < square.y {
        return vec2(0.5 * square.x, square.y - 0.5 * square.x);
    }
    return vec2(square.x - 0.5 * square.y, 0.5 * square.y);
}
