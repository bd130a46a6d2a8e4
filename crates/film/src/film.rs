//! Sums of samples, and pictures that are their means.

mod aov;
mod builder;
mod dyadic;
mod guide;
mod part;
mod pixel;

pub use aov::{Aov, AovValues, Aovs};
pub use builder::FilmBuilder;
use builder::Means;
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
    /// Empty if only means are kept.
    pixels: Vec<Pixel>,
    means: Option<Means>,
    guides: Vec<Guide>,
    part: Option<Part>,
    n_rays: u64,
}

impl Film {
    pub(crate) fn new(width: u32, height: u32, pixels: Vec<Pixel>, guides: Vec<Guide>, n_rays: u64) -> Self {
        Self { width, height, pixels, means: None, guides, part: None, n_rays }
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

    /// All pixels, row by row; empty if only means are kept, see [`Tiling::means_only`](crate::Tiling::means_only).
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
        let sum = || self.pixels.iter().map(|pixel| u64::from(pixel.n_taken())).sum();
        self.means.as_ref().map_or_else(sum, |means| means.n_samples)
    }

    /// Samples that were dropped because they were not finite.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        let sum = || self.pixels.iter().map(|pixel| u64::from(pixel.n_dropped)).sum();
        self.means.as_ref().map_or_else(sum, |means| means.n_dropped)
    }

    /// Column and row of the first pixel with a dropped sample.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "column and row of a picture of u32 sides")]
    pub fn first_dropped(&self) -> Option<[u32; 2]> {
        let find = || self.pixels.iter().position(|pixel| pixel.n_dropped > 0);
        let index = self.means.as_ref().map_or_else(find, |means| means.first_dropped)?;
        let width = self.width as usize;
        Some([(index % width) as u32, (index / width) as u32])
    }

    /// Rays traced, including shadow rays; zero for parts read from files.
    #[must_use]
    pub fn n_rays(&self) -> u64 {
        self.n_rays
    }

    /// Relative standard error of the luminance: root of the mean of [`Pixel::squared_error`] over all pixels; NaN if only means are
    /// kept.
    #[must_use]
    pub fn error(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "pixels are fewer than 2^53")]
        let n = self.pixels.len() as f64;
        (self.pixels.iter().map(Pixel::squared_error).sum::<f64>() / n).sqrt()
    }

    /// The part of the film with this top left corner and this size; the rays are those of the whole film, and without sums so are the
    /// numbers of samples.
    ///
    /// # Panics
    /// If it exceeds the film, or the film is a part of all samples.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        assert!(self.part.is_none(), "a part is merged whole");
        let means = self.means.as_ref().map(|means| {
            let pixels = cropped(&means.pixels, self.width, corner, size);
            Means { pixels, ..*means }
        });
        let pixels = if means.is_some() { Vec::new() } else { cropped(&self.pixels, self.width, corner, size) };
        let guides = if self.guides.is_empty() { Vec::new() } else { cropped(&self.guides, self.width, corner, size) };
        Self { means, ..Self::new(size[0], size[1], pixels, guides, self.n_rays) }
    }

    /// The means as a picture.
    #[must_use]
    pub fn picture(&self) -> Picture {
        Picture { width: self.width, height: self.height, pixels: self.colors().collect() }
    }

    /// [`Film::picture`] in place of the film, which needs no further memory if only means are kept.
    #[must_use]
    pub fn into_picture(self) -> Picture {
        match self.means {
            Some(means) => Picture { width: self.width, height: self.height, pixels: means.pixels },
            None => self.picture(),
        }
    }

    /// The means, row by row.
    pub fn colors(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        let means = self.means.iter().flat_map(|means| means.pixels.iter().copied());
        self.pixels.iter().map(Pixel::rounded_mean).chain(means)
    }
}
