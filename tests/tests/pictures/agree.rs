//! Whether two noisy pictures of one scene show the same light.

use canted_film::{Film, Picture};

/// Side of a block in pixels.
pub(crate) const BLOCK: u32 = 16;

/// Greatest relative difference of the mean from that of the reference.
const MEAN: f64 = 0.005;

/// Probability that noise alone makes two equal pictures disagree.
const FALSE_ALARM: f64 = 1e-3;

/// Relative rounding error of the references, which have half precision: 11 bits.
const HALF: f64 = 1.0 / 2048.0;

/// Means of red, green and blue in a block of pixels, and their standard errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) mean: [f64; 3],
    pub(crate) error: [f64; 3],
    /// Number of pixels in the block.
    pub(crate) area: f64,
}

/// The blocks of a film with independent samples.
pub(crate) fn blocks_of_film(film: &Film) -> Vec<Block> {
    let pixel = |i: usize| (film.pixels()[i].mean(), film.pixels()[i].variance_of_mean());
    blocks(film.width(), film.height(), pixel)
}

/// The blocks of a reference, with an error for each block.
pub(crate) fn blocks_of_reference(mean: &Picture, errors: &[[f64; 3]]) -> Vec<Block> {
    let mut blocks = blocks(mean.width, mean.height, |i| (mean.pixels[i].map(f64::from), [0.0; 3]));
    assert_eq!(blocks.len(), errors.len(), "one error per block");
    blocks.iter_mut().zip(errors).for_each(|(block, error)| block.error = *error);
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

/// Why two pictures disagree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Disagreement {
    /// The noise is too high to compare the means.
    Noise { channel: usize, relative_error: f64 },
    /// The mean radiance differs.
    Mean { channel: usize, ratio: f64 },
    /// The mean of a block differs by more than the noise of both explains.
    Block { block: usize, channel: usize, ours: f64, theirs: f64, bound: f64 },
}

/// Compares the means of the pictures, and of each block.
///
/// The means agree within [`MEAN`]; three standard errors of both must be less, or the comparison could not fail. Blocks agree
/// within `q·√(a² + b²)`, where `a` and `b` are their standard errors, plus the rounding of the reference. With `n`
/// comparisons `q = √(2·ln(n/p))`: a normal deviate exceeds `q` with a probability of at most `exp(-q²/2)`, both tails
/// together, so one of `n` does with at most `p`, [`FALSE_ALARM`].
pub(crate) fn agree(ours: &[Block], theirs: &[Block]) -> Result<(), Disagreement> {
    assert_eq!(ours.len(), theirs.len(), "pictures of equal size");
    for channel in 0..3 {
        agree_in_mean(channel, ours, theirs)?;
    }
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

/// Whether a difference is at most a bound; false if either is NaN.
fn is_within(difference: f64, bound: f64) -> bool {
    difference.abs() <= bound
}
