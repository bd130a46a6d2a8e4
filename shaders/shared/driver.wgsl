// Rays through an acceleration structure of the driver, by its ray queries. Hits are those of the driver: it decides which triangle a ray
// near an edge hits, and which of two at the same distance. `enable` comes before all declarations, so this head uses no other part.
enable wgpu_ray_query;

@group(0) @binding(0) var driver_scene: acceleration_structure;

/// All triangles are opaque; the first hit ends a query of occlusion.
const OPAQUE: u32 = 1u;
const FIRST_HIT: u32 = 4u;

/// The mask of rays that may hit every instance, whose mask is not zero.
const EVERY: u32 = 0xffffffffu;

/// `kind` of an answer without a hit.
const NO_INTERSECTION: u32 = 0u;

/// What the driver hits, of the instances whose masks have a bit of `mask`.
///
/// Masks of drivers have eight bits: seven are those of instances, and the eighth is set in instances that have all bits.
fn driver_intersection(ray: Ray, mask: u32, flags: u32) -> RayIntersection {
    let driver_mask = (mask & 0x7fu) | select(0u, 0x80u, mask != 0u);
    // Drivers may not get rays without a direction or an interval.
    let is_ray = any(ray.direction != vec3<f32>(0.0)) && ray.t_min <= ray.t_max;
    let end = select(ray.t_min, ray.t_max, is_ray);
    let direction = select(vec3<f32>(0.0, 0.0, 1.0), ray.direction, is_ray);
    var query: ray_query;
    rayQueryInitialize(&query, driver_scene, RayDesc(flags, select(0u, driver_mask, is_ray), ray.t_min, end, ray.origin, direction));
    while rayQueryProceed(&query) {}
    return rayQueryGetCommittedIntersection(&query);
}

// part queries
// Rays of all instances.
// use shared/ray

fn driver_closest_hit(ray: Ray) -> Hit {
    let found = driver_intersection(ray, EVERY, OPAQUE);
    if found.kind == NO_INTERSECTION {
        return miss();
    }
    return Hit(found.t, found.barycentrics.x, found.barycentrics.y, found.primitive_index, found.instance_custom_data);
}

fn driver_occluded(ray: Ray) -> bool {
    return driver_intersection(ray, EVERY, OPAQUE | FIRST_HIT).kind != NO_INTERSECTION;
}

// part module
// The same in a program's kernel, with the names of `shared/module`.
// use shared/ray/module
// use shared/invocation/incomplete

fn module_closest_hit(ray: Ray) -> ModuleHit {
    return closest_hit_masked(ray, EVERY);
}

fn module_occluded(ray: Ray) -> bool {
    return occluded_masked(ray, EVERY);
}

fn closest_hit_masked(ray: Ray, mask: u32) -> ModuleHit {
    let found = driver_intersection(ray, mask, OPAQUE);
    if found.kind == NO_INTERSECTION {
        return ModuleHit(FAR, 0.0, 0.0, NONE, NONE, NONE);
    }
    let primitive = found.primitive_index;
    return ModuleHit(found.t, found.barycentrics.x, found.barycentrics.y, primitive, found.instance_custom_data, primitive);
}

fn occluded_masked(ray: Ray, mask: u32) -> bool {
    return driver_intersection(ray, mask, OPAQUE | FIRST_HIT).kind != NO_INTERSECTION;
}
