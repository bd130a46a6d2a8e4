// One instance, whose triangles are all there are.
// use shared/world

fn triangle_of(hit: Hit) -> u32 {
    return hit.primitive;
}
