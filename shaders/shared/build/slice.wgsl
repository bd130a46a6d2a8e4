// The part of a station's items that one dispatch works on, so that none runs long.
// use shared/invocation/index

struct Slice {
    first: u32,
    end: u32,
    /// Zero, which no compiler knows.
    zero: u32,
}

@group(0) @binding(0) var<uniform> slice: Slice;

/// The item of an invocation; at or beyond `slice.end` there is none.
fn slice_item(group: vec3<u32>, row: vec3<u32>, size: u32, local: u32) -> u32 {
    return slice.first + invocation(group, row, size, local);
}

/// Numbers as they are stored: compilers may take `(a + b) - a` for `b`, but not through integers that they do not know.
fn stored(v: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(v) ^ vec3(slice.zero));
}
