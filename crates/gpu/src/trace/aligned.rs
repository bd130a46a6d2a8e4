//! Aligned nodes as devices read them: the boxes of the children in bytes, `shared/bvh/node`.
//!
//! After Ylitie, Karras and Laine 2017: the ends of the boxes are whole steps from where the boxes of the node start, and a step is a power
//! of two. The ends are rounded outward. Twin of the kernel `build/wide/nodes`, which has the same numbers.

use super::layout::WIDTH;

/// The box of a child: the low and the high ends.
pub(super) type Ends = [[f32; 3]; 2];

/// What the bytes of a node are relative to.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Steps {
    start: [f32; 3],
    /// Biased exponents of the steps.
    exponents: [u32; 3],
}

/// The least exponent of a step, 2^-100: its products with the reciprocals of directions stay normal.
const LEAST_EXPONENT: u32 = 27;

/// So that an exponent has eight bits, and the inverse of a step is a number.
const GREATEST_EXPONENT: u32 = 253;

/// Steps over which the boxes of a node extend at most, but for roundings. One less than bytes have, for what the ends are rounded outward.
const MOST_STEPS: f32 = 254.0;

/// By which ends are rounded outward, in steps. A distance in steps has one rounding, and so has its sum with this number: each is at most
/// 2^-23 of 256 steps, and this is four times as much as both; the kernel says what the rest is for.
const OUTWARD: f32 = 1.0 / 4096.0;

/// Bytes of a child that does not exist: its ends are in the wrong order. A ray whose pads are larger than the node may enter it, which
/// kernels allow.
const NOWHERE: [u8; 2] = [255, 0];

impl Steps {
    /// Those of the boxes of a node.
    fn of(boxes: &[Option<Ends>; WIDTH]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for [a, b] in boxes.iter().flatten() {
            for k in 0..3 {
                (low[k], high[k]) = (low[k].min(a[k]), high[k].max(b[k]));
            }
        }
        if boxes.iter().all(Option::is_none) {
            return Self { start: [0.0; 3], exponents: [LEAST_EXPONENT; 3] };
        }
        let exponent = |k: usize| {
            // The difference of two zeros may be negative.
            let least = (high[k] - low[k]).abs() * (1.0 / MOST_STEPS);
            // The next power of two.
            ((least.to_bits() + 0x007f_ffff) >> 23).clamp(LEAST_EXPONENT, GREATEST_EXPONENT)
        };
        Self { start: low, exponents: [0, 1, 2].map(exponent) }
    }

    /// The low and the high end along an axis, in steps.
    fn rounded_out(&self, [low, high]: &Ends, k: usize) -> [u8; 2] {
        let per_step = f32::from_bits((254 - self.exponents[k]) << 23);
        let steps = |end: f32| (end - self.start[k]) * per_step;
        let byte = |steps: f32| steps.clamp(0.0, 255.0) as u8;
        [byte((steps(low[k]) - OUTWARD).floor()), byte((steps(high[k]) + OUTWARD).ceil())]
    }

    fn step(&self, k: usize) -> f64 {
        f64::from(f32::from_bits(self.exponents[k] << 23))
    }

    /// Coordinates outside of the ends in bytes.
    fn ends(&self, k: usize, bytes: [u8; 2]) -> [f32; 2] {
        let [low, high] = bytes.map(|byte| (f64::from(self.start[k]) + f64::from(byte) * self.step(k)) as f32);
        [low.next_down(), high.next_up()]
    }
}

/// The words of an aligned node after those of its children: where its boxes start, the exponents with a bit for each child that is a leaf,
/// and the bytes of both halves.
pub(super) fn packed(boxes: &[Option<Ends>; WIDTH], leaves: u8) -> [u32; 16] {
    let steps = Steps::of(boxes);
    let [x, y, z] = steps.start.map(f32::to_bits);
    let exponents = steps.exponents[0] | steps.exponents[1] << 8 | steps.exponents[2] << 16 | u32::from(leaves) << 24;
    let mut words = [x, y, z, exponents, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    for (i, child) in boxes.iter().enumerate() {
        for k in 0..3 {
            let bytes = child.as_ref().map_or(NOWHERE, |ends| steps.rounded_out(ends, k));
            for (end, byte) in bytes.into_iter().enumerate() {
                words[word_of(i, k, end)] |= u32::from(byte) << (8 * (i % 4));
            }
        }
    }
    words
}

/// The bits of children that are leaves.
pub(super) fn leaves(words: &[u32; 16]) -> u8 {
    (words[3] >> 24) as u8
}

/// Boxes around those of a node of a device, for the CPU; `None` for those whose ends are in the wrong order.
pub(super) fn unpacked(words: &[u32; 16]) -> [Option<Ends>; WIDTH] {
    let [x, y, z, exponents, ..] = *words;
    let steps =
        Steps { start: [x, y, z].map(f32::from_bits), exponents: [0, 8, 16].map(|shift| exponents >> shift & 255) };
    std::array::from_fn(|i| {
        let bytes = |k| [0, 1].map(|end| (words[word_of(i, k, end)] >> (8 * (i % 4)) & 255) as u8);
        let [x, y, z] = [0, 1, 2].map(|k| steps.ends(k, bytes(k)));
        (0..3).all(|k| bytes(k)[0] <= bytes(k)[1]).then_some([[x[0], y[0], z[0]], [x[1], y[1], z[1]]])
    })
}

/// The word with the byte of a child for the low or high end along an axis.
fn word_of(child: usize, k: usize, end: usize) -> usize {
    let half = child / 4;
    if k < 2 { 4 + 4 * half + 2 * k + end } else { 12 + 2 * half + end }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    /// Whether `start + byte * step` is at most `end`: without rounding, as the sum of two numbers of which the second is what the first
    /// lost.
    fn is_at_most(start: f32, offset: f64, end: f32) -> bool {
        let start = f64::from(start);
        let sum = start + offset;
        let of_offset = sum - start;
        let lost = (start - (sum - of_offset)) + (offset - of_offset);
        sum < end.into() || (sum == end.into() && lost <= 0.0)
    }

    /// An end of a box that is outside of its bytes.
    fn flaw(boxes: &[Option<Ends>; WIDTH], words: &[u32; 16]) -> Option<String> {
        for (i, child) in boxes.iter().enumerate() {
            let Some([low, high]) = child else { continue };
            for k in 0..3 {
                let step = f64::from(f32::from_bits((words[3] >> (8 * k) & 255) << 23));
                let offset = |end| f64::from(words[word_of(i, k, end)] >> (8 * (i % 4)) & 255) * step;
                let start = f32::from_bits(words[k]);
                if !is_at_most(start, offset(0), low[k]) || !is_at_most(-start, -offset(1), -high[k]) {
                    return Some(format!("child {i} ends at {} and {} along axis {k}", low[k], high[k]));
                }
            }
        }
        None
    }

    /// Boxes of any size, at any distance, flat ones and none.
    fn nodes(random: &mut SplitMix64, n: usize) -> Vec<[Option<Ends>; WIDTH]> {
        let mut node = |round: usize| {
            let power = |of: &mut SplitMix64, most: usize| 2.0_f32.powi(i32::try_from(of.below(most)).unwrap() - 60);
            let (size, offset) = (power(random, 115), power(random, 115));
            let center: [f32; 3] = std::array::from_fn(|_| offset * ((random.unit() as f32) - 0.5));
            std::array::from_fn(|i| {
                if random.below(8) < round % 9 && i > 0 {
                    return None;
                }
                let low: [f32; 3] = std::array::from_fn(|k| center[k] + size * (random.unit() as f32));
                let extent =
                    if random.below(3) == 0 { 0.0 } else { size * (random.unit() as f32) * (random.unit() as f32) };
                Some([low, low.map(|x| x + extent * (random.unit() as f32))])
            })
        };
        (0..n).map(&mut node).collect()
    }

    #[test]
    fn bytes_hold_their_boxes() {
        let mut random = SplitMix64::new(44);
        let (mut n_smaller, mut n_found) = (0, 0);
        for boxes in nodes(&mut random, 20_000) {
            let words = packed(&boxes, 0);
            assert_eq!(flaw(&boxes, &words), None);
            // Ends of the CPU are outside of those of the device.
            for (ours, back) in boxes.iter().zip(unpacked(&words)) {
                let (Some([low, high]), Some([outer_low, outer_high])) = (ours, back) else {
                    assert_eq!(ours.is_some(), back.is_some());
                    continue;
                };
                assert!((0..3).all(|k| outer_low[k] <= low[k] && high[k] <= outer_high[k]));
            }
            // Ends that are a step further in are found: all but those that are rounded out by a whole step.
            for child in (0..WIDTH).filter(|&child| boxes[child].is_some()) {
                let mut smaller = words;
                let (word, shift) = (word_of(child, child % 3, 1), 8 * (child % 4));
                if smaller[word] >> shift & 255 > 1 {
                    smaller[word] -= 1 << shift;
                    n_smaller += 1;
                    n_found += usize::from(flaw(&boxes, &smaller).is_some());
                }
            }
        }
        assert!(n_smaller > 10_000 && 10 * n_found > 9 * n_smaller, "{n_found} of {n_smaller}");
    }

    /// Whichever zero is the lesser, exponents have eight bits, also of lengths that are no numbers.
    #[test]
    fn exponents_have_eight_bits() {
        for [low, high] in [[0.0, -0.0], [-0.0, 0.0], [0.0, f32::NAN], [-f32::MAX, f32::MAX]] {
            let words = packed(&std::array::from_fn(|i| (i < 3).then_some([[low; 3], [high; 3]])), 0b101);
            let exponents = [0, 8, 16].map(|shift| words[3] >> shift & 255);
            assert!(exponents.iter().all(|exponent| (27..254).contains(exponent)), "{low}, {high}: {exponents:?}");
            assert_eq!(words[3] >> 24, 0b101);
        }
    }

    /// The boxes of a node take at least half of the steps that bytes have, so they are rounded by little.
    #[test]
    fn most_bytes_are_used() {
        let mut random = SplitMix64::new(45);
        for boxes in nodes(&mut random, 2000) {
            let words = packed(&boxes, 0);
            for k in 0..3 {
                let of = |end: usize| boxes.iter().flatten().map(move |ends| ends[end][k]);
                let extent = of(1).fold(f32::NEG_INFINITY, f32::max) - of(0).fold(f32::INFINITY, f32::min);
                let most = (0..WIDTH).filter(|&i| boxes[i].is_some());
                let most = most.map(|i| words[word_of(i, k, 1)] >> (8 * (i % 4)) & 255).max().unwrap_or(0);
                assert!(most >= 127 || extent <= 256.0 * 2.0_f32.powi(-100), "{most}, {extent}");
            }
        }
    }
}
