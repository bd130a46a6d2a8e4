// Surface at a hit: point, normals, material. World space; twin of the CPU's `Surfaces`, in f32.
//
// `?placed` locates meshes: one instance, several in one level, or several in two. `?shapes` are triangles, or also curves. `?texture` looks up
// textures, `?normal` gives the shading normal.
// use shared/cone
// use shared/surface/mesh
// use shared/numbers
// use shared/ray
// use shared/vector
// use ?placed
// use ?shapes
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
    /// Whether rays pass one of its sides.
    single_sided: u32,
    /// Index of the hair on curves; `NO_HAIR` for other materials.
    hair: u32,
}

const NO_SLOT: u32 = 0xffffffffu;

const NO_HAIR: u32 = 0xffffffffu;

@group(2) @binding(0) var<storage, read> materials: array<Material>;

/// A surface point, ready for shading.
struct Surface {
    position: vec3<f32>,
    /// Unit normal of the triangle on the side of the ray.
    normal: vec3<f32>,
    /// Unit shading normal on the same side.
    shading_normal: vec3<f32>,
    /// The surface that vertex normals describe, where it bulges out of the triangle, else the point and `normal`.
    smooth_surface: SmoothSurface,
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

/// A point of a surface, and its unit normal on the side of the ray.
struct SmoothSurface {
    position: vec3<f32>,
    normal: vec3<f32>,
}

/// The surface of a triangle at a hit of a ray along `direction`, of any length, with this cone at its origin.
fn triangle_surface(hit: Hit, direction: vec3<f32>, cone: Cone) -> Surface {
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
    let position = point_world(hit.instance, blend_positions(triangle.vertices, weights));
    var smooth_surface = SmoothSurface(position, normal);
    if materials[material].transmission == 0.0 {
        smooth_surface = bulge(lookup, position, normal);
    }
    return Surface(
        position,
        normal,
        shading_normal(material, lookup, normal, is_mirrored),
        smooth_surface,
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
    var start = SmoothSurface(surface.position, surface.normal);
    if dot(surface.normal, direction) < 0.0 && dot(surface.smooth_surface.normal, direction) > 0.0 {
        // Between the horizons of the triangle and of the smooth surface.
        start = surface.smooth_surface;
    }
    let side = with_sign(surface.offset, dot(start.normal, direction));
    let origin = start.position + start.normal * side;
    let delta = select(goal, goal - origin, is_point);
    let gap = surface.offset / max(size(delta), 1e-30) + 8.0 * 0x1p-23f;
    return Ray(origin, 0.0, delta, select(FAR, 1.0 - gap, is_point));
}

/// Mirrors `direction` to the outer side of the surface if shading normal and horizon disagree about it.
fn mirror_outward(surface: Surface, direction: vec3<f32>) -> vec3<f32> {
    let horizon = surface.smooth_surface.normal;
    return direction - horizon * (2.0 * min(dot(horizon, direction), 0.0));
}

// choice shapes/triangles
// Scenes of triangles.
// use shared/surface/faces

/// The surface at a hit of a ray with this cone at its origin.
fn surface_at(hit: Hit, ray: Ray, cone: Cone) -> Surface {
    return triangle_surface(hit, ray.direction, cone);
}

fn prepare_alpha(hit: Hit, triangle: Triangle) {}

// part faces
// Faces of triangles, which alone may be single-sided: curves have none.
// use shared/surface/mesh

/// A point of the plane of a triangle, and its normal.
fn object_face_at(hit: Hit, triangle: Triangle) -> SmoothSurface {
    return SmoothSurface(position_of(triangle.vertices.x), triangle.normal);
}

// part mesh
// Triangles and vertices. Only the attributes that the scene has are stored, in columns of `STRIDE` words. `COLOR` and similar
// constants are the first column of an attribute; 0 means absent, because positions come first.
// const STRIDE
// const COLOR

struct Triangle {
    vertices: vec3<u32>,
    /// Index of the material; the highest bit is set if a flattened instance mirrors.
    material: u32,
    /// Unit normal, from which the triangle is counter-clockwise; zero if it has no area.
    normal: vec3<f32>,
    /// Square root of twice the area.
    area_root: f32,
}

@group(2) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(2) @binding(2) var<storage, read> vertices: array<f32>;

fn position_of(vertex: u32) -> vec3<f32> {
    return three_of(vertex, 0u);
}

/// Three words of a vertex, starting at `column`.
fn three_of(vertex: u32, column: u32) -> vec3<f32> {
    let first = vertex * STRIDE + column;
    return vec3(vertices[first], vertices[first + 1u], vertices[first + 2u]);
}

fn blend_positions(corners: vec3<u32>, weights: vec3<f32>) -> vec3<f32> {
    return blend_three(corners, weights, 0u);
}

fn blend_three(corners: vec3<u32>, weights: vec3<f32>, column: u32) -> vec3<f32> {
    return weights.x * three_of(corners.x, column) + weights.y * three_of(corners.y, column) + weights.z * three_of(corners.z, column);
}

/// Vectors from the first vertex to the second and third.
fn edges(corners: vec3<u32>) -> mat2x3<f32> {
    let first = position_of(corners.x);
    return mat2x3(position_of(corners.y) - first, position_of(corners.z) - first);
}

/// Interpolated vertex color and alpha; white if absent.
fn vertex_color(corners: vec3<u32>, weights: vec3<f32>) -> vec4<f32> {
    if COLOR == 0u {
        return vec4(1.0);
    }
    let at = COLOR + 3u;
    let alpha = vec3(vertices[corners.x * STRIDE + at], vertices[corners.y * STRIDE + at], vertices[corners.z * STRIDE + at]);
    return vec4(blend_three(corners, weights, COLOR), dot(weights, alpha));
}

// part placed/world
// Vertices in world space.
// use shared/picture

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    return point;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return vector;
}

/// The inverse of `vector_world`.
fn vector_object(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return vector;
}

/// The kind of the curves of an instance; 0 for triangles.
fn curve_kind(instance: u32) -> u32 {
    return 0u;
}

/// Unit normal of the transformed plane; zero for zero.
fn normal_world(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return unit(normal);
}

fn area_root(instance: u32, triangle: Triangle) -> f32 {
    return triangle.area_root;
}

/// Whether the instance mirrors and its vertices are not yet mirrored.
fn mirrors(instance: u32) -> bool {
    return false;
}

/// Error along each axis between the plane of a triangle and a ray that leaves it.
fn slack_of(instance: u32) -> f32 {
    return picture.slack;
}

// part placed/placement
// Instances of meshes in object space, at shutter opening.

struct Placement {
    /// Columns of the linear part. The interleaved fields are: the error along each axis between the plane of a triangle and a
    /// ray that leaves it; -1 if the transform mirrors; and the first triangle of the mesh.
    x: vec3<f32>,
    slack: f32,
    y: vec3<f32>,
    handedness: f32,
    z: vec3<f32>,
    first_triangle: u32,
    shift: vec3<f32>,
    /// Square root of the divisor that keeps cofactors in range; areas scale with its square.
    scale_root: f32,
    /// Columns of the cofactor matrix, divided by it.
    cofactor_x: vec3<f32>,
    /// Index of the motion; `NONE` if the instance does not move.
    motion: u32,
    cofactor_y: vec3<f32>,
    /// The kind of the curves of the mesh; 0 for triangles.
    curve_kind: u32,
    cofactor_z: vec3<f32>,
}

@group(2) @binding(3) var<storage, read> placements: array<Placement>;

fn triangle_of(hit: Hit) -> u32 {
    return placements[hit.instance].first_triangle + hit.primitive;
}

/// Unit normal of the transformed plane, on the side given by the cofactors; zero for zero.
fn normal_world(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return unit(by_cofactors(instance, normal));
}

/// Whether the instance mirrors.
fn mirrors(instance: u32) -> bool {
    return placements[instance].handedness < 0.0;
}

/// The kind of the curves of an instance, as in shared/curve; 0 for triangles.
fn curve_kind(instance: u32) -> u32 {
    return placements[instance].curve_kind;
}

/// The inverse of `vector_world`, by cofactors over the determinant.
fn vector_object(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    let x = by_cofactors(instance, vec3(1.0, 0.0, 0.0));
    let y = by_cofactors(instance, vec3(0.0, 1.0, 0.0));
    let z = by_cofactors(instance, vec3(0.0, 0.0, 1.0));
    return vec3(dot(vector, x), dot(vector, y), dot(vector, z)) / dot(vector_world(instance, vec3(1.0, 0.0, 0.0)), x);
}

/// Error along each axis between the plane of a triangle and a ray that leaves it.
fn slack_of(instance: u32) -> f32 {
    return placements[instance].slack;
}

fn area_root(instance: u32, triangle: Triangle) -> f32 {
    return triangle.area_root * placements[instance].scale_root * sqrt(size(by_cofactors(instance, triangle.normal)));
}

// choice placed/single
// A single instance.
// use shared/surface/placed/world

fn triangle_of(hit: Hit) -> u32 {
    return hit.primitive;
}

// choice placed/flat
// Instances in world space, numbered as in the BVH over all of them.
// use shared/surface/placed/world

/// First triangle of each instance.
@group(2) @binding(3) var<storage, read> firsts: array<u32>;

fn triangle_of(hit: Hit) -> u32 {
    return firsts[hit.instance] + hit.primitive;
}

// choice placed/instances
// Instances of meshes that do not move.
// use shared/surface/placed/placement

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    return vector_world(instance, point) + placements[instance].shift;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return placements[instance].x * vector.x + placements[instance].y * vector.y + placements[instance].z * vector.z;
}

fn by_cofactors(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return placements[instance].cofactor_x * normal.x + placements[instance].cofactor_y * normal.y
        + placements[instance].cofactor_z * normal.z;
}

// choice placed/moving
// Instances of meshes, some of which move, at the time of the ray.
// use shared/motion
// use shared/surface/placed/placement

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    let motion = motion_of(instance);
    var shift = placements[instance].shift;
    if motion != NONE {
        shift = between(shift, motions[motion].shift);
    }
    return vector_world(instance, point) + shift;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    var linear = mat3x3<f32>(placements[instance].x, placements[instance].y, placements[instance].z);
    let motion = motion_of(instance);
    if motion != NONE {
        linear[0] = between(linear[0], motions[motion].x);
        linear[1] = between(linear[1], motions[motion].y);
        linear[2] = between(linear[2], motions[motion].z);
    }
    return linear[0] * vector.x + linear[1] * vector.y + linear[2] * vector.z;
}

fn by_cofactors(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    var x = placements[instance].cofactor_x;
    var y = placements[instance].cofactor_y;
    var z = placements[instance].cofactor_z;
    let motion = motion_of(instance);
    if motion != NONE {
        // Divided by a factor with the determinant's sign.
        let weights = weights_of_time() * placements[instance].handedness;
        x = motions[motion].cofactors[0] * weights;
        y = motions[motion].cofactors[1] * weights;
        z = motions[motion].cofactors[2] * weights;
    }
    return x * normal.x + y * normal.y + z * normal.z;
}

/// Index of an instance's motion; `NONE` if it does not move.
fn motion_of(instance: u32) -> u32 {
    return placements[instance].motion;
}

// part normal/vertex
// Vertex normals.
// const NORMAL

/// Interpolated unit normal; zero if absent.
fn smooth_normal(lookup: TextureLookup) -> vec3<f32> {
    if NORMAL == 0u {
        return vec3(0.0);
    }
    return normal_world(lookup.instance, blend_three(lookup.vertices, lookup.weights, NORMAL));
}

/// How far the planes of the vertices must lie above a point in the mean, relative to their mean distance from it.
const MIN_BULGE: f32 = 1.0 / 1024.0;

/// The smooth surface over a point of the triangle with this normal on the viewer's side; twin of the CPU's `smooth_surface`.
fn bulge(lookup: TextureLookup, position: vec3<f32>, normal: vec3<f32>) -> SmoothSurface {
    let none = SmoothSurface(position, normal);
    let smooth_one = smooth_normal(lookup);
    let side = select(1.0, -1.0, dot(smooth_one, normal) < 0.0);
    if NORMAL == 0u || side * dot(smooth_one, lookup.direction) >= 0.0 {
        return none;
    }
    // Relative to the point, so that far from the origin it does not round.
    var raised = vec3(0.0);
    var height = 0.0;
    var size_of_all = 0.0;
    for (var k = 0u; k < 3u; k++) {
        let vertex = lookup.vertices[k];
        let of_vertex = side * normal_world(lookup.instance, three_of(vertex, NORMAL));
        if dot(of_vertex, normal) <= 0.0 {
            return none;
        }
        let above = lookup.weights[k] * dot(point_world(lookup.instance, position_of(vertex)) - position, of_vertex);
        height += above;
        size_of_all += abs(above);
        raised += max(above, 0.0) * of_vertex;
    }
    if height <= MIN_BULGE * size_of_all {
        return none;
    }
    return SmoothSurface(position + raised, side * smooth_one);
}

/// The interpolated normal on the viewer's side; `normal` of the triangle if it faces away from the viewer.
fn facing_smooth_normal(blended: vec3<f32>, lookup: TextureLookup, normal: vec3<f32>) -> vec3<f32> {
    let facing = select(blended, -blended, dot(blended, normal) < 0.0);
    return select(normal, facing, dot(facing, lookup.direction) < 0.0);
}

// choice normal/flat
// Flat shading: the normal of the triangle.

fn bulge(lookup: TextureLookup, position: vec3<f32>, normal: vec3<f32>) -> SmoothSurface {
    return SmoothSurface(position, normal);
}

fn shading_normal(material: u32, lookup: TextureLookup, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return normal;
}

// choice normal/smooth
// Smooth shading by interpolated normals.
// use shared/surface/normal/vertex

fn shading_normal(material: u32, lookup: TextureLookup, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return facing_smooth_normal(smooth_normal(lookup), lookup, normal);
}

// choice normal/mapped
// Smooth shading and normal maps; twin of the CPU's `shading_normal`.
// use shared/surface/normal/vertex
// const TANGENT

fn shading_normal(material: u32, lookup: TextureLookup, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    let blended = smooth_normal(lookup);
    // Cofactors flip normals if the transform mirrors.
    let side = select(1.0, -1.0, is_mirrored);
    let outward = side * select(blended, lookup.winding, all(blended == vec3(0.0)));
    let perturbed = mapped_normal(material, lookup, outward, side);
    if all(perturbed == vec3(0.0)) {
        return facing_smooth_normal(blended, lookup, normal);
    }
    return lifted(select(perturbed, -perturbed, dot(outward, normal) < 0.0), normal, -lookup.direction);
}

/// The mapped normal for the unit normal `outward`; zero if there is no map or no tangent frame.
fn mapped_normal(material: u32, lookup: TextureLookup, outward: vec3<f32>, side: f32) -> vec3<f32> {
    let slot = materials[material].normal_slot;
    if slot == NO_SLOT {
        return vec3(0.0);
    }
    var u = vec3(0.0);
    var v = vec3(0.0);
    if TANGENT != 0u {
        u = orthonormal(vector_world(lookup.instance, blend_three(lookup.vertices, lookup.weights, TANGENT)), outward);
        v = cross(outward, u) * (side * with_sign(1.0, tangent_sign(lookup)));
    }
    if all(u == vec3(0.0)) {
        let changes = uv_edges(slot, lookup);
        let world = edges(lookup.vertices);
        let first = vector_world(lookup.instance, world[0]);
        let second = vector_world(lookup.instance, world[1]);
        // Only the sign of the determinant matters, not the lengths. If it is zero there are no gradients.
        let turn = sign(determinant(changes));
        u = turn * orthonormal(first * changes[1].y - second * changes[0].y, outward);
        let along_v = turn * (second * changes[0].x - first * changes[1].x);
        let across = cross(outward, u);
        v = select(across, -across, dot(across, along_v) < 0.0);
    }
    if all(u == vec3(0.0)) {
        return vec3(0.0);
    }
    let sampled = 2.0 * texel(slot, lookup).xyz - 1.0;
    let slope = materials[material].normal_scale * sampled.xy;
    return unit(u * slope.x + v * slope.y + outward * sampled.z);
}

/// Sign of the bitangent.
fn tangent_sign(lookup: TextureLookup) -> f32 {
    let at = TANGENT + 3u;
    let corners = lookup.vertices * STRIDE + at;
    return dot(lookup.weights, vec3(vertices[corners.x], vertices[corners.y], vertices[corners.z]));
}

/// The unit vector along `v` without its component along the unit vector `normal`.
fn orthonormal(v: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let direction = unit(v);
    return unit(direction - normal * dot(direction, normal));
}

/// The unit normal closest to `perturbed` that faces the viewer and reflects the view direction away from the surface.
fn lifted(perturbed: vec3<f32>, normal: vec3<f32>, towards_viewer: vec3<f32>) -> vec3<f32> {
    let cosine = dot(perturbed, towards_viewer);
    if cosine <= 0.0 {
        return normal;
    }
    let mirrored = perturbed * (2.0 * cosine) - towards_viewer;
    let height = dot(mirrored, normal);
    if height >= 0.0 {
        return perturbed;
    }
    let raised = unit(towards_viewer + (mirrored - normal * height));
    return select(raised, normal, all(raised == vec3(0.0)));
}

// part vertex
// A path vertex with the frame of its BSDF. Directions on which shading normal and horizon disagree are mirrored at the horizon;
// a direction receives both its own scattering and that of the mirrored one.
//
// `?material` reads the parameters of `?bsdf`.
// use shared/sampling
// use shared/surface
// use shared/invocation/iterations
// use ?bsdf
// use ?material

struct Vertex {
    bsdf: Bsdf,
    /// Columns are the axes of the frame.
    basis: mat3x3<f32>,
    /// Unit vector towards the viewer, in that frame.
    outgoing: vec3<f32>,
    /// Unit normal of the horizon.
    normal: vec3<f32>,
    /// Whether the frame's normal differs from it.
    is_perturbed: bool,
}

fn vertex_of(surface: Surface) -> Vertex {
    let viewer = -surface.lookup.direction;
    // If the shading normal faces away from the viewer, the triangle's normal is used.
    let faces = dot(surface.shading_normal, viewer) > 0.0;
    let normal = select(surface.normal, surface.shading_normal, faces);
    let basis = frame_about(surface, normal);
    let horizon = surface.smooth_surface.normal;
    return Vertex(bsdf_of(surface), basis, viewer * basis, horizon, any(normal != horizon));
}

/// Scattering of a world-space direction, including its mirrored direction.
fn evaluate(vertex: Vertex, to_light: vec3<f32>) -> Evaluation {
    let height = dot(vertex.normal, to_light);
    var local = to_light * vertex.basis;
    var sum = no_evaluation();
    // One call site, because the code is large. A direction is used as it is where horizon and frame agree on its side, and
    // mirrored otherwise.
    for (var i = 0u; i < 2u; i++) {
        iterations += 1u;
        if !vertex.is_perturbed || local.z * height > 0.0 {
            let found = evaluate_bsdf(vertex.bsdf, vertex.outgoing, local);
            sum = Evaluation(sum.value + found.value, sum.density + found.density);
        }
        if !vertex.is_perturbed {
            break;
        }
        local = in_plane_mirrored(vertex, to_light) * vertex.basis;
    }
    return sum;
}

/// A sampled local direction in world space, on the same side of the horizon as in the frame.
fn world_direction(vertex: Vertex, incident: vec3<f32>) -> vec3<f32> {
    let direction = vertex.basis * incident;
    let agrees = !vertex.is_perturbed || incident.z * dot(vertex.normal, direction) >= 0.0;
    return select(in_plane_mirrored(vertex, direction), direction, agrees);
}

/// A direction mirrored at the horizon.
fn in_plane_mirrored(vertex: Vertex, direction: vec3<f32>) -> vec3<f32> {
    return direction - vertex.normal * (2.0 * dot(vertex.normal, direction));
}

// part plain_frame
// Frames of BSDFs that are the same in all directions about the normal.
// use shared/sampling

/// The frame of the BSDF about a unit normal.
fn frame_about(surface: Surface, normal: vec3<f32>) -> mat3x3<f32> {
    return basis_about(normal);
}

// choice material/full
// Materials with all parameters and textures.
// use shared/surface/parameters
// use shared/surface/plain_frame

fn bsdf_of(surface: Surface) -> Bsdf {
    return bsdf_of_parameters(surface);
}

// choice material/hair
// Materials with all parameters and textures, and hair on curves.
// use shared/surface
// use shared/surface/parameters
// use shared/surface_curve/along
// use shared/fiber
// use shared/sampling

/// Hair of a material.
struct HairMaterial {
    /// Absorption per radius, where the color does not give it.
    absorption: vec3<f32>,
    roughness: f32,
    roughness_around: f32,
    tilt_rad: f32,
    ior: f32,
    /// Divisor of the logarithm of the color that gives the absorption; 0 where it does not.
    of_color: f32,
}

@group(2) @binding(10) var<storage, read> hairs: array<HairMaterial>;

/// The frame of the BSDF about a unit normal: its first axis is along a hair.
fn frame_about(surface: Surface, normal: vec3<f32>) -> mat3x3<f32> {
    let along = unit(curve_along);
    let x = unit(along - normal * dot(normal, along));
    if materials[surface.material].hair == NO_HAIR || all(x == vec3(0.0)) {
        return basis_about(normal);
    }
    return mat3x3<f32>(x, cross(normal, x), normal);
}

/// The parameters; of hair in `fiber`, and in the BSDF those of a sheet that transmits light.
fn bsdf_of(surface: Surface) -> Bsdf {
    let number = materials[surface.material].hair;
    fiber.is_on = number != NO_HAIR;
    var bsdf = bsdf_of_parameters(surface);
    if !fiber.is_on {
        return bsdf;
    }
    let hair = hairs[number];
    fiber.absorption = hair.absorption;
    if hair.of_color != 0.0 {
        let root = log(clamp(surface.base_color, vec3(1e-4), vec3(1.0))) / hair.of_color;
        fiber.absorption = root * root;
    }
    fiber.roughness = hair.roughness;
    fiber.roughness_around = hair.roughness_around;
    fiber.tilt_rad = hair.tilt_rad;
    fiber.ior = hair.ior;
    bsdf.roughness = 1.0;
    bsdf.transmission = 1.0;
    bsdf.thin_walled = true;
    bsdf.is_inside = false;
    return bsdf;
}

// part parameters
// All parameters of materials, and their textures.
// use shared/bsdf/scattering

fn bsdf_of_parameters(surface: Surface) -> Bsdf {
    let material = materials[surface.material];
    let rough_metal = texel(material.rough_metal_slot, surface.lookup);
    let transmission = material.transmission * texel(material.transmission_slot, surface.lookup).r;
    let thin_walled = material.thin_walled != 0u;
    return Bsdf(
        surface.base_color,
        material.metallic * rough_metal.b,
        material.roughness * rough_metal.g,
        material.specular,
        transmission,
        material.ior,
        thin_walled,
        !surface.is_front && transmission > 0.0 && !thin_walled,
    );
}

// choice material/lambert
// All materials are diffuse.
// use shared/bsdf/scattering
// use shared/surface/plain_frame

fn bsdf_of(surface: Surface) -> Bsdf {
    return Bsdf(surface.base_color, 0.0, 1.0, 0.0, 0.0, 1.5, false, false);
}

// part alpha
// Opacity of surfaces with alpha. `?alpha` reads the alpha texture.
// use shared/surface

/// Larger than any threshold: alpha is a probability of being hit.
const IS_BLENDED: f32 = 2.0;

/// Probability that a ray hits: alpha of a blended material, 0 or 1 otherwise.
fn presence(material: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    let cutoff = materials[material].cutoff;
    if cutoff < 0.0 {
        return 1.0;
    }
    let alpha = materials[material].alpha * alpha_of(materials[material].alpha_slot, corners, weights)
        * vertex_color(corners, weights).a;
    if cutoff < IS_BLENDED {
        return select(0.0, 1.0, alpha >= cutoff);
    }
    return alpha;
}

// choice alpha/plain
// No alpha texture.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    return 1.0;
}

// choice alpha/texture
// Alpha textures, always at full resolution: averaging would move the edge of the cut-out.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    if slot == NO_SLOT {
        return 1.0;
    }
    return texel_alpha(slot, corners, weights);
}
