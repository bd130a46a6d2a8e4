//! Whether two pictures of one scene, both noisy, show the same light.

use canted_film::{Film, Picture};

/// Pixels along the side of a block.
pub(crate) const BLOCK: u32 = 16;

/// How far the mean of a picture may be from that of the reference.
const MEAN: f64 = 0.005;

/// Probability with which noise alone may make two equal pictures disagree.
const FALSE_ALARM: f64 = 1e-3;

/// Relative rounding error of the references' numbers, which are of half precision: 11 bits.
const HALF: f64 = 1.0 / 2048.0;

/// Red, green and blue of a block of pixels: their means, and the standard errors of those.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) mean: [f64; 3],
    pub(crate) error: [f64; 3],
    /// Pixels in the block.
    pub(crate) area: f64,
}

/// The blocks of a film whose samples are independent of each other.
pub(crate) fn blocks_of_film(film: &Film) -> Vec<Block> {
    let pixel = |i: usize| (film.pixels()[i].mean(), film.pixels()[i].variance_of_mean());
    blocks(film.width(), film.height(), pixel)
}

/// The blocks of a reference, with their errors from a second picture of one pixel a block.
pub(crate) fn blocks_of_reference(mean: &Picture, errors: &Picture) -> Vec<Block> {
    let mut blocks = blocks(mean.width, mean.height, |i| (mean.pixels[i].map(f64::from), [0.0; 3]));
    assert_eq!(blocks.len(), errors.pixels.len(), "one error a block");
    for (block, error) in blocks.iter_mut().zip(&errors.pixels) {
        block.error = error.map(f64::from);
    }
    blocks
}

/// Blocks from the mean and the variance of the mean of each pixel, row by row.
fn blocks(width: u32, height: u32, pixel: impl Fn(usize) -> ([f64; 3], [f64; 3])) -> Vec<Block> {
    let corners =
        (0..height).step_by(BLOCK as usize).flat_map(|y| (0..width).step_by(BLOCK as usize).map(move |x| (x, y)));
    let block = |(left, top): (u32, u32)| {
        let (right, bottom) = ((left + BLOCK).min(width), (top + BLOCK).min(height));
        let area = f64::from(right - left) * f64::from(bottom - top);
        let (mut mean, mut variance) = ([0.0; 3], [0.0; 3]);
        for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
            let (of_mean, of_variance) = pixel(y as usize * width as usize + x as usize);
            for k in 0..3 {
                mean[k] += of_mean[k] / area;
                variance[k] += of_variance[k] / (area * area);
            }
        }
        Block { mean, error: variance.map(f64::sqrt), area }
    };
    corners.map(block).collect()
}

/// Why two pictures are not of the same light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Disagreement {
    /// The noise is too great for the means to say anything.
    Noise { channel: usize, relative_error: f64 },
    /// The mean radiance differs.
    Mean { channel: usize, ratio: f64 },
    /// The mean of a block differs by more than both noises explain.
    Block { block: usize, channel: usize, ours: f64, theirs: f64, bound: f64 },
}

/// Compares the means of the pictures, and each block.
///
/// The means agree within [`MEAN`]; three standard errors of both must fit in that, or the comparison would be blind.
/// Blocks agree within `q·√(a² + b²)`, `a` and `b` their standard errors, and the rounding of the reference. With `n`
/// comparisons `q = √(2·ln(n/p))`, for a normal deviate exceeds `q` with a probability of at most `exp(-q²/2)`, both
/// tails together, so that one of `n` does with at most `p`, [`FALSE_ALARM`].
pub(crate) fn agree(ours: &[Block], theirs: &[Block]) -> Result<(), Disagreement> {
    assert_eq!(ours.len(), theirs.len(), "pictures of one size");
    for channel in 0..3 {
        agree_in_mean(channel, ours, theirs)?;
    }
    #[expect(clippy::cast_precision_loss, reason = "there are few blocks")]
    let quantile = (2.0 * (3.0 * ours.len() as f64 / FALSE_ALARM).ln()).sqrt();
    for (block, (a, b)) in ours.iter().zip(theirs).enumerate() {
        for channel in 0..3 {
            let [ours, theirs] = [a, b].map(|block| block.mean[channel]);
            let bound = quantile * a.error[channel].hypot(b.error[channel]) + HALF * theirs;
            if !is_within(ours - theirs, bound) {
                return Err(Disagreement::Block { block, channel, ours, theirs, bound });
            }
        }
    }
    Ok(())
}

fn agree_in_mean(channel: usize, ours: &[Block], theirs: &[Block]) -> Result<(), Disagreement> {
    let sum = |blocks: &[Block]| blocks.iter().map(|block| block.area * block.mean[channel]).sum::<f64>();
    let square = |blocks: &[Block]| blocks.iter().map(|block| (block.area * block.error[channel]).powi(2)).sum::<f64>();
    let relative_error = (square(ours) + square(theirs)).sqrt() / sum(theirs);
    let ratio = sum(ours) / sum(theirs);
    if !is_within(3.0 * relative_error, MEAN) {
        return Err(Disagreement::Noise { channel, relative_error });
    }
    if !is_within(ratio - 1.0, MEAN) {
        return Err(Disagreement::Mean { channel, ratio });
    }
    Ok(())
}

/// Whether a difference is at most a bound; where either is not a number it is not.
fn is_within(difference: f64, bound: f64) -> bool {
    difference.abs() <= bound
}
