// Codes of 63 bits, in two words.
// use shared/build/curve

const CELL_BITS: u32 = 21u;

@group(2) @binding(0) var<storage, read_write> codes_low: array<u32>;
@group(2) @binding(1) var<storage, read> sorted_low: array<u32>;
@group(2) @binding(2) var<storage, read_write> codes_high: array<u32>;
@group(2) @binding(3) var<storage, read> sorted_high: array<u32>;

/// Ten bits an axis make 30 of the code, and so do the next ten; the last bit of each axis makes three.
fn write_code(item: u32, cells: vec3<u32>) {
    let lowest = interleaved(cells & vec3(0x3ffu));
    let middle = interleaved((cells >> vec3(10u)) & vec3(0x3ffu));
    let highest = interleaved(cells >> vec3(20u));
    codes_low[item] = lowest | (middle << 30u);
    codes_high[item] = (middle >> 2u) | (highest << 28u);
}

/// Number of leading bits that two codes have in common, of 64; 64 where they are equal.
fn common_bits(a: u32, b: u32) -> u32 {
    let high = sorted_high[a] ^ sorted_high[b];
    if high != 0u {
        return countLeadingZeros(high);
    }
    return 32u + countLeadingZeros(sorted_low[a] ^ sorted_low[b]);
}

/// What `common_bits` says of equal codes.
const CODE_BITS: u32 = 64u;
