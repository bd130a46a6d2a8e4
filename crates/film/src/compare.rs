use std::fmt;

use crate::Picture;

/// `ε` of [`Comparison::rel_mse`], in squared linear radiance: below a tenth of white, differences count as absolute.
pub const REL_MSE_FLOOR: f64 = 1e-2;

/// The error of a picture against a reference, over all channels of all pixels that are finite in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Mean of the picture over mean of the reference; 1 where both are black.
    pub mean_ratio: f64,
    /// Mean squared difference.
    pub mse: f64,
    /// Root mean squared difference.
    pub rmse: f64,
    /// Mean absolute difference.
    pub mae: f64,
    /// Mean of `(a - b)² / (b² + ε)` with the reference `b` and `ε` = [`REL_MSE_FLOOR`].
    pub rel_mse: f64,
    /// Greatest absolute difference of a channel.
    pub max_difference: f64,
    /// Pixels that are not finite in both pictures, and therefore skipped.
    pub n_not_finite: usize,
}

/// Compares `picture` with `reference`, both linear.
///
/// # Errors
/// [`CompareError::Size`] if the sizes differ, [`CompareError::NothingFinite`] if no pixel is finite in both.
pub fn compare(picture: &Picture, reference: &Picture) -> Result<Comparison, CompareError> {
    check_sizes(picture, reference)?;
    let (mut sums, mut squares, mut relative, mut absolute, mut max_difference) = ([0.0; 2], 0.0, 0.0, 0.0, 0.0_f64);
    let mut n_pixels = 0;
    for (a, b) in picture.pixels.iter().zip(&reference.pixels).filter(|(a, b)| are_finite(a, b)) {
        n_pixels += 1;
        for (a, b) in a.map(f64::from).into_iter().zip(b.map(f64::from)) {
            let square = (a - b) * (a - b);
            sums[0] += a;
            sums[1] += b;
            squares += square;
            absolute += (a - b).abs();
            relative += square / (b * b + REL_MSE_FLOOR);
            max_difference = max_difference.max((a - b).abs());
        }
    }
    if n_pixels == 0 {
        return Err(CompareError::NothingFinite);
    }
    let n_channels = 3.0 * n_pixels as f64;
    Ok(Comparison {
        mean_ratio: if sums == [0.0; 2] { 1.0 } else { sums[0] / sums[1] },
        mse: squares / n_channels,
        rmse: (squares / n_channels).sqrt(),
        mae: absolute / n_channels,
        rel_mse: relative / n_channels,
        max_difference,
        n_not_finite: picture.pixels.len() - n_pixels,
    })
}

/// Rejects pictures of different sizes.
pub(crate) fn check_sizes(picture: &Picture, reference: &Picture) -> Result<(), CompareError> {
    let [picture, reference] = [picture, reference].map(|picture| [picture.width, picture.height]);
    if picture == reference { Ok(()) } else { Err(CompareError::Size { picture, reference }) }
}

/// Whether all channels of both pixels are finite.
pub(crate) fn are_finite(a: &[f32; 3], b: &[f32; 3]) -> bool {
    a.iter().chain(b).all(|x| x.is_finite())
}

/// Why two pictures cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompareError {
    /// The sizes differ.
    Size {
        /// Width and height of the picture.
        picture: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
    /// No pixel is finite in both.
    NothingFinite,
}

impl fmt::Display for CompareError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { picture: [w, h], reference: [rw, rh] } => {
                write!(f, "a picture of {w} x {h} pixels cannot be compared with one of {rw} x {rh}")
            }
            Self::NothingFinite => write!(f, "no pixel is finite in both pictures"),
        }
    }
}

impl std::error::Error for CompareError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a unit in the last place: the rounding of 1.3, which exceeds that of all results.
    const KNOWN: f64 = 0.5 * f32::EPSILON as f64;

    #[test]
    fn known_errors() {
        let reference = Picture::filled(2, 1, [1.0; 3]);
        let mut picture = reference.clone();
        picture.pixels[0] = [1.3, 1.0, 1.0];
        let result = compare(&picture, &reference).unwrap();
        // One channel of six is off by 0.3.
        assert!((result.mean_ratio - 6.3 / 6.0).abs() <= KNOWN);
        assert!((result.rmse - (0.09_f64 / 6.0).sqrt()).abs() <= KNOWN);
        assert!((result.mse - 0.09 / 6.0).abs() <= KNOWN);
        assert!((result.mae - 0.3 / 6.0).abs() <= KNOWN);
        assert!((result.rel_mse - 0.09 / 1.01 / 6.0).abs() <= KNOWN);
        assert!((result.max_difference - 0.3).abs() <= KNOWN);
        assert_eq!(result.n_not_finite, 0);
    }

    #[test]
    fn equal_pictures_have_no_error() {
        for value in [0.0, 0.5, 1e30] {
            let picture = Picture::filled(3, 2, [value; 3]);
            let found = compare(&picture, &picture).unwrap();
            assert_eq!((found.mean_ratio, found.max_difference, found.n_not_finite), (1.0, 0.0, 0));
            assert_eq!([found.mse, found.rmse, found.mae, found.rel_mse], [0.0; 4]);
        }
    }

    #[test]
    fn pixels_that_are_not_finite_are_skipped_and_other_sizes_rejected() {
        let reference = Picture::filled(2, 1, [1.0; 3]);
        let mut picture = reference.clone();
        picture.pixels[1] = [f32::NAN, 5.0, 5.0];
        let result = compare(&picture, &reference).unwrap();
        assert_eq!((result.n_not_finite, result.rmse), (1, 0.0));
        picture.pixels[0] = [f32::INFINITY; 3];
        assert_eq!(compare(&picture, &reference), Err(CompareError::NothingFinite));
        let error = compare(&picture, &Picture::filled(2, 3, [0.0; 3])).unwrap_err();
        assert_eq!(error, CompareError::Size { picture: [2, 1], reference: [2, 3] });
        assert_eq!(error.to_string(), "a picture of 2 x 1 pixels cannot be compared with one of 2 x 3");
    }
}
