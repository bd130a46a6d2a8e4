// Floats as integers, compared and copied exactly, even where a device flushes subnormals or ignores the sign of zero.

/// An unsigned integer with the order of the floats. It is never zero for a number, so zero is below all.
fn ordered(bits: u32) -> u32 {
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

/// Inverse of `ordered`.
fn unordered(key: u32) -> u32 {
    return select(~key, key & 0x7fffffffu, (key & 0x80000000u) != 0u);
}

/// Three minima and three maxima of a box as integers that grow with the box, from the bits of the floats.
struct Reach {
    low: vec3<u32>,
    high: vec3<u32>,
}

fn reach_of(x: u32, y: u32, z: u32) -> Reach {
    let key = vec3<u32>(ordered(x), ordered(y), ordered(z));
    return Reach(~key, key);
}

fn joined(a: Reach, b: Reach) -> Reach {
    return Reach(max(a.low, b.low), max(a.high, b.high));
}

/// One of the six numbers.
fn reach_at(reach: Reach, k: u32) -> u32 {
    return select(reach.high[k % 3u], reach.low[k], k < 3u);
}

/// The float bits of one of the six numbers.
fn end_of(key: u32, k: u32) -> u32 {
    return unordered(select(key, ~key, k < 3u));
}
