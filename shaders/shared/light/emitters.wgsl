// Emissive triangles of instances that do not move; twin of crates/renderer/src/light/emitters.rs.
//
// `?emission` gives the radiance at a point.
// use shared/light/sample
// use shared/light/tree
// use shared/light/triangle
// use shared/invocation/iterations
// use ?emission

/// An emissive triangle. Emitters are ordered by instance and primitive.
struct Emitter {
    /// First vertex, world space.
    corner: vec3<f32>,
    instance: u32,
    /// From the first vertex to the second.
    first: vec3<f32>,
    primitive: u32,
    /// From the first vertex to the third.
    second: vec3<f32>,
    /// Leaf in the light tree.
    leaf: u32,
    /// Emitted radiance, before textures.
    radiance: vec3<f32>,
    /// Distance along each axis that rays keep from the triangle.
    slack: f32,
}

@group(3) @binding(5) var<storage, read> emitters: array<Emitter>;

/// Light from a point of an emitter; none where it is black or transparent.
fn sample_emitter(number: u32, at: vec3<f32>, square: vec2<f32>) -> LightSample {
    let emitter = emitters[number];
    let point = sample_triangle(emitter.corner, emitter.first, emitter.second, at, square);
    let position = emitter.corner + (point.weights.x * emitter.first + point.weights.y * emitter.second);
    let delta = (emitter.corner - at) + (point.weights.x * emitter.first + point.weights.y * emitter.second);
    if point.density <= 0.0 || dot(delta, delta) < MIN_SQUARE {
        return no_light();
    }
    let to_light = normalize(delta);
    let radiance = emitted_by(emitter, point.weights, to_light);
    if all(radiance <= vec3(0.0)) {
        return no_light();
    }
    // The ray ends as far from the emitter as rays start from it, so that rounding never makes it end behind the emitter.
    let normal = normal_of(cross(emitter.first, emitter.second));
    let off = normal * (-sign_of(dot(normal, delta)) * emitter.slack * dot(abs(normal), vec3(1.0)));
    let weighted = bounded(radiance * quotient(1.0, point.density));
    return LightSample(IncomingLight(to_light, point.density, weighted, FINITE, position + off), NO_SHAPE_LIGHT, true);
}

/// Index of the emitter of a hit; the number of emitters if it moves, has no area or is black.
fn emitter_of(instance: u32, primitive: u32) -> u32 {
    let n = arrayLength(&emitters);
    var first = 0u;
    var last = n;
    // Binary search.
    loop {
        iterations += 1u;
        if first >= last {
            break;
        }
        let middle = first + (last - first) / 2u;
        let emitter = emitters[middle];
        if emitter.instance < instance || emitter.instance == instance && emitter.primitive < primitive {
            first = middle + 1u;
        } else {
            last = middle;
        }
    }
    if first < n && emitters[first].instance == instance && emitters[first].primitive == primitive {
        return first;
    }
    return n;
}

/// Density of a unit direction that hits a triangle, including the probability of choosing it.
fn emitter_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    let number = emitter_of(instance, primitive);
    if number >= arrayLength(&emitters) {
        return 0.0;
    }
    let emitter = emitters[number];
    let density = triangle_density(emitter.corner, emitter.first, emitter.second, receiver.position, direction);
    return light_probability(emitter.leaf, receiver) * density;
}
