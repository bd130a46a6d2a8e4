// Rasterizes the primary hits of a pinhole camera at pixel centers. One draw covers all instances of a mesh, with three vertex
// invocations per triangle. The fragment stage intersects the triangle with the ray through the pixel center.
//
// The depth of a fragment orders by `t` of its ray, without the last bit. Ties keep the triangle drawn first, which has the
// lowest instance and primitive, even where `t` differs in that bit. Rasterizers snap vertices to a grid of 1/256 pixel, so a
// pixel center that close to an edge may fall on either side.
// use shared/camera
// use shared/hash/ray_key
// use shared/facing
// use shared/camera/first/triangle
// use shared/surface
// use ?mask

struct Corner {
    @builtin(position) pixel: vec4<f32>,
    @location(0) @interpolate(flat) instance: u32,
    @location(1) @interpolate(flat) primitive: u32,
}

/// Floats stored as bits.
struct Texels {
    /// World-space point, and `t` of the ray.
    @location(0) point: vec4<u32>,
    /// Unit normal of the triangle on the viewer's side, and the index of the material.
    @location(1) normal: vec4<u32>,
    /// Unit shading normal, and the instance.
    @location(2) shading_normal: vec4<u32>,
    /// Albedo, and the index of the primitive plus one; 0 where nothing is visible.
    @location(3) albedo: vec4<u32>,
    @builtin(frag_depth) depth: f32,
}

@vertex
fn vertex(@builtin(vertex_index) number: u32, @builtin(instance_index) instance: u32) -> Corner {
    let primitive = number / 3u;
    let corners = triangles[triangle_of(Hit(0.0, 0.0, 0.0, primitive, instance))].vertices;
    let delta = point_world(instance, position_of(corners[number % 3u])) - picture.eye;
    let forward = dot(delta, picture.forward);
    // The two pixel steps are perpendicular and equally long.
    let scale = 2.0 / (picture.pixel * picture.pixel);
    let across = dot(delta, picture.right) * scale / f32(picture.size.x);
    let along = dot(delta, picture.down) * scale / f32(picture.size.y);
    // Everything in front of the eye lies between the clip planes, at any distance.
    return Corner(vec4(across, -along, 0.5 * forward, forward), instance, primitive);
}

@fragment
fn fragment(corner: Corner) -> Texels {
    let position = corner.pixel.xy - 0.5 * vec2<f32>(picture.size);
    let ray = line_of(position);
    let hit = in_triangle(ray, corner.instance, corner.primitive);
    let at = vec2<u32>(corner.pixel.xy);
    ray_key = derived_key(derived_key(0u, bits(picture.sampler, at.y * picture.size.x + at.x, 0u, ALPHA_DIMENSION)), 0u);
    face_along(ray.direction, SEEN);
    if !accepts(hit) {
        discard;
    }
    let surface = surface_at(hit, ray, pixel_cone(position, 0u));
    return Texels(
        vec4(bitcast<vec3<u32>>(surface.position), bitcast<u32>(hit.t)),
        vec4(bitcast<vec3<u32>>(surface.normal), surface.material),
        vec4(bitcast<vec3<u32>>(surface.shading_normal), hit.instance),
        vec4(bitcast<vec3<u32>>(surface.base_color), hit.primitive + 1u),
        falling(hit.t),
    );
}

/// A number in 0..=1 that decreases as `t` grows, by the order of bits without the last. Precision is relative, so far surfaces
/// keep as many bits as near ones.
fn falling(t: f32) -> f32 {
    return bitcast<f32>(0x3f800000u - (bitcast<u32>(min(t, 1e38)) >> 1u));
}
