// The closest hit of each ray that f32 decides, and a list of the other rays, which `trace/listed_closest` traces.
// use shared/certain/list
// use shared/invocation/index

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let hit = certain_hit(rays[index], false);
    hits[index] = hit;
    if is_undecided {
        list(index);
    }
}
