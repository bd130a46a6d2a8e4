// Closest hits of rays by the adapter's own ray queries, in the form of `trace/closest`.
enable wgpu_ray_query;

struct Ray { origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32 }
struct Hit { t: f32, u: f32, v: f32, primitive: u32, instance: u32 }

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.x + id.y * groups.x * 64u;
    if index >= arrayLength(&rays) {
        return;
    }
    let ray = rays[index];
    var query: ray_query;
    rayQueryInitialize(&query, scene, RayDesc(0x1u, 0xffu, ray.t_min, ray.t_max, ray.origin, ray.direction));
    while rayQueryProceed(&query) {}
    let found = rayQueryGetCommittedIntersection(&query);
    if found.kind == RAY_QUERY_INTERSECTION_NONE {
        hits[index] = Hit(0.0, 0.0, 0.0, 0xffffffffu, 0xffffffffu);
    } else {
        hits[index] = Hit(found.t, found.barycentrics.x, found.barycentrics.y, found.primitive_index, 0u);
    }
}
