//! `--denoise`: the filtered picture of a film.

use anyhow::{Result, anyhow};
use canted_film::{
    Film, Picture,
    denoise::{Denoise, Noisy, REACH, denoise},
};

/// The rectangle that must be rendered so that the filtered picture in `crop` is that of the whole picture.
pub(super) fn with_margin([left, top, width, height]: [u32; 4], size: [u32; 2]) -> [u32; 4] {
    let along = |first: u32, n: u32, n_all: u32| {
        let start = first.saturating_sub(REACH);
        (start, (first + n).saturating_add(REACH).min(n_all) - start)
    };
    let ((left, width), (top, height)) = (along(left, width, size[0]), along(top, height, size[1]));
    [left, top, width, height]
}

/// The filtered picture of a film with guides, or the part of it in `crop`.
///
/// # Errors
/// A film without guides.
pub(crate) fn denoised(film: &Film, crop: Option<[u32; 4]>) -> Result<Picture> {
    let noisy =
        Noisy::of_film(film).ok_or_else(|| anyhow!("the film has no albedo, normal and depth to guide the filter"))?;
    let config = Denoise::default();
    let Some(crop) = crop else { return Ok(denoise(noisy, &config)) };
    let [left, top, width, height] = with_margin(crop, [film.width(), film.height()]);
    let picture = denoise(noisy.cropped([left, top], [width, height]), &config);
    Ok(picture.cropped([crop[0] - left, crop[1] - top], [crop[2], crop[3]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_end_at_the_borders() {
        assert_eq!(with_margin([0, 0, 4, 4], [1000, 1000]), [0, 0, 4 + REACH, 4 + REACH]);
        let [left, top, width, height] = with_margin([500, 10, 4, 4], [1000, 20]);
        assert_eq!([left, width], [500 - REACH, 4 + 2 * REACH]);
        assert_eq!([top, height], [0, 20]);
    }
}
