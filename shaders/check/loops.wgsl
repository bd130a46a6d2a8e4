// Counts the iterations of a loop. Some drivers end long loops early without an error.
// use shared/invocation/index

@group(0) @binding(0) var<uniform> wanted: vec4<u32>;
@group(0) @binding(1) var<storage, read_write> counted: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&counted) {
        return;
    }
    // The step depends on memory, so that the compiler cannot remove the loop.
    var iterations = 0u;
    loop {
        if iterations >= wanted.x {
            break;
        }
        iterations += 1u + (wanted.y & iterations);
    }
    counted[index] = iterations;
}
