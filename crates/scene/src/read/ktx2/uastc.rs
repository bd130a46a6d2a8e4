//! UASTC: blocks of 4 x 4 texels of 16 bytes, in one of 19 modes of ASTC with a header of its own.
//!
//! Sources: "UASTC LDR 4x4 Texture Specification" of Basis Universal; Khronos Data Format Specification, "ASTC Compressed Texture
//! Image Formats".

use super::Flaw;

/// How a block is coded.
struct Mode {
    /// The first bits of the block, the first one lowest, and how many they are.
    code: (u8, u32),
    /// Bits of hints for other encoders.
    n_hints: u32,
    n_weight_bits: u32,
    /// Bits of the components of endpoints, and how many times as many values there are: 1, 3 or 5.
    endpoint: (u32, u32),
    n_subsets: usize,
    /// Two planes have weights of their own for one channel: which one, or [`READ`].
    plane: Option<usize>,
    /// Gray and alpha, colors, or colors and alpha.
    n_components: usize,
}

/// The channel of the second plane is in the block.
const READ: usize = 4;
/// The mode whose two subsets are those of [`OTHER_PAIRS`].
const OTHER: usize = 7;
/// The mode of blocks of one color.
const SOLID: usize = 8;

const fn mode(
    code: (u8, u32),
    n_hints: u32,
    n_weight_bits: u32,
    endpoint: (u32, u32),
    n_subsets: usize,
    plane: Option<usize>,
    n_components: usize,
) -> Mode {
    Mode { code, n_hints, n_weight_bits, endpoint, n_subsets, plane, n_components }
}

const MODES: [Mode; 19] = [
    mode((0x01, 4), 15, 4, (6, 3), 1, None, 3),
    mode((0x35, 6), 15, 2, (8, 1), 1, None, 3),
    mode((0x1d, 5), 15, 3, (4, 1), 2, None, 3),
    mode((0x03, 5), 15, 2, (2, 3), 3, None, 3),
    mode((0x13, 5), 15, 2, (3, 5), 2, None, 3),
    mode((0x0b, 5), 15, 3, (8, 1), 1, None, 3),
    mode((0x1b, 5), 15, 2, (5, 5), 1, Some(READ), 3),
    mode((0x07, 5), 15, 2, (3, 5), 2, None, 3),
    mode((0x17, 5), 0, 0, (8, 1), 0, None, 4),
    mode((0x0f, 5), 23, 2, (4, 1), 2, None, 4),
    mode((0x02, 3), 17, 4, (4, 3), 1, None, 4),
    mode((0x00, 2), 17, 2, (4, 3), 1, Some(READ), 4),
    mode((0x06, 3), 17, 3, (6, 3), 1, None, 4),
    mode((0x1f, 5), 23, 1, (8, 1), 1, Some(READ), 4),
    mode((0x0d, 5), 23, 2, (8, 1), 1, None, 4),
    mode((0x05, 7), 23, 4, (8, 1), 1, None, 2),
    mode((0x15, 6), 23, 2, (8, 1), 2, None, 2),
    mode((0x25, 6), 23, 2, (8, 1), 1, Some(3), 2),
    mode((0x09, 4), 15, 5, (5, 1), 1, None, 3),
];

/// Partitions of ASTC into two and three subsets, by their numbers in a block.
const PAIRS: [u32; 30] = [
    28, 20, 16, 29, 91, 9, 107, 72, 149, 204, 50, 114, 496, 17, 78, 39, 252, 828, 43, 156, 116, 210, 476, 273, 684,
    359, 246, 195, 694, 524,
];
const TRIPLES: [u32; 11] = [260, 74, 32, 156, 183, 15, 745, 0, 335, 902, 254];
const OTHER_PAIRS: [u32; 19] =
    [36, 48, 61, 137, 161, 183, 226, 281, 302, 307, 479, 495, 593, 594, 605, 799, 812, 988, 993];

/// The bits of a block that are not yet read.
struct Block(u128);

impl Block {
    fn take(&mut self, n: u32) -> u32 {
        let taken = self.0 as u32 & ((1 << n) - 1);
        self.0 >>= n;
        taken
    }
}

/// Decodes a block: its texels from left to right and down.
pub(super) fn decode(bytes: [u8; 16]) -> Result<[[u8; 4]; 16], Flaw> {
    let mut block = Block(u128::from_le_bytes(bytes));
    let is_code = |mode: &Mode| u32::from(bytes[0]) & ((1 << mode.code.1) - 1) == u32::from(mode.code.0);
    let number = MODES.iter().position(is_code).ok_or("unknown mode of a block")?;
    let mode = &MODES[number];
    block.take(mode.code.1);
    if number == SOLID {
        return Ok([[(); 4].map(|()| block.take(8) as u8); 16]);
    }
    block.take(mode.n_hints);
    let subsets = match mode.n_subsets {
        1 => [0; 16],
        n => {
            let list = match (n, number) {
                (3, _) => &TRIPLES[..],
                (_, OTHER) => &OTHER_PAIRS,
                _ => &PAIRS,
            };
            let seed =
                list.get(block.take(if n == 3 { 4 } else { 5 }) as usize).ok_or("unknown partition of a block")?;
            std::array::from_fn(|texel| subset(*seed, [texel as u32 % 4, texel as u32 / 4], n as u32))
        }
    };
    let plane = mode.plane.map(|plane| if plane == READ { block.take(2) as usize } else { plane });
    let endpoints = endpoints(&mut block, mode);
    let mut texels = [[0; 4]; 16];
    for (k, texel) in texels.iter_mut().enumerate() {
        // The highest bit of the first weight of a subset is not stored, as it is 0.
        let is_first = !subsets[..k].contains(&subsets[k]);
        let mut next = || weight(block.take(mode.n_weight_bits - u32::from(is_first)), mode.n_weight_bits);
        let first = next();
        let weights = plane.map_or([first; 4], |plane| {
            let mut weights = [first; 4];
            weights[plane] = next();
            weights
        });
        let [low, high] = endpoints[subsets[k]];
        *texel = std::array::from_fn(|c| interpolated(low[c], high[c], weights[c]));
    }
    Ok(texels)
}

/// The lower and upper colors of each subset.
fn endpoints(block: &mut Block, mode: &Mode) -> [[[u8; 4]; 2]; 3] {
    let (n_bits, base) = mode.endpoint;
    let n_values = mode.n_components * 2 * mode.n_subsets;
    // Digits to the base 3 or 5 are stored together, before the bits: five in eight bits or three in seven.
    let (n_together, sizes): (_, &[u32]) = match base {
        3 => (5, &[2, 4, 5, 7, 8]),
        _ => (3, &[3, 5, 7]),
    };
    let mut values = [0; 18];
    if base > 1 {
        for group in values[..n_values].chunks_mut(n_together) {
            let mut digits = block.take(sizes[group.len() - 1]);
            for value in group {
                *value = (digits % base) << n_bits;
                digits /= base;
            }
        }
    }
    for value in &mut values[..n_values] {
        *value |= block.take(n_bits);
    }
    let values = values.map(|value| component(value, n_bits, base));
    let mut endpoints = [[[0, 0, 0, u8::MAX]; 2]; 3];
    let pairs = values[..n_values].as_chunks::<2>().0;
    for (subset, pairs) in endpoints.iter_mut().zip(pairs.chunks(mode.n_components)) {
        for (end, color) in subset.iter_mut().enumerate() {
            match pairs {
                [gray, alpha] => *color = [gray[end], gray[end], gray[end], alpha[end]],
                _ => color.iter_mut().zip(pairs).for_each(|(component, pair)| *component = pair[end]),
            }
        }
    }
    endpoints
}

/// A component of an endpoint, of a digit to the base `base` above `n_bits` bits.
fn component(value: u32, n_bits: u32, base: u32) -> u8 {
    let (digit, bits) = (value >> n_bits, value & ((1 << n_bits) - 1));
    let high = bits >> 1;
    let (factor, spread) = match (n_bits, base) {
        (2, 3) => (93, high * 0b1_0001_0110),
        (3, 5) => (26, high << 7 | high << 1 | high >> 1),
        (4, 3) => (22, high << 6 | high),
        (5, 5) => (6, high << 5 | high >> 3),
        (6, 3) => (5, high << 4 | high >> 4),
        _ => return repeated(bits, n_bits, 8) as u8,
    };
    // The lowest bit inverts the others.
    let inverted = if bits & 1 == 1 { 0x1ff } else { 0 };
    let sum = (digit * factor + spread) ^ inverted;
    (inverted & 0x80 | sum >> 2) as u8
}

/// A weight from 0 to 64.
fn weight(bits: u32, n_bits: u32) -> u32 {
    let weight = repeated(bits, n_bits, 6);
    weight + u32::from(weight > 32)
}

/// `n` bits that repeat `n_bits` bits.
fn repeated(bits: u32, n_bits: u32, n: u32) -> u32 {
    let (mut all, mut n_all) = (bits, n_bits);
    while n_all < n {
        (all, n_all) = (all << n_bits | bits, n_all + n_bits);
    }
    all >> (n_all - n)
}

/// The color at a weight between two, with components of 16 bits.
fn interpolated(low: u8, high: u8, weight: u32) -> u8 {
    let [low, high] = [low, high].map(|x| u32::from(x) * 257);
    ((low * (64 - weight) + high * weight + 32) >> 14) as u8
}

/// The subset of a texel in a partition of ASTC.
fn subset(seed: u32, [x, y]: [u32; 2], n_subsets: u32) -> usize {
    let random = scrambled(seed + (n_subsets - 1) * 1024);
    let wide = if n_subsets == 3 { 6 } else { 5 };
    let narrow = if seed & 2 == 2 { 4 } else { 5 };
    let shifts = if seed & 1 == 1 { [narrow, wide] } else { [wide, narrow] };
    // Blocks of fewer than 31 texels count twice.
    let position = [2 * x, 2 * y];
    let line = |k: u32, offset: u32| {
        let part = |axis: u32| {
            let factor = random >> (8 * k + 4 * axis) & 15;
            ((factor * factor) >> shifts[axis as usize]) * position[axis as usize]
        };
        (part(0) + part(1) + (random >> offset)) & 63
    };
    let [a, b, c] = [line(0, 14), line(1, 10), if n_subsets == 3 { line(2, 6) } else { 0 }];
    if a >= b && a >= c {
        0
    } else if b >= c {
        1
    } else {
        2
    }
}

/// The hash function of partitions.
fn scrambled(mut x: u32) -> u32 {
    x ^= x >> 15;
    x = x.wrapping_sub(x << 17);
    x = x.wrapping_add(x << 7);
    x = x.wrapping_add(x << 4);
    x ^= x >> 5;
    x = x.wrapping_add(x << 16);
    x ^= x >> 7;
    x ^= x >> 3;
    x ^= x << 6;
    x ^ x >> 17
}
