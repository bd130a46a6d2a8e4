// Places of the paths that go on, closed up: a work-group's beside each other.

@group(1) @binding(9) var<storage, read_write> next_active: array<u32>;
@group(1) @binding(10) var<storage, read_write> n_next_active: array<atomic<u32>>;

var<workgroup> n_of_group: atomic<u32>;
var<workgroup> first_of_group: u32;

/// Adds a place where `goes_on`. All invocations of a work-group come here together.
fn enqueue(goes_on: bool, place: u32, local: u32) {
    var at = 0u;
    if goes_on {
        at = atomicAdd(&n_of_group, 1u);
    }
    workgroupBarrier();
    if local == 0u {
        first_of_group = atomicAdd(&n_next_active[0], atomicLoad(&n_of_group));
    }
    workgroupBarrier();
    if goes_on {
        next_active[first_of_group + at] = place;
    }
}
