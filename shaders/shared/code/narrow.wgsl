// Codes of 30 bits, in one word.
// use shared/build/curve

const CELL_BITS: u32 = 10u;

@group(2) @binding(0) var<storage, read_write> codes_low: array<u32>;
@group(2) @binding(1) var<storage, read> sorted_low: array<u32>;

fn write_code(item: u32, cells: vec3<u32>) {
    codes_low[item] = interleaved(cells);
}

/// Number of leading bits that two codes have in common, of 32; 32 where they are equal.
fn common_bits(a: u32, b: u32) -> u32 {
    return countLeadingZeros(sorted_low[a] ^ sorted_low[b]);
}

/// What `common_bits` says of equal codes.
const CODE_BITS: u32 = 32u;
