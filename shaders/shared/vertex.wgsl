// A path vertex with the frame of its BSDF. Directions on which shading normal and triangle disagree are mirrored in the plane
// of the triangle; a direction receives both its own scattering and that of the mirrored one.
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
    /// Unit normal of the triangle.
    normal: vec3<f32>,
    /// Whether the frame's normal differs from the triangle's.
    is_perturbed: bool,
}

fn vertex_of(surface: Surface) -> Vertex {
    let viewer = -surface.lookup.direction;
    // If the shading normal faces away from the viewer, the triangle's normal is used.
    let faces = dot(surface.shading_normal, viewer) > 0.0;
    let normal = select(surface.normal, surface.shading_normal, faces);
    let basis = basis_about(normal);
    return Vertex(bsdf_of(surface), basis, viewer * basis, surface.normal, any(normal != surface.normal));
}

/// Scattering of a world-space direction, including its mirrored direction.
fn evaluate(vertex: Vertex, to_light: vec3<f32>) -> Evaluation {
    let height = dot(vertex.normal, to_light);
    var local = to_light * vertex.basis;
    var sum = no_evaluation();
    // One call site, because the code is large. A direction is used as it is where triangle and frame agree on its side, and
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

/// A sampled local direction in world space, on the same side of the triangle as in the frame.
fn world_direction(vertex: Vertex, incident: vec3<f32>) -> vec3<f32> {
    let direction = vertex.basis * incident;
    let agrees = !vertex.is_perturbed || incident.z * dot(vertex.normal, direction) >= 0.0;
    return select(in_plane_mirrored(vertex, direction), direction, agrees);
}

/// A direction mirrored in the plane of the triangle.
fn in_plane_mirrored(vertex: Vertex, direction: vec3<f32>) -> vec3<f32> {
    return direction - vertex.normal * (2.0 * dot(vertex.normal, direction));
}
