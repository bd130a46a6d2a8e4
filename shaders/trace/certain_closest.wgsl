// The triangle that each ray hits first, where f32 decides it, and a list of the other rays. `trace/certain_weights` completes the hits,
// `trace/listed_closest` traces the listed rays.
// use shared/certain
// use shared/undecided/found
// use shared/invocation/index

@group(1) @binding(0) var<storage, read> rays: array<Ray>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let is_certain = is_certain_hit(rays[index], false);
    let is_hit = is_certain && best_number != NONE;
    hits[index] = Found(best_at, 0u, 0u, best_number, select(NONE, best_instance, is_hit));
    if !is_certain {
        list(index);
    }
}
