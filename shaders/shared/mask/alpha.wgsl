// Surfaces that alpha cuts out: a ray meets them where alpha says so.
// use shared/hash
// use shared/presence
// use shared/ray_key

fn accepts(hit: Hit) -> bool {
    let triangle = triangles[triangle_of(hit)];
    let material = triangle.material & 0x7fffffffu;
    if materials[material].cutoff < 0.0 {
        return true;
    }
    let share = presence(material, triangle.vertices, vec3(1.0 - hit.u - hit.v, hit.u, hit.v));
    // The same for any way that traversal takes: it depends on key, instance and triangle alone.
    return unit_interval(mix_bits(mix_bits(ray_key ^ hit.instance) ^ hit.primitive) >> 8u) < share;
}
