//! Sums of samples, and the pictures that are their means.

mod aov;
mod dyadic;
mod guide;
mod part;
mod pixel;

pub use aov::{Aov, Aovs};
pub use dyadic::Block;
pub use dyadic::Dyadic;
pub(crate) use dyadic::total;
pub use guide::Guide;
pub use part::{JoinError, Part};
pub use pixel::Pixel;

use crate::Picture;

/// The pixels of a picture whose samples are summed, row 0 at the top.
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

    /// The picture of a part of all samples: the sums over its blocks, in order.
    ///
    /// # Panics
    /// Where the part has not `width * height` pixels.
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

    /// What camera rays meet first, row by row; empty where nothing of it was asked for.
    #[must_use]
    pub fn guides(&self) -> &[Guide] {
        &self.guides
    }

    /// The sums block by block, where a range of samples was asked for.
    #[must_use]
    pub fn part(&self) -> Option<&Part> {
        self.part.as_ref()
    }

    /// Samples taken, dropped ones too.
    #[must_use]
    pub fn n_samples(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.n_taken())).sum()
    }

    /// Samples that were not finite.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.n_dropped)).sum()
    }

    /// Column and row of the first pixel, row by row, that has a sample which was not finite.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "quotient and remainder by a u32 of what two u32 number")]
    pub fn first_dropped(&self) -> Option<[u32; 2]> {
        let index = self.pixels.iter().position(|pixel| pixel.n_dropped > 0)?;
        let width = self.width as usize;
        Some([(index % width) as u32, (index / width) as u32])
    }

    /// Rays traced, shadow rays included; none for parts read from files.
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

    /// The means, rounded to `f32`.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let pixels = self.pixels.iter().map(Pixel::rounded_mean).collect();
        Picture { width: self.width, height: self.height, pixels }
    }
}
