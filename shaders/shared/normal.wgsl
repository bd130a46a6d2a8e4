// part vertex
// Vertex normals.
// const NORMAL

/// Interpolated unit normal; zero if absent.
fn smooth_normal(lookup: TextureLookup) -> vec3<f32> {
    if NORMAL == 0u {
        return vec3(0.0);
    }
    return normal_world(lookup.instance, blend_three(lookup.vertices, lookup.weights, NORMAL));
}

/// The interpolated normal on the viewer's side; `normal` of the triangle if it faces away from the viewer.
fn facing_smooth_normal(blended: vec3<f32>, lookup: TextureLookup, normal: vec3<f32>) -> vec3<f32> {
    let facing = select(blended, -blended, dot(blended, normal) < 0.0);
    return select(normal, facing, dot(facing, lookup.direction) < 0.0);
}

// choice flat
// Flat shading: the normal of the triangle.

fn shading_normal(material: u32, lookup: TextureLookup, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return normal;
}

// choice smooth
// Smooth shading by interpolated normals.
// use shared/normal/vertex

fn shading_normal(material: u32, lookup: TextureLookup, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return facing_smooth_normal(smooth_normal(lookup), lookup, normal);
}

// choice mapped
// Smooth shading and normal maps; twin of the CPU's `shading_normal`.
// use shared/normal/vertex
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
