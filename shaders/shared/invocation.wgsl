// part index
// One axis of a dispatch allows only 65,535 work-groups, so work-groups lie in rows.

/// Index of an invocation in a dispatch whose work-groups of `size` invocations lie in rows of `row.x`.
fn invocation(group: vec3<u32>, row: vec3<u32>, size: u32, local: u32) -> u32 {
    return (group.y * row.x + group.x) * size + local;
}

// part iterations
// Loop iterations of this invocation so far. Some drivers end long loops early, so traversal counts and stops before.

var<private> iterations: u32;
