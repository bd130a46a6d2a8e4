// Surfaces that alpha cuts out: a ray meets them where alpha says so. `?alpha` tells alpha's texture.
// use shared/mix
// use shared/ray_key
// use ?alpha

/// Above all thresholds: alpha is the probability of being there.
const IS_BLENDED: f32 = 2.0;

fn accepts(hit: Hit) -> bool {
    let triangle = triangles[triangle_of(hit)];
    let material = triangle.material & 0x7fffffffu;
    let cutoff = materials[material].cutoff;
    if cutoff < 0.0 {
        return true;
    }
    let weights = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    let alpha = materials[material].alpha * alpha_of(materials[material].alpha_slot, triangle.vertices, weights)
        * vertex_color(triangle.vertices, weights).a;
    if cutoff < IS_BLENDED {
        return alpha >= cutoff;
    }
    // The same for any way that traversal takes: it depends on key, instance and triangle alone.
    return unit_interval(mix_bits(mix_bits(ray_key ^ hit.instance) ^ hit.primitive) >> 8u) < alpha;
}
