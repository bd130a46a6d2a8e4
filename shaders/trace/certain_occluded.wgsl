// Whether each ray hits anything, where f32 decides it, and a list of the other rays, which `trace/listed_occluded` traces.
// use shared/certain
// use shared/undecided
// use shared/invocation/index

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// 1 for a hit, 0 for a miss.
@group(1) @binding(1) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let is_certain = is_certain_hit(rays[index], true);
    found[index] = u32(best_number != NONE);
    if !is_certain {
        list(index);
    }
}
