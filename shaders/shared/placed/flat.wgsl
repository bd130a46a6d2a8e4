// Instances whose triangles follow each other in world space, numbered as the tree over them numbers them.
// use shared/world

/// Number of the first triangle of each instance.
@group(2) @binding(3) var<storage, read> firsts: array<u32>;

fn triangle_of(hit: Hit) -> u32 {
    return firsts[hit.instance] + hit.primitive;
}
