// part index
// One axis of a dispatch allows only 65,535 work-groups, so work-groups lie in rows.

/// Builtins of an entry point.
struct Invocation {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
}

/// Index of a work-group in a dispatch.
fn group_index(id: Invocation) -> u32 {
    return id.group.y * id.groups.x + id.group.x;
}

/// Index of an invocation in a dispatch whose work-groups have `size` invocations.
fn invocation(id: Invocation, size: u32) -> u32 {
    return group_index(id) * size + id.local;
}

// part iterations
// Loop iterations of this invocation so far. Some drivers end long loops early, so traversal counts and stops before.

var<private> iterations: u32;
