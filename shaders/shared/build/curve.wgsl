// Ten bits an axis along the curve.

/// Moves bit i of 10 to bit 3i, halving the runs step by step.
fn spread(cells: vec3<u32>) -> vec3<u32> {
    var x = (cells | (cells << vec3(16u))) & vec3(0x030000ffu);
    x = (x | (x << vec3(8u))) & vec3(0x0300f00fu);
    x = (x | (x << vec3(4u))) & vec3(0x030c30c3u);
    return (x | (x << vec3(2u))) & vec3(0x09249249u);
}

/// Interleaves three cells, x highest.
fn interleaved(cells: vec3<u32>) -> u32 {
    let bits = spread(cells);
    return (bits.x << 2u) | (bits.y << 1u) | bits.z;
}
