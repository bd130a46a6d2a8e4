//! Sums of samples, and pictures that are their means.

mod aov;
mod dyadic;
mod guide;
mod part;
mod pixel;

pub use aov::{Aov, AovValues, Aovs};
pub use dyadic::Block;
pub use dyadic::Dyadic;
pub(crate) use dyadic::total;
pub use guide::Guide;
pub use part::{JoinError, Part};
pub use pixel::Pixel;

use crate::Picture;
use crate::picture::cropped;

/// The sample sums of a picture, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    pixels: Vec<Pixel>,
    guides: Vec<Guide>,
    part: Option<Part>,
    n_rays: u64,
}

impl Film {
    pub(crate) fn new(width: u32, height: u32, pixels: Vec<Pixel>, guides: Vec<Guide>, n_rays: u64) -> Self {
        Self { width, height, pixels, guides, part: None, n_rays }
    }

    /// The film of a part of all samples.
    ///
    /// # Panics
    /// If the part does not have `width * height` pixels.
    #[must_use]
    pub fn of_part(width: u32, height: u32, part: Part, n_rays: u64) -> Self {
        let pixels: Vec<Pixel> = part.pixels().map(|sums| total(sums.iter().copied())).collect();
        assert_eq!(pixels.len(), width as usize * height as usize, "one pixel each");
        let guides = part.guides().map(|sums| total(sums.iter().copied())).collect();
        Self { part: Some(part), ..Self::new(width, height, pixels, guides, n_rays) }
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }

    /// AOV sums, row by row; empty without AOVs.
    #[must_use]
    pub fn guides(&self) -> &[Guide] {
        &self.guides
    }

    /// The sums block by block, if a range of samples was rendered.
    #[must_use]
    pub fn part(&self) -> Option<&Part> {
        self.part.as_ref()
    }

    /// The film without the sums of single blocks.
    #[must_use]
    pub fn without_part(self) -> Self {
        Self { part: None, ..self }
    }

    /// Samples taken, including dropped ones.
    #[must_use]
    pub fn n_samples(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.n_taken())).sum()
    }

    /// Samples that were dropped because they were not finite.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.n_dropped)).sum()
    }

    /// Column and row of the first pixel with a dropped sample.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "column and row of a picture of u32 sides")]
    pub fn first_dropped(&self) -> Option<[u32; 2]> {
        let index = self.pixels.iter().position(|pixel| pixel.n_dropped > 0)?;
        let width = self.width as usize;
        Some([(index % width) as u32, (index / width) as u32])
    }

    /// Rays traced, including shadow rays; zero for parts read from files.
    #[must_use]
    pub fn n_rays(&self) -> u64 {
        self.n_rays
    }

    /// Relative standard error of the luminance: root of the mean of [`Pixel::squared_error`] over all pixels.
    #[must_use]
    pub fn error(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "pixels are fewer than 2^53")]
        let n = self.pixels.len() as f64;
        (self.pixels.iter().map(Pixel::squared_error).sum::<f64>() / n).sqrt()
    }

    /// The part of the film with this top left corner and this size; the rays are those of the whole film.
    ///
    /// # Panics
    /// If it exceeds the film, or the film is a part of all samples.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        assert!(self.part.is_none(), "a part is merged whole");
        let pixels = cropped(&self.pixels, self.width, corner, size);
        let guides = if self.guides.is_empty() { Vec::new() } else { cropped(&self.guides, self.width, corner, size) };
        Self::new(size[0], size[1], pixels, guides, self.n_rays)
    }

    /// The means as a picture.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let pixels = self.pixels.iter().map(Pixel::rounded_mean).collect();
        Picture { width: self.width, height: self.height, pixels }
    }
}
