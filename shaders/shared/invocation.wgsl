// part index
// Work spread over more work-groups than one axis may have: 65,535.

/// Number of an invocation among all of a dispatch whose work-groups of `size` invocations lie in rows of `row.x`.
fn invocation(group: vec3<u32>, row: vec3<u32>, size: u32, local: u32) -> u32 {
    return (group.y * row.x + group.x) * size + local;
}

// part iterations
// Turns of loops that an invocation took: drivers may end loops early, and what counts them knows when.

var<private> iterations: u32;
