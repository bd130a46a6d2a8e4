use crate::render::Layout;
use crate::{Picture, Pixel, Settings, Tile};

/// What remains of a render that is stopped: its finished tiles, and black where there is none.
pub struct Partial {
    layout: Layout,
    n_done: usize,
    picture: Picture,
}

impl Partial {
    /// The picture of no tile yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let picture = Picture::filled(settings.width, settings.height, [0.0; 3]);
        Self { layout: Layout::new(settings), n_done: 0, picture }
    }

    /// Adds a finished tile of a render with these settings.
    ///
    /// # Panics
    /// Where the tile is of another render.
    pub fn add(&mut self, tile: &Tile) {
        assert!(self.layout.fits(tile), "tile {} is not of this picture", tile.number);
        let [left, top] = self.layout.corner(tile.number);
        let width = self.layout.size(tile.number)[0] as usize;
        let n_sums = self.layout.n_sums();
        for (row, pixels) in (top..).zip(tile.pixels.chunks(width * n_sums)) {
            let first = self.picture.index(left, row);
            for (place, sums) in self.picture.pixels[first..].iter_mut().zip(pixels.chunks(n_sums)) {
                let mean = sums.iter().fold(Pixel::default(), |all, &sum| all + sum).mean();
                #[expect(clippy::cast_possible_truncation, reason = "pictures have f32")]
                let mean = mean.map(|x| x as f32);
                *place = mean;
            }
        }
        self.n_done += 1;
    }

    /// Tiles that were added, and all that there are.
    #[must_use]
    pub fn n_tiles(&self) -> [usize; 2] {
        [self.n_done, self.layout.n_tiles()]
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
    fn tiles_stand_where_they_belong_and_the_rest_is_black() {
        let settings = Settings { width: 20, height: 10, tile: 8, ..Settings::default() };
        let mut partial = Partial::new(&settings);
        // The last tile of the first row: columns 16 to 19.
        let mut tile = Layout::new(&settings).tile(2);
        tile.pixels.fill(Pixel::of([1.0, 2.0, 4.0]) + Pixel::of([3.0, 2.0, 0.0]));
        partial.add(&tile);
        assert_eq!(partial.n_tiles(), [1, 6]);
        let picture = partial.picture();
        for (x, y, color) in [(16, 0, [2.0; 3]), (19, 7, [2.0; 3]), (15, 7, [0.0; 3]), (19, 8, [0.0; 3])] {
            assert_eq!(picture.pixels[picture.index(x, y)], color, "{x}, {y}");
        }
    }
}
