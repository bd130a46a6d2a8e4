// Surfaces of curves in pictures: round segments, in scenes of triangles and of curves; twin of crates/renderer/src/surface/curve.rs.
//
// A segment is a `Triangle` whose vertices are its ends, and the first end again; its `normal` has the two radii and where it begins along the strand, its `area_root`
// where it ends. Of a hit, `u` is the position along the segment, `v` is 1 where the ray leaves it. So the weights of triangles, `1 - u - v`, `u` and `v`, give what
// is between the ends.

// choice shapes/curves
// Scenes of triangles and of round segments.
// use shared/surface
// use shared/surface/faces
// use shared/surface_curve/along

/// The surface at a hit of a ray with this cone at its origin.
fn surface_at(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    if curve_kind(hit.instance) != 0u {
        return tube_surface(hit, ray, cone);
    }
    return triangle_surface(hit, ray.direction, cone);
}

/// The surface of a round segment: the point of the ray, moved onto the ball that touches the surface there.
fn tube_surface(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    let segment = triangles[triangle_of(hit)];
    let first = position_of(segment.vertices.x);
    let axis = position_of(segment.vertices.y) - first;
    let narrowing = segment.normal.x - segment.normal.y;
    // Relative to the first end.
    let away = first - vector_object(hit.instance, ray.origin - point_world(hit.instance, vec3(0.0)));
    let near = hit.t * vector_object(hit.instance, ray.direction) - away;
    // The position is rounded: the one of the ball that touches a cone at the point is computed again.
    let square = dot(axis, axis) - narrowing * narrowing;
    var u = hit.u;
    if square > 0.0 && u > 0.0 && u < 1.0 {
        u = clamp((dot(near, axis) - segment.normal.x * narrowing) / square, 0.0, 1.0);
    }
    let radius = segment.normal.x - narrowing * u;
    let from_center = unit(near - axis * u);
    let outward_object = select(from_center, vec3(0.0, 0.0, 1.0), all(from_center == vec3(0.0)));
    let position = point_world(hit.instance, first + (axis * u + outward_object * radius));
    // The cofactors of a mirroring transform turn normals around.
    let image = normal_world(hit.instance, outward_object) * select(1.0, -1.0, mirrors(hit.instance));
    let outward = select(image, -unit(ray.direction), all(image == vec3(0.0)));
    let normal = select(outward, -outward, dot(outward, ray.direction) > 0.0);
    let right = unit(cross(vector_object(hit.instance, ray.direction), axis));
    curve_along = vector_world(hit.instance, axis);
    curve_width = 2.0 * vector_world(hit.instance, right * radius);
    curve_part = segment.area_root - segment.normal.z;
    curve_uv = vec2(segment.normal.z + u * curve_part, 0.5 + 0.5 * dot(outward_object, right));
    let weights = vec3(1.0 - u, u, 0.0);
    let arrived = grown(cone, hit.t * size(ray.direction));
    // Textures are filtered in the plane of axis and width; where there is none, in one so large that a texel is enough.
    let plane = cross(curve_along, curve_width);
    let breadth = select(sqrt(size(plane)), MAX_QUOTIENT, all(plane == vec3(0.0)));
    let facing = select(unit(plane), normal, all(plane == vec3(0.0)));
    let lookup = TextureLookup(segment.vertices, weights, hit.instance, facing, breadth, unit(ray.direction), arrived);
    let material = segment.material & 0x7fffffffu;
    return Surface(
        position,
        normal,
        normal,
        SmoothSurface(position, normal),
        hit.v < 0.5,
        materials[material].base_color * texel(materials[material].base_color_slot, lookup).rgb * vertex_color(segment.vertices, weights).rgb,
        materials[material].emission * texel(materials[material].emission_slot, lookup).rgb,
        slack_of(hit.instance) * (abs(normal.x) + abs(normal.y) + abs(normal.z)),
        arrived,
        material,
        lookup,
    );
}

/// Prepares the coordinates of a hit whose alpha is looked up: tubes have it in the middle of `v`.
fn prepare_alpha(hit: Hit, triangle: Triangle) {
    curve_uv = vec2(triangle.normal.z + hit.u * (triangle.area_root - triangle.normal.z), 0.5);
}

// choice exits/hair
// Rays that start in a hair leave it without a hit, as its BSDF is that of the whole fiber.
// use shared/surface

fn is_passed_at_exit(hit: Hit) -> bool {
    return materials[triangles[triangle_of(hit)].material & 0x7fffffffu].hair != NO_HAIR;
}

// part along
// The curve of the last surface, if it was one. World space.

/// The direction, as long as the segment, and to the right, as long as the curve is wide.
var<private> curve_along: vec3<f32>;
var<private> curve_width: vec3<f32>;

/// Texture coordinates: along the strand, and across. And how much of the strand the segment is.
var<private> curve_uv: vec2<f32>;
var<private> curve_part: f32;
