// choice none
// Nothing is counted.

fn count_boxes(n: u32) {}

fn count_triangles(n: u32) {}

fn n_tested() -> vec2<u32> {
    return vec2(0u);
}

// choice tests
// What a ray costs: boxes and triangles that were tested, for kernels that ask.

/// Boxes, then triangles, of all rays of this invocation.
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
