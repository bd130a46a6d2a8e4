// Surface at a hit: point, normals, material. World space; twin of the CPU's `Surfaces`, in f32.
//
// `?placed` locates meshes: one instance, several in one level, or several in two. `?texture` looks up textures, `?normal`
// gives the shading normal.
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
    /// Alpha threshold; above 1 if alpha is a probability, negative without alpha.
    cutoff: f32,
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    thin_walled: u32,
    normal_scale: f32,
    /// Texture slots; `NO_SLOT` for none.
    base_color_slot: u32,
    rough_metal_slot: u32,
    transmission_slot: u32,
    normal_slot: u32,
    emission_slot: u32,
    alpha_slot: u32,
}

const NO_SLOT: u32 = 0xffffffffu;

@group(2) @binding(0) var<storage, read> materials: array<Material>;

/// A surface point, ready for shading.
struct Surface {
    position: vec3<f32>,
    /// Unit normal of the triangle on the side of the ray.
    normal: vec3<f32>,
    /// Unit shading normal on the same side.
    shading_normal: vec3<f32>,
    /// Whether the ray came from the side that sees the triangle counter-clockwise, in object space.
    is_front: bool,
    base_color: vec3<f32>,
    emission: vec3<f32>,
    /// Distance that new rays keep from the plane of the triangle.
    offset: f32,
    /// Cone of the ray at the hit.
    cone: Cone,
    material: u32,
    /// Input of texture lookups.
    lookup: TextureLookup,
}

/// The surface at a hit of a ray along `direction`, of any length, with this cone at its origin.
fn surface_at(hit: Hit, direction: vec3<f32>, cone: Cone) -> Surface {
    let triangle = triangles[triangle_of(hit)];
    let weights = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    let winding = normal_world(hit.instance, triangle.normal);
    // Triangles without area are not hit. If one were, facing the viewer is a safe result.
    let either = select(winding, -unit(direction), all(winding == vec3(0.0)));
    let normal = select(either, -either, dot(either, direction) > 0.0);
    let is_mirrored = ((triangle.material >> 31u) == 1u) != mirrors(hit.instance);
    let material = triangle.material & 0x7fffffffu;
    let arrived = grown(cone, hit.t * size(direction));
    let breadth = area_root(hit.instance, triangle);
    let lookup = TextureLookup(triangle.vertices, weights, hit.instance, winding, breadth, unit(direction), arrived);
    let tint = vertex_color(triangle.vertices, weights).rgb;
    return Surface(
        point_world(hit.instance, blend_positions(triangle.vertices, weights)),
        normal,
        shading_normal(material, lookup, normal, is_mirrored),
        (dot(winding, direction) <= 0.0) != is_mirrored,
        materials[material].base_color * texel(materials[material].base_color_slot, lookup).rgb * tint,
        materials[material].emission * texel(materials[material].emission_slot, lookup).rgb,
        slack_of(hit.instance) * (abs(normal.x) + abs(normal.y) + abs(normal.z)),
        arrived,
        material,
        lookup,
    );
}

/// Input of texture lookups at a hit.
struct TextureLookup {
    vertices: vec3<u32>,
    /// Barycentric weights.
    weights: vec3<f32>,
    instance: u32,
    /// Unit normal of the triangle, on the side that sees it counter-clockwise.
    winding: vec3<f32>,
    /// Square root of twice the area in world space.
    area_root: f32,
    /// Unit vector along the ray.
    direction: vec3<f32>,
    /// Cone of the ray at the hit.
    cone: Cone,
}

/// An infinite ray along `direction` that starts on the side of the triangle to which `direction` points.
fn spawn_ray(surface: Surface, direction: vec3<f32>) -> Ray {
    return towards(surface, direction, false);
}

/// A ray along `goal`, or if `is_point` one that ends just before the point `goal`. Its direction then spans the whole distance
/// and its `t_max` is below 1, or below 0 if `goal` is too close to distinguish.
///
/// The gap is the distance that rays keep from this surface, so that a surface through `goal` does not count, plus eight
/// roundings of the distance.
fn towards(surface: Surface, goal: vec3<f32>, is_point: bool) -> Ray {
    let direction = select(goal, goal - surface.position, is_point);
    let side = with_sign(surface.offset, dot(surface.normal, direction));
    let origin = surface.position + surface.normal * side;
    let delta = select(goal, goal - origin, is_point);
    let gap = surface.offset / max(size(delta), 1e-30) + 8.0 * 0x1p-23f;
    return Ray(origin, 0.0, delta, select(FAR, 1.0 - gap, is_point));
}

/// Mirrors `direction` to the outer side of the triangle if shading normal and triangle disagree about it.
fn mirror_outward(surface: Surface, direction: vec3<f32>) -> vec3<f32> {
    return direction - surface.normal * (2.0 * min(dot(surface.normal, direction), 0.0));
}
