// Surfaces of bicubic patches in pictures, in scenes of triangles, of curves of every kind, and of patches; twin of
// crates/renderer/src/surface/curve.rs.
//
// A patch is a `Triangle` whose vertices are its first control point, its last one, and the first again; the 16 control points are vertices
// one after another, and what is at shutter closing are columns of them, as of curves. Its `normal` is 0 and its `area_root` 1, as of a curve
// that is a strand of its own.

// choice shapes/patches
// Scenes of triangles, of curves of every kind, and of patches.
// use shared/surface_kinds/curves

/// Bit of the kind of an instance, as in shared/patch.
const IS_SHEET: u32 = 32u;

/// A point of a patch, and what is around it. Object space.
struct SheetPoint {
    position: vec3<f32>,
    by_u: vec3<f32>,
    by_v: vec3<f32>,
    /// Linear RGB.
    color: vec3<f32>,
    /// Of the front.
    normal: vec3<f32>,
}

/// The surface at a hit of a ray with this cone at its origin.
fn surface_at(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    let kind = curve_kind(hit.instance);
    if (kind & IS_SHEET) != 0u {
        return sheet_surface(hit, ray, cone);
    }
    if kind != 0u {
        return curve_surface(hit, ray, cone);
    }
    return triangle_surface(hit, ray.direction, cone);
}

/// Prepares the coordinates of a hit whose alpha is looked up.
fn prepare_alpha(hit: Hit, curve: Triangle) {
    if (curve_kind(hit.instance) & IS_SHEET) != 0u {
        curve_uv = vec2(hit.u, hit.v);
    } else {
        curve_uv = alpha_coordinates(hit, curve);
    }
}

/// A point of a face at a hit, and the normal of its front.
fn object_face_at(hit: Hit, triangle: Triangle) -> SmoothSurface {
    let kind = curve_kind(hit.instance);
    if (kind & IS_SHEET) == 0u {
        return SmoothSurface(position_of(triangle.vertices.x), triangle.normal);
    }
    let point = sheet_point(triangle.vertices.x, kind, vec2(hit.u, hit.v));
    return SmoothSurface(point.position, point.normal);
}

/// Bernstein polynomials and their derivatives.
fn sheet_weights(s: f32) -> mat2x4<f32> {
    let r = 1.0 - s;
    return mat2x4(
        vec4(r * r * r, 3.0 * s * r * r, 3.0 * s * s * r, s * s * s),
        vec4(-3.0 * r * r, 3.0 * r * (1.0 - 3.0 * s), 3.0 * s * (2.0 - 3.0 * s), 3.0 * s * s),
    );
}

/// One of four numbers, without an index, for which compilers unroll loops.
fn one_of(numbers: vec4<f32>, k: u32) -> f32 {
    return dot(numbers, select(vec4(0.0), vec4(1.0), vec4(0u, 1u, 2u, 3u) == vec4(k)));
}

/// The point at parameters of the patch whose control points start at a vertex. Where the surface has no normal, at a collapsed edge or a cusp,
/// it is that a little nearer to the middle of the patch. One loop around the control points, because compilers repeat what is called twice.
fn sheet_point(first: u32, kind: u32, at: vec2<f32>) -> SheetPoint {
    let origin = control_ball(first, kind).xyz;
    var point = SheetPoint(vec3(0.0), vec3(0.0), vec3(0.0), vec3(1.0), vec3(0.0, 0.0, 1.0));
    // Each step to the middle is sixteen times as long as the one before.
    var share = 0.0;
    for (var i = 0u; i < 6u; i += 1u) {
        let near = at + share * (vec2(0.5) - at);
        let of_u = sheet_weights(near.x);
        let of_v = sheet_weights(near.y);
        // Relative to the first control point.
        var position = vec3(0.0);
        var by_u = vec3(0.0);
        var by_v = vec3(0.0);
        var color = vec3(0.0);
        for (var k = 0u; k < 16u; k += 1u) {
            let control = control_ball(first + k, kind).xyz - origin;
            let weight_u = one_of(of_u[0], k >> 2u);
            let weight_v = one_of(of_v[0], k & 3u);
            position += (weight_u * weight_v) * control;
            by_u += (one_of(of_u[1], k >> 2u) * weight_v) * control;
            by_v += (weight_u * one_of(of_v[1], k & 3u)) * control;
            if COLOR != 0u {
                color += (weight_u * weight_v) * three_of(first + k, COLOR);
            }
        }
        if i == 0u {
            point.position = position + origin;
            point.by_u = by_u;
            point.by_v = by_v;
            if COLOR != 0u {
                point.color = color;
            }
        }
        let normal = cross(unit(by_u), unit(by_v));
        // More than the roundings of both.
        if max(abs(normal.x), max(abs(normal.y), abs(normal.z))) > 1e-5 {
            point.normal = unit(normal);
            break;
        }
        share = max(16.0 * share, 0x1p-20f);
    }
    return point;
}

/// The surface of a patch.
fn sheet_surface(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    let entry = triangles[triangle_of(hit)];
    let kind = curve_kind(hit.instance);
    let at = vec2(hit.u, hit.v);
    let point = sheet_point(entry.vertices.x, kind, at);
    let position = point_world(hit.instance, point.position);
    // The cofactors of a mirroring transform turn normals around.
    let image = normal_world(hit.instance, point.normal) * select(1.0, -1.0, mirrors(hit.instance));
    let outward = select(image, -unit(ray.direction), all(image == vec3(0.0)));
    let is_front = dot(outward, ray.direction) <= 0.0;
    let normal = select(-outward, outward, is_front);
    curve_along = vector_world(hit.instance, point.by_u);
    curve_width = vector_world(hit.instance, point.by_v);
    curve_part = 1.0;
    curve_uv = at;
    let arrived = grown(cone, hit.t * size(ray.direction));
    // Textures are filtered in the plane of both derivatives; where there is none, in one so large that a texel is enough.
    let plane = cross(curve_along, curve_width);
    let breadth = select(sqrt(size(plane)), MAX_QUOTIENT, all(plane == vec3(0.0)));
    let facing = select(unit(plane), normal, all(plane == vec3(0.0)));
    let lookup = TextureLookup(entry.vertices, vec3(1.0 - hit.u, hit.u, 0.0), hit.instance, facing, breadth, unit(ray.direction), arrived);
    let material = entry.material & 0x7fffffffu;
    return Surface(
        position,
        normal,
        normal,
        SmoothSurface(position, normal),
        is_front,
        materials[material].base_color * texel(materials[material].base_color_slot, lookup).rgb * point.color,
        materials[material].emission * texel(materials[material].emission_slot, lookup).rgb,
        slack_of(hit.instance) * (abs(normal.x) + abs(normal.y) + abs(normal.z)),
        arrived,
        material,
        lookup,
    );
}
