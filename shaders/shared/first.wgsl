// part triangle
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

// choice trace
// Camera rays start without knowledge of what they hit.
// use shared/ray

/// How far a camera ray is traced at first.
fn first_reach(ray: Ray, pixel: u32) -> f32 {
    return ray.t_max;
}

// choice raster
// Camera rays start with the triangle that a raster pass saw at the center of their pixel: boxes behind it need no visit.
//
// The triangle is a guess, as samples lie beside the center, alpha tests may reject it, and instances may move. A ray that hits
// nothing before it is traced again to its end, so every hit is that of a ray that was traced at once.
// use shared/first/triangle

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
