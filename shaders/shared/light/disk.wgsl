// Disk lights, and densities of planar shapes; twin of crates/renderer/src/light/disk.rs.
// use shared/numbers
// use shared/angle
// use shared/sampling
// use shared/light/list

/// Samples a disk uniformly by area; its back does not emit.
fn incoming_from_disk(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let point = light.position + basis_about(light.direction) * vec3(light.extent * uniform_disk(square), 0.0);
    let delta = point - at;
    let density = area_density(delta, light.direction, PI * light.extent * light.extent);
    if density <= 0.0 || dot(delta, light.direction) >= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(normalize(delta), density, bounded(light.color * quotient(1.0, density)), FINITE, point);
}

/// Density of `incoming_from_disk` for a unit direction that hits the disk; 0 from behind.
fn disk_density(light: ListLight, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    if dot(direction, light.direction) >= 0.0 {
        return 0.0;
    }
    return plane_density(at, direction, light.position, light.direction, PI * light.extent * light.extent);
}

/// Density per steradian of a uniform point of a planar shape, from the vector to it; 0 if seen edge-on.
fn area_density(delta: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let distance_squared = dot(delta, delta);
    let height = abs(dot(delta, unit_normal));
    // dA * cos = r^2 * dw, and r * cos is the height above the plane.
    if distance_squared < MIN_SQUARE || height < 1e-18 * sqrt(distance_squared) {
        return 0.0;
    }
    let stretch = min(sqrt(distance_squared) / height, MAX_QUOTIENT);
    return min(quotient(distance_squared, area) * stretch, MAX_QUOTIENT);
}

/// The same for the point where a unit direction hits the plane; 0 for a miss.
fn plane_density(at: vec3<f32>, direction: vec3<f32>, point: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let slope = dot(direction, unit_normal);
    let height = dot(point - at, unit_normal);
    if height * slope <= 0.0 || abs(slope) < 1e-18 {
        return 0.0;
    }
    let distance = quotient(abs(height), abs(slope));
    return area_density(distance * direction, unit_normal, area);
}

// part hit
// use shared/numbers

/// Includes the edge; rays in the plane of the disk miss.
fn disk_crossing(light: ListLight, ray: Ray) -> Crossing {
    let slope = dot(ray.direction, light.direction);
    let height = dot(light.position - ray.origin, light.direction);
    // As quotients of absolute values, which stay in range.
    let t = quotient(abs(height), abs(slope)) * sign_of(height) * sign_of(slope);
    // A nearly parallel ray would reach the plane so far away that a long direction overflows; it misses the disk anyway.
    let delta = abs(light.position - ray.origin);
    let length = abs(ray.direction);
    let farthest = 2.0 * (max(delta.x, max(delta.y, delta.z)) + light.extent);
    let is_near = abs(t) <= quotient(farthest, max(length.x, max(length.y, length.z)));
    let from_center = (ray.origin + select(0.0, t, is_near) * ray.direction) - light.position;
    let is_inside = is_near && dot(from_center, from_center) <= light.extent * light.extent;
    let is_within = slope != 0.0 && ray.t_min <= t && t <= ray.t_max;
    return Crossing(select(NO_CROSSING, t, is_inside && is_within), slope < 0.0);
}
