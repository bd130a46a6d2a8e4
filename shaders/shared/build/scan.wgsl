// Prefix sums over the invocations of a work-group.

var<workgroup> partial_sums: array<u32, GROUP>;

struct Scanned {
    /// Sum of the values of the invocations before this one.
    before: u32,
    total: u32,
}

/// Sums one value per invocation. Requires uniform control flow. Source: Hillis and Steele 1986.
fn scan_group(local: u32, value: u32) -> Scanned {
    partial_sums[local] = value;
    workgroupBarrier();
    for (var reach = 1u; reach < GROUP; reach <<= 1u) {
        var before = 0u;
        if local >= reach {
            before = partial_sums[local - reach];
        }
        workgroupBarrier();
        partial_sums[local] += before;
        workgroupBarrier();
    }
    let scanned = Scanned(partial_sums[local] - value, partial_sums[GROUP - 1u]);
    // The caller may reuse the memory at once.
    workgroupBarrier();
    return scanned;
}
