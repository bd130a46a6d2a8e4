// The part of a station's items that one dispatch works on, so that none runs long.
// use shared/groups

struct Slice {
    first: u32,
    end: u32,
}

@group(0) @binding(0) var<uniform> slice: Slice;

/// The item of an invocation; at or beyond `slice.end` there is none.
fn slice_item(group: vec3<u32>, row: vec3<u32>, size: u32, local: u32) -> u32 {
    return slice.first + invocation(group, row, size, local);
}
