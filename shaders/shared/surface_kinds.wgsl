// Surfaces of curves of every kind in pictures, in scenes of triangles and of curves; twin of crates/renderer/src/surface/curve.rs.
//
// A curve is a `Triangle` whose vertices are its first and last control point, and the first again; its `normal` has the inner control points of a cubic curve, as bits
// with INNER_BIT, and where it begins along the strand, its `area_root` where it ends. Radii, and what is at shutter closing, are columns of vertices. The kind
// of an instance has the bits of shared/curve.

// choice shapes/kinds
// Scenes of triangles and of curves of every kind.
// use shared/surface_kinds/curves
// use shared/surface/faces

/// The surface at a hit of a ray with this cone at its origin.
fn surface_at(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    if curve_kind(hit.instance) != 0u {
        return curve_surface(hit, ray, cone);
    }
    return triangle_surface(hit, ray.direction, cone);
}

fn prepare_alpha(hit: Hit, curve: Triangle) {
    curve_uv = alpha_coordinates(hit, curve);
}

// part curves
// Surfaces of curves of every kind.
// use shared/surface
// use shared/surface_curve/along
// use shared/time/ray_time
// const RADIUS
// const CLOSE

/// Bits of the kind of an instance, as in shared/curve.
const IS_CUBIC: u32 = 1u;
const IS_RIBBON: u32 = 2u;
const IS_MOVING: u32 = 4u;

/// Makes a number of a vertex a finite f32 that is not subnormal.
const INNER_BIT: u32 = 0x40000000u;

/// Center and radius of a point of curves at the time of the ray.
fn control_ball(vertex: u32, kind: u32) -> vec4<f32> {
    let open = vec4(position_of(vertex), vertices[vertex * STRIDE + RADIUS]);
    if (kind & IS_MOVING) == 0u {
        return open;
    }
    let close = vec4(three_of(vertex, CLOSE), vertices[vertex * STRIDE + CLOSE + 3u]);
    return open + ray_time * (close - open);
}

/// Control points of a curve: those of a straight one are its ends, and its first one twice.
fn control_points(curve: Triangle, kind: u32) -> vec4<u32> {
    if (kind & IS_CUBIC) == 0u {
        return vec4(curve.vertices.x, curve.vertices.y, curve.vertices.x, curve.vertices.x);
    }
    let inner = bitcast<vec2<u32>>(curve.normal.xy) & vec2(INNER_BIT - 1u);
    return vec4(curve.vertices.x, inner, curve.vertices.y);
}

/// The surface of a curve: of a tube the point of the ray, moved onto the ball that touches the surface there, of a ribbon that of the line as far along the ray as the
/// center.
fn curve_surface(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    let curve = triangles[triangle_of(hit)];
    let kind = curve_kind(hit.instance);
    let is_ribbon = (kind & IS_RIBBON) != 0u;
    let points = control_points(curve, kind);
    let a = control_ball(points.x, kind);
    let b = control_ball(points.y, kind) - a;
    // Relative to the first point.
    let away = a.xyz - vector_object(hit.instance, ray.origin - point_world(hit.instance, vec3(0.0)));
    let direction = vector_object(hit.instance, ray.direction);
    let near = hit.t * direction - away;
    var u = hit.u;
    var weights = vec4(1.0 - u, u, 0.0, 0.0);
    var slope = b.xyz;
    var center = vec4(u * b.xyz, a.w + u * b.w);
    if (kind & IS_CUBIC) != 0u {
        let c = control_ball(points.z, kind) - a;
        let d = control_ball(points.w, kind) - a;
        let v = 1.0 - u;
        weights = vec4(v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u);
        center = weights.y * b + weights.z * c + weights.w * d + vec4(0.0, 0.0, 0.0, a.w);
        slope = 3.0 * (v * v * b + 2.0 * u * v * (c - b) + u * u * (d - c)).xyz;
    } else if !is_ribbon {
        // The position is rounded: the one of the ball that touches a cone at the point is computed again.
        let square = dot(b.xyz, b.xyz) - b.w * b.w;
        if square > 0.0 && u > 0.0 && u < 1.0 {
            u = clamp((dot(near, b.xyz) + a.w * b.w) / square, 0.0, 1.0);
        }
        weights = vec4(1.0 - u, u, 0.0, 0.0);
        center = vec4(u * b.xyz, a.w + u * b.w);
    }
    let radius = center.w;
    let off = near - center.xyz;
    let right = unit(cross(direction, slope));
    let outward_of_tube = select(unit(off), vec3(0.0, 0.0, 1.0), all(off == vec3(0.0)));
    var outward_object = outward_of_tube;
    var point = center.xyz + outward_of_tube * radius;
    var across = 0.5 + 0.5 * dot(outward_of_tube, right);
    if is_ribbon {
        point = center.xyz + off - direction * (dot(off, direction) / max(dot(direction, direction), 1e-36));
        // A disk faces the ray.
        outward_object = select(cross(unit(slope), right), -unit(direction), all(right == vec3(0.0)));
        across = hit.v;
    }
    var offset = 0.0;
    if is_ribbon {
        offset = size(vector_world(hit.instance, right * radius));
        if materials[curve.material & 0x7fffffffu].hair != NO_HAIR {
            // Hair scatters as the fiber that has this silhouette.
            let sine = 2.0 * across - 1.0;
            let facing_ray = select(outward_object, -outward_object, dot(outward_object, direction) > 0.0);
            outward_object = sine * right + sqrt(max(1.0 - sine * sine, 0.0)) * unit(facing_ray);
        }
    }
    let position = point_world(hit.instance, a.xyz + point);
    // The cofactors of a mirroring transform turn normals around.
    let image = normal_world(hit.instance, outward_object) * select(1.0, -1.0, mirrors(hit.instance));
    let outward = select(image, -unit(ray.direction), all(image == vec3(0.0)));
    let normal = select(outward, -outward, dot(outward, ray.direction) > 0.0);
    curve_along = vector_world(hit.instance, slope);
    curve_width = 2.0 * vector_world(hit.instance, right * radius);
    curve_part = curve.area_root - curve.normal.z;
    curve_uv = vec2(curve.normal.z + u * curve_part, across);
    var tint = vec3(1.0);
    if COLOR != 0u {
        tint = blend_three(points.xyz, weights.xyz, COLOR) + weights.w * three_of(points.w, COLOR);
    }
    let arrived = grown(cone, hit.t * size(ray.direction));
    // Textures are filtered in the plane of axis and width; where there is none, in one so large that a texel is enough.
    let plane = cross(curve_along, curve_width);
    let breadth = select(sqrt(size(plane)), MAX_QUOTIENT, all(plane == vec3(0.0)));
    let facing = select(unit(plane), normal, all(plane == vec3(0.0)));
    let lookup = TextureLookup(curve.vertices, vec3(1.0 - u, u, 0.0), hit.instance, facing, breadth, unit(ray.direction), arrived);
    let material = curve.material & 0x7fffffffu;
    return Surface(
        position,
        normal,
        normal,
        SmoothSurface(position, normal),
        is_ribbon || hit.v < 0.5,
        materials[material].base_color * texel(materials[material].base_color_slot, lookup).rgb * tint,
        materials[material].emission * texel(materials[material].emission_slot, lookup).rgb,
        slack_of(hit.instance) * (abs(normal.x) + abs(normal.y) + abs(normal.z)) + offset,
        arrived,
        material,
        lookup,
    );
}

/// The coordinates of a hit whose alpha is looked up: tubes have it in the middle of `v`.
fn alpha_coordinates(hit: Hit, curve: Triangle) -> vec2<f32> {
    let is_ribbon = (curve_kind(hit.instance) & IS_RIBBON) != 0u;
    return vec2(curve.normal.z + hit.u * (curve.area_root - curve.normal.z), select(0.5, hit.v, is_ribbon));
}
