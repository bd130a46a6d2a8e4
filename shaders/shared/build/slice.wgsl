// The range of items that one dispatch processes. Slicing bounds the time of a dispatch.
// use shared/invocation/index

struct Slice {
    first: u32,
    end: u32,
    /// Always zero, unknown to the compiler.
    zero: u32,
}

@group(0) @binding(0) var<uniform> slice: Slice;

/// The item of an invocation. Items at or beyond `slice.end` do not exist.
fn slice_item(id: Invocation, size: u32) -> u32 {
    return slice.first + invocation(id, size);
}

/// The value as it is stored. Compilers may simplify `(a + b) - a` to `b`, but not through an unknown integer.
fn stored(v: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(v) ^ vec3(slice.zero));
}
