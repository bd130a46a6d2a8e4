// The surfaces that a pinhole sees at the centres of pixels, by rasterisation: instances of a mesh are drawn together, three
// invocations a triangle, and the triangle that covers a centre is met there as by the ray through it.
//
// A fragment's depth is its ray's `t` but for the last bit, so that what is nearest is decided by the number that decides among hits;
// of equal ones the first drawn stays, which has the lowest instance and primitive, also of two that differ in that bit alone. Rasterisers place vertices on a grid of 1/256 of a pixel: a centre that
// is as near as that to an edge may go to either side.
//
// `?mask` is alpha.
// use shared/camera
// use shared/hash/ray_key
// use shared/surface
// use ?mask

struct Corner {
    @builtin(position) place: vec4<f32>,
    @location(0) @interpolate(flat) instance: u32,
    @location(1) @interpolate(flat) primitive: u32,
}

/// Floats as bits.
struct Texels {
    /// World-space point, and `t` of the ray.
    @location(0) point: vec4<u32>,
    /// Unit normal of the triangle on the viewer's side, and the material's number.
    @location(1) normal: vec4<u32>,
    /// Unit normal to shade with, and the instance.
    @location(2) shading_normal: vec4<u32>,
    /// Albedo, and the primitive's number and one; 0 where nothing is seen.
    @location(3) albedo: vec4<u32>,
    @builtin(frag_depth) depth: f32,
}

@vertex
fn vertex(@builtin(vertex_index) number: u32, @builtin(instance_index) instance: u32) -> Corner {
    let primitive = number / 3u;
    let corners = triangles[triangle_of(Hit(0.0, 0.0, 0.0, primitive, instance))].vertices;
    let way = point_world(instance, position_of(corners[number % 3u])) - picture.eye;
    let forward = dot(way, picture.forward);
    // Steps of a pixel are perpendicular to each other and of one length.
    let scale = 2.0 / (picture.pixel * picture.pixel);
    let across = dot(way, picture.right) * scale / f32(picture.size.x);
    let along = dot(way, picture.down) * scale / f32(picture.size.y);
    // All that is before the eye lies between the planes that clip, however near or far.
    return Corner(vec4(across, -along, 0.5 * forward, forward), instance, primitive);
}

@fragment
fn fragment(corner: Corner) -> Texels {
    let position = corner.place.xy - 0.5 * vec2<f32>(picture.size);
    let ray = line_of(position);
    let hit = in_triangle(ray, corner.instance, corner.primitive);
    let at = vec2<u32>(corner.place.xy);
    ray_key = derived_key(derived_key(0u, bits(picture.sampler, at.y * picture.size.x + at.x, 0u, ALPHA_DIMENSION)), 0u);
    if !accepts(hit) {
        discard;
    }
    let surface = surface_at(hit, ray.direction, pixel_cone(position, 0u));
    return Texels(
        vec4(bitcast<vec3<u32>>(surface.position), bitcast<u32>(hit.t)),
        vec4(bitcast<vec3<u32>>(surface.normal), surface.material),
        vec4(bitcast<vec3<u32>>(surface.shading_normal), hit.instance),
        vec4(bitcast<vec3<u32>>(surface.base_color), hit.primitive + 1u),
        falling(hit.t),
    );
}

/// Where a ray meets the plane of a triangle that covers it, rounded into the triangle.
fn in_triangle(ray: Ray, instance: u32, primitive: u32) -> Hit {
    let corners = triangles[triangle_of(Hit(0.0, 0.0, 0.0, primitive, instance))].vertices;
    let sides = edges(corners);
    let first = vector_world(instance, sides[0]);
    let second = vector_world(instance, sides[1]);
    // From the first corner to the ray's origin.
    let away = ray.origin - point_world(instance, position_of(corners.x));
    let across = cross(ray.direction, second);
    let along = cross(away, first);
    // Twice the area as the ray sees it, with a sign.
    let area = dot(first, across);
    let share = sign_of(area) / max(abs(area), 1e-30);
    let u = clamp(dot(away, across) * share, 0.0, 1.0);
    let v = clamp(dot(ray.direction, along) * share, 0.0, 1.0 - u);
    return Hit(max(dot(second, along) * share, 0.0), u, v, primitive, instance);
}

/// A number of 0..=1 that falls where `t` grows, by the order of bits but the last: as fine for far things as for near ones.
fn falling(t: f32) -> f32 {
    return bitcast<f32>(0x3f800000u - (bitcast<u32>(min(t, 1e38)) >> 1u));
}
