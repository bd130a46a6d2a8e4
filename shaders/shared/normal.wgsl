// part vertex
// Normals that vertices say.
// const NORMAL

/// The unit normal between those of the vertices, on their side; zero where they say none.
fn smooth_normal(seen: Seen) -> vec3<f32> {
    if NORMAL == 0u {
        return vec3(0.0);
    }
    return normal_world(seen.instance, blend_three(seen.vertices, seen.weights, NORMAL));
}

/// A vertices' normal on the side of the viewer; the triangle's `normal` where it shows the viewer its back.
fn shown_smooth(blended: vec3<f32>, seen: Seen, normal: vec3<f32>) -> vec3<f32> {
    let facing = select(blended, -blended, dot(blended, normal) < 0.0);
    return select(normal, facing, dot(facing, seen.direction) < 0.0);
}

// choice flat
// Every mesh is flat: the triangle's normal is what is shaded with.

fn shading_normal(material: u32, seen: Seen, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return normal;
}

// choice smooth
// Normals interpolated between vertices.
// use shared/normal/vertex

fn shading_normal(material: u32, seen: Seen, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return shown_smooth(smooth_normal(seen), seen, normal);
}

// choice mapped
// Normals interpolated between vertices and bent by normal maps, by the rules of the CPU's `shading_normal`.
// use shared/normal/vertex
// const TANGENT

fn shading_normal(material: u32, seen: Seen, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    let blended = smooth_normal(seen);
    // Cofactors take normals to the other side where the transform mirrors.
    let side = select(1.0, -1.0, is_mirrored);
    let straight = side * select(blended, seen.winding, all(blended == vec3(0.0)));
    let bent = mapped_normal(material, seen, straight, side);
    if all(bent == vec3(0.0)) {
        return shown_smooth(blended, seen, normal);
    }
    return lifted(select(bent, -bent, dot(straight, normal) < 0.0), normal, -seen.direction);
}

/// What the material's map makes of the unit normal `straight`; zero where there is no map, or no frame for it.
fn mapped_normal(material: u32, seen: Seen, straight: vec3<f32>, side: f32) -> vec3<f32> {
    let slot = materials[material].normal_slot;
    if slot == NO_SLOT {
        return vec3(0.0);
    }
    var u = vec3(0.0);
    var v = vec3(0.0);
    if TANGENT != 0u {
        u = orthonormal(vector_world(seen.instance, blend_three(seen.vertices, seen.weights, TANGENT)), straight);
        v = cross(straight, u) * (side * with_sign(1.0, tangent_sign(seen)));
    }
    if all(u == vec3(0.0)) {
        let changes = uv_edges(slot, seen);
        let world = edges(seen.vertices);
        let first = vector_world(seen.instance, world[0]);
        let second = vector_world(seen.instance, world[1]);
        // Lengths do not matter, the sign of the determinant does; where it is zero there are no gradients.
        let turn = sign(determinant(changes));
        u = turn * orthonormal(first * changes[1].y - second * changes[0].y, straight);
        let along_v = turn * (second * changes[0].x - first * changes[1].x);
        let across = cross(straight, u);
        v = select(across, -across, dot(across, along_v) < 0.0);
    }
    if all(u == vec3(0.0)) {
        return vec3(0.0);
    }
    let shown = 2.0 * texel(slot, seen).xyz - 1.0;
    let lean = materials[material].normal_scale * shown.xy;
    return unit(u * lean.x + v * lean.y + straight * shown.z);
}

/// By its sign, which of the two directions across the tangent grows with `v`.
fn tangent_sign(seen: Seen) -> f32 {
    let at = TANGENT + 3u;
    let corners = seen.vertices * STRIDE + at;
    return dot(seen.weights, vec3(vertices[corners.x], vertices[corners.y], vertices[corners.z]));
}

/// The unit vector along `v`, less what of it lies along the unit vector `normal`.
fn orthonormal(v: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let direction = unit(v);
    return unit(direction - normal * dot(direction, normal));
}

/// The unit normal next to `bent` that shows the viewer its face and mirrors the view out of the body.
fn lifted(bent: vec3<f32>, normal: vec3<f32>, towards_viewer: vec3<f32>) -> vec3<f32> {
    let cosine = dot(bent, towards_viewer);
    if cosine <= 0.0 {
        return normal;
    }
    let mirrored = bent * (2.0 * cosine) - towards_viewer;
    let height = dot(mirrored, normal);
    if height >= 0.0 {
        return bent;
    }
    let raised = unit(towards_viewer + (mirrored - normal * height));
    return select(raised, normal, all(raised == vec3(0.0)));
}
