// Counts the iterations of a loop: some drivers leave loops early without a word, and a count that is short tells.
// use shared/groups

@group(0) @binding(0) var<uniform> wanted: vec4<u32>;
@group(0) @binding(1) var<storage, read_write> counted: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = invocation(group, groups, 64u, local);
    if index >= arrayLength(&counted) {
        return;
    }
    // The sum depends on memory, so that no compiler can do without the iterations.
    var iterations = 0u;
    loop {
        if iterations >= wanted.x {
            break;
        }
        iterations += 1u + (wanted.y & iterations);
    }
    counted[index] = iterations;
}
