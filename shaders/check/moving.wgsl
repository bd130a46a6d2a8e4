// Closest hits of rays with individual times, to compare with the CPU.
// use shared/invocation/index
// use shared/time/ray_time
// use ?traverse

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read> times: array<f32>;
@group(1) @binding(2) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index < arrayLength(&rays) {
        ray_time = times[index];
        var hit = closest_hit(rays[index]);
        // As in trace/closest.
        if is_incomplete {
            hit.instance = INCOMPLETE;
        }
        hits[index] = hit;
    }
}
