//! Which pixels are whose: tiles of a picture, cells of a tile.

use std::ops::Range;

use super::{Sums, Tile};
use crate::film::{Block, Dyadic, total};
use crate::{Guide, Pixel, Settings};

/// Pixels along the side of a cell: neighbours that stop together, wherever tiles end.
pub(crate) const CELL: u32 = 8;

/// How a picture is cut into tiles, and what each pixel keeps.
#[derive(Clone, Copy)]
pub(crate) struct Layout {
    picture: [u32; 2],
    side: u32,
    columns: u32,
    rows: u32,
    n_sums: usize,
    /// Whether each block of the samples is kept by itself.
    is_part: bool,
    is_guided: bool,
}

impl Layout {
    pub(crate) fn new(settings: &Settings) -> Self {
        let Settings { width, height, tile, aovs, .. } = *settings;
        // Tiles are made of whole cells; the greatest side that can be rounded up is far above any picture.
        let side = tile.clamp(1, 1 << 16).next_multiple_of(CELL);
        let n_sums = settings.part.map_or(1, |_| Block::of(settings.range()).len());
        let [columns, rows] = [width, height].map(|n| n.div_ceil(side));
        Self {
            picture: [width, height],
            side,
            columns,
            rows,
            n_sums,
            is_part: settings.part.is_some(),
            is_guided: !aovs.is_empty(),
        }
    }

    pub(crate) fn n_tiles(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Sums kept for each pixel.
    pub(crate) fn n_sums(&self) -> usize {
        self.n_sums
    }

    pub(crate) fn is_guided(&self) -> bool {
        self.is_guided
    }

    /// Column and row of the top left pixel.
    #[expect(clippy::cast_possible_truncation, reason = "quotient and remainder by a u32 of a number below 2^32")]
    pub(crate) fn corner(&self, number: usize) -> [u32; 2] {
        let columns = self.columns as usize;
        [(number % columns) as u32 * self.side, (number / columns) as u32 * self.side]
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self, number: usize) -> [u32; 2] {
        let corner = self.corner(number);
        std::array::from_fn(|k| self.side.min(self.picture[k] - corner[k]))
    }

    /// An empty tile of this number.
    pub(crate) fn tile(&self, number: usize) -> Tile {
        let [width, height] = self.size(number);
        let n = width as usize * height as usize * self.n_sums;
        let n_guides = if self.is_guided { n } else { 0 };
        Tile { number, pixels: vec![Pixel::default(); n], guides: vec![Guide::default(); n_guides], n_rays: 0 }
    }

    /// The pixels of each cell of a tile, by column and row in it.
    pub(crate) fn cells(&self, number: usize) -> impl Iterator<Item = Vec<[u32; 2]>> + use<> {
        let [width, height] = self.size(number);
        cells(height)
            .flat_map(move |y| cells(width).map(move |x| (y.clone(), x)))
            .map(|(y, x)| y.flat_map(|y| x.clone().map(move |x| [x, y])).collect())
    }

    /// Puts what is kept of the sums of a cell's pixels into a tile.
    pub(crate) fn keep(&self, pixels: &[[u32; 2]], sums: &[Sums], tile: &mut Tile) {
        let [width, _] = self.size(tile.number);
        for ([x, y], sums) in pixels.iter().zip(sums) {
            let first = (y * width + x) as usize * self.n_sums;
            self.keep_values(&sums.pixel, &mut tile.pixels[first..]);
            if self.is_guided {
                self.keep_values(&sums.guide, &mut tile.guides[first..]);
            }
        }
    }

    /// Puts what is kept of a pixel's sums to the front of `place`.
    fn keep_values<S: Copy + Default + std::ops::Add<Output = S>>(&self, sums: &Dyadic<S>, place: &mut [S]) {
        if !self.is_part {
            place[0] = total(sums.values());
            return;
        }
        for (place, value) in place.iter_mut().zip(sums.values()) {
            *place = value;
        }
    }

    /// Whether `tile` has the sums that this picture keeps.
    pub(crate) fn fits(&self, tile: &Tile) -> bool {
        if tile.number >= self.n_tiles() {
            return false;
        }
        let [width, height] = self.size(tile.number).map(|n| n as usize);
        let n = width * height * self.n_sums;
        tile.pixels.len() == n && tile.guides.len() == if self.is_guided { n } else { 0 }
    }
}

/// The cells along `n` pixels.
fn cells(n: u32) -> impl Iterator<Item = Range<u32>> + Clone {
    (0..n).step_by(CELL as usize).map(move |start| start..(start + CELL).min(n))
}
