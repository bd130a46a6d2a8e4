// choice none
// All hits count.

fn accepts(hit: Hit) -> bool {
    return true;
}

// choice alpha
// Alpha test: a hit counts with the probability given by alpha.
// use shared/hash
// use ?alpha
// use shared/hash/ray_key

fn accepts(hit: Hit) -> bool {
    let triangle = triangles[triangle_of(hit)];
    let material = triangle.material & 0x7fffffffu;
    if materials[material].cutoff < 0.0 {
        return true;
    }
    let opacity = presence(material, triangle.vertices, vec3(1.0 - hit.u - hit.v, hit.u, hit.v));
    // Independent of traversal order: depends only on key, instance and triangle.
    return unit_interval(mix_bits(mix_bits(ray_key ^ hit.instance) ^ hit.primitive) >> 8u) < opacity;
}
