// Morton codes and the grid of cells that they number.

/// Moves bit i of 10 to bit 3i, halving the runs at each step.
fn spread(cells: vec3<u32>) -> vec3<u32> {
    var x = (cells | (cells << vec3(16u))) & vec3(0x030000ffu);
    x = (x | (x << vec3(8u))) & vec3(0x0300f00fu);
    x = (x | (x << vec3(4u))) & vec3(0x030c30c3u);
    return (x | (x << vec3(2u))) & vec3(0x09249249u);
}

/// Interleaves three cells, x in the highest bit of each triple.
fn interleaved(cells: vec3<u32>) -> u32 {
    let bits = spread(cells);
    return (bits.x << 2u) | (bits.y << 1u) | bits.z;
}


struct Domain {
    /// Minimum coordinates, times the number of points summed per item.
    offset: vec3<f32>,
    /// Cells per unit of that sum; 0 if the items have no finite extent.
    scale: f32,
}

// choice narrow
// 30-bit codes in one word.

const CELL_BITS: u32 = 10u;

@group(2) @binding(0) var<storage, read_write> codes_low: array<u32>;
@group(2) @binding(1) var<storage, read> sorted_low: array<u32>;

fn write_code(item: u32, cells: vec3<u32>) {
    codes_low[item] = interleaved(cells);
}

/// Length of the common prefix of two codes; 32 if they are equal.
fn common_bits(a: u32, b: u32) -> u32 {
    return countLeadingZeros(sorted_low[a] ^ sorted_low[b]);
}

/// Result of `common_bits` for equal codes.
const CODE_BITS: u32 = 32u;

// choice wide
// 63-bit codes in two words.

const CELL_BITS: u32 = 21u;

@group(2) @binding(0) var<storage, read_write> codes_low: array<u32>;
@group(2) @binding(1) var<storage, read> sorted_low: array<u32>;
@group(2) @binding(2) var<storage, read_write> codes_high: array<u32>;
@group(2) @binding(3) var<storage, read> sorted_high: array<u32>;

/// Ten bits per axis give 30 bits of the code, the next ten another 30, and the last bit of each axis three more.
fn write_code(item: u32, cells: vec3<u32>) {
    let lowest = interleaved(cells & vec3(0x3ffu));
    let middle = interleaved((cells >> vec3(10u)) & vec3(0x3ffu));
    let highest = interleaved(cells >> vec3(20u));
    codes_low[item] = lowest | (middle << 30u);
    codes_high[item] = (middle >> 2u) | (highest << 28u);
}

/// Length of the common prefix of two codes; 64 if they are equal.
fn common_bits(a: u32, b: u32) -> u32 {
    let high = sorted_high[a] ^ sorted_high[b];
    if high != 0u {
        return countLeadingZeros(high);
    }
    return 32u + countLeadingZeros(sorted_low[a] ^ sorted_low[b]);
}

/// Result of `common_bits` for equal codes.
const CODE_BITS: u32 = 64u;
