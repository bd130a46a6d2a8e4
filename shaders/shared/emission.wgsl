// choice constant
// Emitters with constant radiance and no alpha.

fn emitted_by(emitter: Emitter, weights: vec2<f32>, direction: vec3<f32>) -> vec3<f32> {
    return emitter.radiance;
}

// choice textured
// Emitters with textures or alpha: the texture scales the radiance, alpha the probability of being hit.
// use ?alpha

fn emitted_by(emitter: Emitter, weights: vec2<f32>, direction: vec3<f32>) -> vec3<f32> {
    let hit = Hit(1.0, weights.x, weights.y, emitter.primitive, emitter.instance);
    let triangle = triangles[triangle_of(hit)];
    let material = triangle.material & 0x7fffffffu;
    let corners = triangle.vertices;
    let at = vec3(1.0 - weights.x - weights.y, weights);
    // Looked up at a point: a cone of zero width averages nothing.
    let line = Cone(0.0, 0.0, 0.0, false);
    let winding = normal_world(emitter.instance, triangle.normal);
    let lookup = TextureLookup(corners, at, emitter.instance, winding, area_root(emitter.instance, triangle), direction, line);
    return emitter.radiance * texel(materials[material].emission_slot, lookup).rgb * presence(material, corners, at);
}
