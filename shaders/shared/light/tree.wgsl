// Light tree: chooses a light by its estimated contribution; twin of crates/renderer/src/light/tree.rs.
//
// A squared distance times an intensity may exceed the range of f32. So importance is never computed by itself; siblings are
// compared by quotients.
// use shared/numbers
// use shared/light/sampler
// use shared/invocation/iterations

/// A cluster of lights: bounding sphere, and normal cone by cosines. World space.
struct LightNode {
    center: vec3<f32>,
    radius: f32,
    /// Unit vector.
    axis: vec3<f32>,
    /// Cosine of the emission angle around a light's axis, beyond which it does not emit.
    cos_emission: f32,
    /// Cosine and sine of the largest angle between `axis` and the axis of any light.
    spread: vec2<f32>,
    /// Positive, relative to the total of all lights.
    intensity: f32,
    is_two_sided: u32,
    parent: u32,
    /// First of two adjacent children; 0 for a leaf, because the root is never a child.
    first_child: u32,
    /// For a leaf: `EMITTER` and the index of an emitter, or the index of a listed light.
    light: u32,
}

/// Marks emissive triangles among the leaves.
const EMITTER: u32 = 0x80000000u;

@group(3) @binding(4) var<storage, read> light_nodes: array<LightNode>;

/// Importance of a cluster: none if `strength` is 0.
struct LightImportance {
    strength: f32,
    distance_squared: f32,
}

/// A leaf of the tree and its probability; 0 if no light reaches the receiver.
struct Chosen {
    light: u32,
    probability: f32,
}

/// `angle` minus `other`, both as cosine and sine; zero if `other` is larger.
fn angle_minus(angle: vec2<f32>, other: vec2<f32>) -> vec2<f32> {
    if angle.x >= other.x {
        return vec2(1.0, 0.0);
    }
    return vec2(dot(angle, other), angle.y * other.x - angle.x * other.y);
}

/// The angle between unit vectors. The sine stays precise where the cosine is near 1.
fn angle_between(a: vec3<f32>, b: vec3<f32>) -> vec2<f32> {
    return vec2(clamp(dot(a, b), -1.0, 1.0), length(cross(a, b)));
}

fn light_importance(node: LightNode, receiver: Receiver) -> LightImportance {
    let delta = receiver.position - node.center;
    let square = dot(delta, delta);
    let radius_squared = node.radius * node.radius;
    let distance_squared = max(max(square, radius_squared), MIN_SQUARE);
    let distance = sqrt(max(square, MIN_SQUARE));
    // Half-angle of the bounding sphere as seen by the receiver; pi from inside.
    var sphere = vec2(-1.0, 0.0);
    if square > radius_squared {
        let sine = node.radius / distance;
        sphere = vec2(sqrt(max((1.0 - sine) * (1.0 + sine), 0.0)), sine);
    }
    // A light at the position of the receiver counts for all directions.
    let direction = delta / distance;
    let is_apart = square >= MIN_SQUARE;
    var emitted = vec2(1.0, 0.0);
    var received = 1.0;
    if is_apart {
        emitted = angle_between(node.axis, direction);
        if node.is_two_sided != 0u {
            emitted.x = abs(emitted.x);
        }
        if !receiver.transmits {
            received = angle_minus(angle_between(receiver.normal, -direction), sphere).x;
        }
    }
    emitted = angle_minus(angle_minus(emitted, node.spread), sphere);
    // More tolerance than the rounding of the cosines, so that no light at its horizon is lost.
    if emitted.x < node.cos_emission - 1e-6 {
        return LightImportance(0.0, distance_squared);
    }
    return LightImportance(max(node.intensity * emitted.x, 0.0) * max(received, 0.0), distance_squared);
}

/// Probabilities of two siblings; both zero if neither has any importance.
fn child_probabilities(first: u32, receiver: Receiver) -> vec2<f32> {
    let a = light_importance(light_nodes[first], receiver);
    let b = light_importance(light_nodes[first + 1u], receiver);
    if a.strength <= 0.0 || b.strength <= 0.0 {
        return vec2(select(0.0, 1.0, a.strength > 0.0), select(0.0, 1.0, b.strength > 0.0));
    }
    let nearest = min(a.distance_squared, b.distance_squared);
    let strongest = max(a.strength, b.strength);
    // Neither becomes zero, however weak and far.
    let x = max(a.strength / strongest * (nearest / a.distance_squared), 1e-30);
    let y = max(b.strength / strongest * (nearest / b.distance_squared), 1e-30);
    return vec2(x, y) / (x + y);
}

/// Chooses a light from a number in `[0, 1)`.
fn choose_light(receiver: Receiver, number: f32) -> Chosen {
    var choice = number;
    var node = 0u;
    var probability = 1.0;
    loop {
        iterations += 1u;
        let first = light_nodes[node].first_child;
        if first == 0u {
            break;
        }
        let probabilities = child_probabilities(first, receiver);
        // The second needs a positive probability: if it has none, the first has all.
        let is_second = choice >= probabilities.x;
        let child_probability = select(probabilities.x, probabilities.y, is_second);
        if child_probability <= 0.0 {
            return Chosen(0u, 0.0);
        }
        choice = clamp((choice - select(0.0, probabilities.x, is_second)) / child_probability, 0.0, 0.99999994);
        probability *= child_probability;
        node = first + select(0u, 1u, is_second);
    }
    return Chosen(light_nodes[node].light, probability);
}

/// The probability that `choose_light` chooses a leaf.
fn light_probability(leaf: u32, receiver: Receiver) -> f32 {
    var child = leaf;
    var probability = 1.0;
    loop {
        iterations += 1u;
        if child == 0u || probability <= 0.0 {
            break;
        }
        let parent = light_nodes[child].parent;
        let first = light_nodes[parent].first_child;
        let probabilities = child_probabilities(first, receiver);
        probability *= select(probabilities.x, probabilities.y, child != first);
        child = parent;
    }
    return probability;
}
