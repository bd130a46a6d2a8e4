use crate::film::total;
use crate::render::Layout;
use crate::{Film, Guide, Picture, Pixel, Settings, Tile};

/// What remains of a render that is stopped: its finished tiles, and black where there is none.
pub struct Partial {
    layout: Layout,
    n_done: usize,
    picture: Picture,
    /// The sums behind the picture, where channels beside light are asked for; else nothing.
    sums: Vec<(Pixel, Guide)>,
    n_rays: u64,
}

impl Partial {
    /// The picture of no tile yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let picture = Picture::filled(settings.width, settings.height, [0.0; 3]);
        let layout = Layout::new(settings);
        let n_sums = if layout.is_guided() { picture.pixels.len() } else { 0 };
        Self { layout, n_done: 0, picture, sums: vec![Default::default(); n_sums], n_rays: 0 }
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
                let mean = total(sums.iter().copied()).mean();
                #[expect(clippy::cast_possible_truncation, reason = "pictures have f32")]
                let mean = mean.map(|x| x as f32);
                *place = mean;
            }
        }
        if self.layout.is_guided() {
            self.add_sums(tile);
        }
        self.n_done += 1;
        self.n_rays += tile.n_rays;
    }

    /// Tiles that were added, and all that there are.
    #[must_use]
    pub fn n_tiles(&self) -> [usize; 2] {
        [self.n_done, self.layout.n_tiles()]
    }

    fn add_sums(&mut self, tile: &Tile) {
        let [left, top] = self.layout.corner(tile.number);
        let width = self.layout.size(tile.number)[0] as usize;
        let n_sums = self.layout.n_sums();
        let all = |sums: (&[Pixel], &[Guide])| (total(sums.0.iter().copied()), total(sums.1.iter().copied()));
        let mut sums = tile.pixels.chunks(n_sums).zip(tile.guides.chunks(n_sums)).map(all);
        for row in (top..).take(tile.pixels.len() / (width * n_sums)) {
            let first = self.picture.index(left, row);
            self.sums[first..first + width].iter_mut().zip(&mut sums).for_each(|(place, sums)| *place = sums);
        }
    }

    /// The film, where the settings ask for channels beside light.
    #[must_use]
    pub fn film(&self) -> Option<Film> {
        let (pixels, guides) = self.sums.iter().copied().unzip();
        let Picture { width, height, .. } = self.picture;
        self.layout.is_guided().then(|| Film::new(width, height, pixels, guides, self.n_rays))
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
    use crate::{Aov, Aovs};

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
        assert!(partial.film().is_none(), "nothing is kept beside light");
    }

    #[test]
    fn what_is_asked_for_beside_light_is_kept() {
        let aovs = Aovs::NONE.with(Aov::Depth);
        let settings = Settings { width: 20, height: 10, tile: 8, aovs, ..Settings::default() };
        let mut partial = Partial::new(&settings);
        let mut tile = Layout::new(&settings).tile(2);
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
