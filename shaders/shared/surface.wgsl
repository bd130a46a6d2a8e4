// What a hit shows: the point, its normals, its material. World space; the twin of the CPU's `Surfaces`, in f32.
//
// `?placed` says where meshes are: one instance, many in one level, or many in two; `?texture` what textures say; `?normal` the
// normal to shade with.
// use shared/cone
// use shared/mesh
// use shared/numbers
// use shared/ray
// use shared/vector
// use ?placed
// use ?normal
// use ?texture

struct Material {
    base_color: vec3<f32>,
    /// Factor of alpha.
    alpha: f32,
    emission: vec3<f32>,
    /// Least alpha of what is present; above 1 where alpha is a probability, below 0 where there is no alpha.
    cutoff: f32,
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    thin_walled: u32,
    normal_scale: f32,
    /// Numbers of the textures' slots, `NO_SLOT` for none.
    base_color_slot: u32,
    rough_metal_slot: u32,
    transmission_slot: u32,
    normal_slot: u32,
    emission_slot: u32,
    alpha_slot: u32,
}

const NO_SLOT: u32 = 0xffffffffu;

@group(2) @binding(0) var<storage, read> materials: array<Material>;

/// A point of a surface, ready for shading.
struct Surface {
    position: vec3<f32>,
    /// Unit normal of the triangle, on the side that the ray came from.
    normal: vec3<f32>,
    /// Unit normal to shade with, on that side too.
    shading_normal: vec3<f32>,
    /// Whether the ray came from the side from which the triangle runs counter-clockwise, in object space.
    is_front: bool,
    base_color: vec3<f32>,
    emission: vec3<f32>,
    /// Distance that new rays keep off the triangle's plane.
    offset: f32,
    /// The cone of the ray, where it arrived.
    cone: Cone,
    material: u32,
    /// What textures are asked with.
    seen: Seen,
}

/// The surface at a hit of a ray along `direction`, of any length, whose cone at its origin is `cone`.
fn surface_at(hit: Hit, direction: vec3<f32>, cone: Cone) -> Surface {
    let triangle = triangles[triangle_of(hit)];
    let weights = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    let winding = normal_world(hit.instance, triangle.normal);
    // Triangles without area are not hit; for one that is, facing the viewer is a harmless answer.
    let either = select(winding, -unit(direction), all(winding == vec3(0.0)));
    let normal = select(either, -either, dot(either, direction) > 0.0);
    let is_mirrored = ((triangle.material >> 31u) == 1u) != mirrors(hit.instance);
    let material = triangle.material & 0x7fffffffu;
    let arrived = grown(cone, hit.t * size(direction));
    let breadth = area_root(hit.instance, triangle);
    let seen = Seen(triangle.vertices, weights, hit.instance, winding, breadth, unit(direction), arrived);
    let tint = vertex_color(triangle.vertices, weights).rgb;
    return Surface(
        point_world(hit.instance, blend_positions(triangle.vertices, weights)),
        normal,
        shading_normal(material, seen, normal, is_mirrored),
        (dot(winding, direction) <= 0.0) != is_mirrored,
        materials[material].base_color * texel(materials[material].base_color_slot, seen).rgb * tint,
        materials[material].emission * texel(materials[material].emission_slot, seen).rgb,
        slack_of(hit.instance) * (abs(normal.x) + abs(normal.y) + abs(normal.z)),
        arrived,
        material,
        seen,
    );
}

/// What a hit asks textures with.
struct Seen {
    vertices: vec3<u32>,
    /// Of the point between the vertices.
    weights: vec3<f32>,
    instance: u32,
    /// Unit normal of the triangle, on the side from which it runs counter-clockwise.
    winding: vec3<f32>,
    /// Root of twice the area of the triangle in world space.
    area_root: f32,
    /// Unit vector along the ray.
    direction: vec3<f32>,
    /// The ray's, where it hits.
    cone: Cone,
}

/// A ray without end that leaves along `direction`, on the side of the triangle to which `direction` points.
fn spawn_ray(surface: Surface, direction: vec3<f32>) -> Ray {
    return towards(surface, direction, false);
}

/// A ray that leaves along `goal`, or where `is_place` one that ends short of the place `goal`: its direction spans the whole way,
/// its `t_max` stays below 1, and below 0 where `goal` is too close to tell apart.
///
/// The gap is the distance that rays keep off this surface, so that a surface through `goal` does not count, and eight roundings
/// of the way.
fn towards(surface: Surface, goal: vec3<f32>, is_place: bool) -> Ray {
    let direction = select(goal, goal - surface.position, is_place);
    let side = with_sign(surface.offset, dot(surface.normal, direction));
    let origin = surface.position + surface.normal * side;
    let way = select(goal, goal - origin, is_place);
    let gap = surface.offset / max(size(way), 1e-30) + 8.0 * 0x1p-23f;
    return Ray(origin, 0.0, way, select(FAR, 1.0 - gap, is_place));
}

/// Turns `direction` to the outer side of the triangle, by mirroring it where shading normal and triangle disagree about it.
fn mirror_outward(surface: Surface, direction: vec3<f32>) -> vec3<f32> {
    return direction - surface.normal * (2.0 * min(dot(surface.normal, direction), 0.0));
}
