use crate::{Film, Guide, Picture, Pixel, Tile, Tiling};

/// The picture of a render that was stopped: its finished tiles, and black elsewhere.
pub struct Partial {
    tiling: Tiling,
    n_finished: usize,
    picture: Picture,
    /// Sums of each pixel, stored only where AOVs are requested.
    sums: Vec<(Pixel, Guide)>,
    n_rays: u64,
}

impl Partial {
    /// A picture without finished tiles.
    #[must_use]
    pub fn new(tiling: Tiling) -> Self {
        let [width, height] = tiling.picture_size();
        let picture = Picture::filled(width, height, [0.0; 3]);
        let n_sums = if tiling.has_guides() { picture.pixels.len() } else { 0 };
        Self { tiling, n_finished: 0, picture, sums: vec![Default::default(); n_sums], n_rays: 0 }
    }

    /// Adds a finished tile.
    ///
    /// # Panics
    /// If the tile does not [fit](Tiling::fits).
    pub fn add(&mut self, tile: &Tile) {
        assert!(self.tiling.fits(tile), "tile {} does not belong to this picture", tile.number);
        for (index, pixel, guide) in self.tiling.totals(tile) {
            self.picture.pixels[index] = pixel.rounded_mean();
            if let Some(sums) = self.sums.get_mut(index) {
                *sums = (pixel, guide);
            }
        }
        self.n_finished += 1;
        self.n_rays += tile.n_rays;
    }

    /// Number of tiles added, and of all tiles.
    #[must_use]
    pub fn n_tiles(&self) -> [usize; 2] {
        [self.n_finished, self.tiling.n_tiles()]
    }

    /// The film, where AOVs are requested.
    #[must_use]
    pub fn film(&self) -> Option<Film> {
        let (pixels, guides) = self.sums.iter().copied().unzip();
        let Picture { width, height, .. } = self.picture;
        self.tiling.has_guides().then(|| Film::new(width, height, pixels, guides, self.n_rays))
    }

    /// The picture.
    #[must_use]
    pub fn picture(&self) -> &Picture {
        &self.picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finished_tiles_appear_and_the_rest_is_black() {
        let tiling = Tiling::new([20, 10], 8, None, false);
        let mut partial = Partial::new(tiling.clone());
        // The last tile of the first row: columns 16 to 19.
        let mut tile = tiling.tile(2);
        tile.pixels.fill(Pixel::of([1.0, 2.0, 4.0]) + Pixel::of([3.0, 2.0, 0.0]));
        partial.add(&tile);
        assert_eq!(partial.n_tiles(), [1, 6]);
        let picture = partial.picture();
        for (x, y, color) in [(16, 0, [2.0; 3]), (19, 7, [2.0; 3]), (15, 7, [0.0; 3]), (19, 8, [0.0; 3])] {
            assert_eq!(picture.pixels[picture.index(x, y)], color, "{x}, {y}");
        }
        assert!(partial.film().is_none(), "no AOV is stored");
    }

    #[test]
    fn requested_aovs_are_stored() {
        let tiling = Tiling::new([20, 10], 8, None, true);
        let mut partial = Partial::new(tiling.clone());
        let mut tile = tiling.tile(2);
        tile.pixels.fill(Pixel::of([1.0, 2.0, 4.0]));
        tile.guides.fill(Guide { n_hits: 1, depth: 3.0, ..Guide::default() });
        partial.add(&tile);
        let film = partial.film().unwrap();
        assert_eq!(film.picture().pixels, partial.picture().pixels);
        for (x, y, depth) in [(16, 0, 3.0), (19, 7, 3.0), (15, 7, 0.0), (19, 8, 0.0)] {
            assert_eq!(film.guides()[partial.picture().index(x, y)].depth, depth, "{x}, {y}");
        }
    }
}
