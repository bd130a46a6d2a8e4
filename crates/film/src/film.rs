//! Films: the sums of all pixels of a picture, whole, under construction and unfinished.

use std::collections::VecDeque;

use crate::picture::cropped;
use crate::sums::{Components, Guide, Part, Pixel, total};
use crate::tiling::Total;
use crate::{Picture, Tile, Tiling};

/// The sample sums of a picture, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    /// Empty if only means are kept.
    pixels: Vec<Pixel>,
    means: Option<Means>,
    guides: Vec<Guide>,
    components: Vec<Components>,
    part: Option<Part>,
    n_rays: u64,
}

impl Film {
    pub(crate) fn new(width: u32, height: u32, pixels: Vec<Pixel>, guides: Vec<Guide>, n_rays: u64) -> Self {
        Self { width, height, pixels, means: None, guides, components: Vec::new(), part: None, n_rays }
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
        let components = part.components().map(|sums| total(sums.iter().copied())).collect();
        Self { components, part: Some(part), ..Self::new(width, height, pixels, guides, n_rays) }
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

    /// The light of each pixel in its parts, row by row; empty where none is requested.
    #[must_use]
    pub fn components(&self) -> &[Components] {
        &self.components
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
        let has_components = !self.components.is_empty();
        let components = if has_components { cropped(&self.components, self.width, corner, size) } else { Vec::new() };
        Self { means, components, ..Self::new(size[0], size[1], pixels, guides, self.n_rays) }
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

    /// The part of the samples of each pixel that hit something, row by row; empty without AOVs. Samples of negative weight count as others.
    #[must_use]
    pub fn alpha(&self) -> Vec<f32> {
        let part = |(guide, pixel): (&Guide, &Pixel)| guide.n_hits as f32 / pixel.n_taken().max(1) as f32;
        self.guides.iter().zip(&self.pixels).map(part).collect()
    }

    /// The means, row by row.
    pub fn colors(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        let means = self.means.iter().flat_map(|means| means.pixels.iter().copied());
        self.pixels.iter().map(Pixel::rounded_mean).chain(means)
    }
}

/// What a film without sums keeps: 12 bytes per pixel.
#[derive(Clone, Debug, PartialEq)]
struct Means {
    pixels: Vec<[f32; 3]>,
    n_samples: u64,
    n_dropped: u64,
    /// Index of the first pixel with a dropped sample.
    first_dropped: Option<usize>,
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
    components: Vec<Components>,
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
        let components = vec![Components::default(); if tiling.has_components() { n } else { 0 }];
        Self { tiling, pixels: vec![Pixel::default(); n], guides, components, means, n_rays: 0 }
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
            tiling.totals(tile).for_each(|Total { index, pixel, .. }| means.set(index, &pixel));
            return;
        }
        let n_sums = tiling.n_sums();
        let run = tiling.size(tile.number)[0] as usize * n_sums;
        for (row, first) in tiling.rows(tile.number).enumerate() {
            let (row, all) = (row * run..(row + 1) * run, first * n_sums..first * n_sums + run);
            self.pixels[all.clone()].copy_from_slice(&tile.pixels[row.clone()]);
            if tiling.has_guides() {
                self.guides[all.clone()].copy_from_slice(&tile.guides[row.clone()]);
            }
            if tiling.has_components() {
                self.components[all].copy_from_slice(&tile.components[row]);
            }
        }
    }

    /// The film; pixels of missing tiles have no sample.
    #[must_use]
    pub fn film(self) -> Film {
        let Self { tiling, pixels, guides, components, means, n_rays } = self;
        let [width, height] = tiling.picture_size();
        match tiling.part() {
            Some(range) => Film::of_part(width, height, Part::new(range, pixels, guides, components), n_rays),
            None => Film { means, components, ..Film::new(width, height, pixels, guides, n_rays) },
        }
    }
}

/// The picture of a render that was stopped: its finished tiles, and black elsewhere.
pub struct Partial {
    tiling: Tiling,
    /// Of each tile.
    is_finished: Vec<bool>,
    /// Whether each tile was added with samples; what a crop does not show has none.
    has_samples: Vec<bool>,
    picture: Picture,
    /// Sums of each pixel, stored only where AOVs are requested.
    sums: Vec<(Pixel, Guide)>,
    /// The light of each pixel in its parts, likewise.
    components: Vec<Components>,
    n_rays: u64,
}

impl Partial {
    /// A picture without finished tiles.
    #[must_use]
    pub fn new(tiling: Tiling) -> Self {
        let [width, height] = tiling.picture_size();
        let picture = Picture::filled(width, height, [0.0; 3]);
        let n_if = |is_stored: bool| if is_stored { picture.pixels.len() } else { 0 };
        let sums = vec![Default::default(); n_if(tiling.has_guides())];
        let components = vec![Components::default(); n_if(tiling.has_components())];
        let [is_finished, has_samples] = [(); 2].map(|()| vec![false; tiling.n_tiles()]);
        Self { tiling, is_finished, has_samples, picture, sums, components, n_rays: 0 }
    }

    /// Adds a finished tile.
    ///
    /// # Panics
    /// If the tile does not [fit](Tiling::fits).
    pub fn add(&mut self, tile: &Tile) {
        assert!(self.tiling.fits(tile), "tile {} does not belong to this picture", tile.number);
        for Total { index, pixel, guide, components } in self.tiling.totals(tile) {
            self.picture.pixels[index] = pixel.rounded_mean();
            self.has_samples[tile.number] |= pixel.n_taken() > 0;
            if let Some(sums) = self.sums.get_mut(index) {
                *sums = (pixel, guide);
            }
            if let Some(sums) = self.components.get_mut(index) {
                *sums = components;
            }
        }
        self.is_finished[tile.number] = true;
        self.n_rays += tile.n_rays;
    }

    /// Number of tiles added, and of all tiles.
    #[must_use]
    pub fn n_tiles(&self) -> [usize; 2] {
        [self.is_finished.iter().filter(|&&is_finished| is_finished).count(), self.tiling.n_tiles()]
    }

    /// The numbers of the tiles that were added. A render that begins with an empty tile for each takes samples of the others alone.
    #[must_use]
    pub fn finished(&self) -> Vec<usize> {
        (0..self.is_finished.len()).filter(|&number| self.is_finished[number]).collect()
    }

    /// Whether tiles have guides.
    #[must_use]
    pub fn keeps_guides(&self) -> bool {
        self.tiling.has_guides()
    }

    /// The picture of these tiles, and of `others` elsewhere.
    ///
    /// # Panics
    /// If `others` is of another size, or there is no such tile.
    #[must_use]
    pub fn with_others(&self, tiles: &[usize], mut others: Picture) -> Picture {
        assert_eq!(self.tiling.picture_size(), [others.width, others.height], "a picture of this size");
        for &number in tiles {
            let width = self.tiling.size(number)[0] as usize;
            for first in self.tiling.rows(number) {
                others.pixels[first..first + width].copy_from_slice(&self.picture.pixels[first..first + width]);
            }
        }
        others
    }

    /// Whether a tile with samples was added.
    #[must_use]
    pub fn has_samples(&self) -> bool {
        self.has_samples.contains(&true)
    }

    /// Gives each tile that was not added the mean of the nearest tile with samples, as one sample of each pixel. Returns how many they
    /// are; without any sample they stay black.
    pub fn fill(&mut self) -> usize {
        let nearest = self.nearest_with_samples();
        let mut n_filled = 0;
        for number in (0..nearest.len()).filter(|&number| !self.is_finished[number]) {
            n_filled += 1;
            let Some(source) = nearest[number] else { continue };
            let ((color, guide), components) = (self.mean(source), self.mean_components(source));
            let width = self.tiling.size(number)[0] as usize;
            for index in self.tiling.rows(number).flat_map(|first| first..first + width) {
                self.picture.pixels[index] = color;
                if let Some(sums) = self.sums.get_mut(index) {
                    *sums = (Pixel::of(color), guide);
                }
                if let Some(sums) = self.components.get_mut(index) {
                    *sums = components;
                }
            }
        }
        n_filled
    }

    /// For each tile the nearest one with samples, by steps to neighbors.
    fn nearest_with_samples(&self) -> Vec<Option<usize>> {
        let n = self.has_samples.len();
        let n_columns = self.tiling.n_columns();
        let mut nearest: Vec<Option<usize>> = (0..n).map(|number| self.has_samples[number].then_some(number)).collect();
        let mut next: VecDeque<usize> = (0..n).filter(|&number| self.has_samples[number]).collect();
        while let Some(number) = next.pop_front() {
            let column = number % n_columns;
            let neighbors = [
                (column > 0).then(|| number - 1),
                (column + 1 < n_columns).then(|| number + 1),
                number.checked_sub(n_columns),
                Some(number + n_columns),
            ];
            for neighbor in neighbors.into_iter().flatten().filter(|&neighbor| neighbor < n) {
                if nearest[neighbor].is_none() {
                    nearest[neighbor] = nearest[number];
                    next.push_back(neighbor);
                }
            }
        }
        nearest
    }

    /// The mean of the pixels of a tile, and that of their guides as a guide of one sample.
    fn mean(&self, number: usize) -> ([f32; 3], Guide) {
        let width = self.tiling.size(number)[0] as usize;
        let indices = || self.tiling.rows(number).flat_map(|first| first..first + width);
        let n_pixels = indices().count() as f64;
        let sum = indices()
            .map(|index| self.picture.pixels[index].map(f64::from))
            .reduce(|a, b| [0, 1, 2].map(|k| a[k] + b[k]));
        let color = sum.unwrap_or_default().map(|x| (x / n_pixels) as f32);
        let pixels = indices().filter_map(|index| self.sums.get(index));
        let (n_taken, all) = pixels
            .fold((0, Guide::default()), |(n, all), &(pixel, guide)| (n + u64::from(pixel.n_taken()), all + guide));
        let is_hit = n_taken > 0 && 2 * u64::from(all.n_hits) >= n_taken;
        let guide = Guide::from_sums(is_hit.into(), all.first, all.sums().map(|sum| sum / n_taken.max(1) as f64));
        (color, if is_hit { guide } else { Guide { first: None, ..guide } })
    }

    /// The components of the mean of the pixels of a tile, as those of one sample; zero where none are stored.
    fn mean_components(&self, number: usize) -> Components {
        let width = self.tiling.size(number)[0] as usize;
        let indices = self.tiling.rows(number).flat_map(|first| first..first + width);
        let mut n_pixels = 0;
        let means = indices.filter_map(|index| {
            let (pixel, _) = self.sums.get(index)?;
            n_pixels += 1;
            Some(self.components.get(index)?.mean(pixel))
        });
        total(means).over(f64::from(n_pixels.max(1)))
    }

    /// The film, where AOVs are requested.
    #[must_use]
    pub fn film(&self) -> Option<Film> {
        let (pixels, guides) = self.sums.iter().copied().unzip();
        let Picture { width, height, .. } = self.picture;
        let components = self.components.clone();
        let film = || Film { components, ..Film::new(width, height, pixels, guides, self.n_rays) };
        self.tiling.has_guides().then(film)
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

    #[test]
    fn finished_tiles_appear_and_the_rest_is_black() {
        for has_aovs in [false, true] {
            let tiling = Tiling::new([20, 10], 8, None, has_aovs);
            let mut partial = Partial::new(tiling.clone());
            // The last tile of the first row: columns 16 to 19.
            let mut tile = tiling.tile(2);
            tile.pixels.fill(Pixel::of([1.0, 2.0, 4.0]) + Pixel::of([3.0, 2.0, 0.0]));
            tile.guides.fill(Guide { n_hits: 1, depth: 3.0, ..Guide::default() });
            partial.add(&tile);
            assert_eq!(partial.n_tiles(), [1, 6]);
            let (picture, film) = (partial.picture(), partial.film());
            assert_eq!(film.as_ref().map(Film::picture), has_aovs.then(|| picture.clone()));
            for (x, y, color, depth) in [(16, 0, 2.0, 3.0), (19, 7, 2.0, 3.0), (15, 7, 0.0, 0.0), (19, 8, 0.0, 0.0)] {
                let at = picture.index(x, y);
                assert_eq!(picture.pixels[at], [color; 3], "{x}, {y}");
                assert!(film.iter().all(|film| film.guides()[at].depth == depth), "{x}, {y}");
            }
        }
    }

    /// Four columns and two rows of tiles. The second of the first row has samples; the third has none, as what a crop does not show.
    #[test]
    fn missing_tiles_get_the_mean_of_the_nearest_with_samples() {
        for has_aovs in [false, true] {
            let tiling = Tiling::new([30, 12], 8, None, has_aovs);
            let mut partial = Partial::new(tiling.clone());
            assert!(!partial.has_samples());
            assert_eq!((partial.fill(), partial.picture().pixels[0]), (8, [0.0; 3]));
            let with = |number, color: f32, depth| {
                let mut tile = tiling.tile(number);
                let half = tile.pixels.len() / 2;
                tile.pixels[..half].fill(Pixel::of([0.0; 3]) + Pixel::of([color; 3]));
                tile.pixels[half..].fill(Pixel::of([color; 3]) + Pixel::of([2.0 * color; 3]));
                tile.guides.fill(Guide { n_hits: 2, first: Some([1, 2]), depth: 2.0 * depth, ..Guide::default() });
                tile
            };
            partial.add(&with(1, 1.0, 3.0));
            partial.add(&with(7, 4.0, 5.0));
            partial.add(&tiling.tile(2));
            assert_eq!(partial.fill(), 5);
            let (picture, film) = (partial.picture(), partial.film());
            // The mean of 0.5 and 1.5 times the color.
            for (x, y, color, depth) in [
                (0, 0, 1.0, 3.0),
                (7, 11, 1.0, 3.0),
                (8, 9, 1.0, 3.0),
                (23, 7, 0.0, f64::INFINITY),
                (23, 11, 4.0, 5.0),
                (29, 0, 4.0, 5.0),
            ] {
                let at = picture.index(x, y);
                assert_eq!(picture.pixels[at], [color; 3], "{x}, {y}");
                if let Some(film) = &film {
                    assert_eq!(crate::Aov::Depth.mean(0, &film.pixels()[at], &film.guides()[at]), depth, "{x}, {y}");
                    assert_eq!(film.picture().pixels[at], [color; 3], "{x}, {y}");
                }
            }
        }
    }
}
