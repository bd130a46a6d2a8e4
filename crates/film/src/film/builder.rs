use super::Film;
use crate::{Guide, Picture, Pixel, Tile, Tiling};

/// What a film without sums keeps: 12 bytes per pixel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Means {
    pub(super) pixels: Vec<[f32; 3]>,
    pub(super) n_samples: u64,
    pub(super) n_dropped: u64,
    /// Index of the first pixel with a dropped sample.
    pub(super) first_dropped: Option<usize>,
}

impl Means {
    fn set(&mut self, index: usize, pixel: &Pixel) {
        self.pixels[index] = pixel.rounded_mean();
        self.n_samples += u64::from(pixel.n_taken());
        self.n_dropped += u64::from(pixel.n_dropped);
        if pixel.n_dropped > 0 {
            self.first_dropped = Some(self.first_dropped.map_or(index, |first| first.min(index)));
        }
    }
}

/// A film whose tiles arrive in any order. Each is copied at once, so that none has to be kept.
#[derive(Clone, Debug)]
pub struct FilmBuilder {
    tiling: Tiling,
    pixels: Vec<Pixel>,
    guides: Vec<Guide>,
    means: Option<Means>,
    n_rays: u64,
}

impl FilmBuilder {
    /// A film without samples.
    #[must_use]
    pub fn new(tiling: Tiling) -> Self {
        let [width, height] = tiling.picture_size();
        let n_pixels = width as usize * height as usize;
        let means = tiling.keeps_means_only().then(|| {
            let black = Picture::filled(width, height, [0.0; 3]);
            Means { pixels: black.pixels, n_samples: 0, n_dropped: 0, first_dropped: None }
        });
        let n = if means.is_some() { 0 } else { n_pixels * tiling.n_sums() };
        let guides = vec![Guide::default(); if tiling.has_guides() { n } else { 0 }];
        Self { tiling, pixels: vec![Pixel::default(); n], guides, means, n_rays: 0 }
    }

    /// Adds a finished tile, each once.
    ///
    /// # Panics
    /// If the tile does not [fit](Tiling::fits).
    pub fn add(&mut self, tile: &Tile) {
        let tiling = &self.tiling;
        assert!(tiling.fits(tile), "tile {} does not belong to this picture", tile.number);
        self.n_rays += tile.n_rays;
        if let Some(means) = &mut self.means {
            tiling.totals(tile).for_each(|(index, pixel, _)| means.set(index, &pixel));
            return;
        }
        let n_sums = tiling.n_sums();
        let run = tiling.size(tile.number)[0] as usize * n_sums;
        for (row, first) in tiling.rows(tile.number).enumerate() {
            let (row, all) = (row * run..(row + 1) * run, first * n_sums..first * n_sums + run);
            self.pixels[all.clone()].copy_from_slice(&tile.pixels[row.clone()]);
            if tiling.has_guides() {
                self.guides[all].copy_from_slice(&tile.guides[row]);
            }
        }
    }

    /// The film; pixels of missing tiles have no sample.
    #[must_use]
    pub fn film(self) -> Film {
        let Self { tiling, pixels, guides, means, n_rays } = self;
        let [width, height] = tiling.picture_size();
        match tiling.part() {
            Some(range) => Film::of_part(width, height, super::Part::new(range, pixels, guides), n_rays),
            None => Film { means, ..Film::new(width, height, pixels, guides, n_rays) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A film of four tiles, one of which has a dropped sample in its first pixel, and three of which are added.
    fn film(tiling: &Tiling) -> Film {
        let mut builder = FilmBuilder::new(tiling.clone());
        for number in [3, 1, 2] {
            let mut tile = tiling.tile(number);
            tile.pixels.fill(Pixel::of([0.1, 0.2, 0.7]) + Pixel::of([0.3, 0.0, 0.1]));
            tile.pixels[0] = tile.pixels[0] + Pixel::of([f32::NAN; 3]);
            tile.n_rays = 5;
            builder.add(&tile);
        }
        builder.film()
    }

    #[test]
    fn means_alone_are_those_of_the_sums() {
        let tiling = Tiling::new([11, 13], 8, None, false);
        let (sums, means) = (film(&tiling), film(&tiling.means_only()));
        assert!(!sums.pixels().is_empty() && means.pixels().is_empty());
        assert_eq!(sums.picture(), means.picture());
        assert_eq!(sums.picture(), means.clone().into_picture());
        let facts = |film: &Film| (film.n_samples(), film.n_dropped(), film.first_dropped(), film.n_rays());
        assert_eq!(facts(&sums), facts(&means));
        assert_eq!(facts(&means), (2 * (11 * 13 - 64) + 3, 3, Some([8, 0]), 15));
        let crop = |film: &Film| film.cropped([5, 6], [3, 4]).picture();
        assert_eq!(crop(&sums), crop(&means));
    }

    #[test]
    #[should_panic(expected = "tile 4 does not belong to this picture")]
    fn tiles_of_other_pictures_are_rejected() {
        let tile = Tiling::new([24, 24], 8, None, false).tile(4);
        FilmBuilder::new(Tiling::new([11, 13], 8, None, false)).add(&tile);
    }
}
