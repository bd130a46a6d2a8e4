// choice none
// No counters.

fn count_boxes(n: u32) {}

fn count_triangles(n: u32) {}

fn n_tested() -> vec2<u32> {
    return vec2(0u);
}

// choice tests
// Counters of box and triangle tests.

/// Boxes, then triangles, for all rays of this invocation.
var<private> tested: vec2<u32>;

fn count_boxes(n: u32) {
    tested.x += n;
}

fn count_triangles(n: u32) {
    tested.y += n;
}

fn n_tested() -> vec2<u32> {
    return tested;
}
