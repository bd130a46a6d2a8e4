//! Splits a picture into tiles and cells, and puts finished tiles together.
//!
//! ```text
//! reads   sums of the pixels of a cell; finished tiles in any order
//! writes  tiles
//! holds   the film does not depend on the size of the tiles or on the order in which they finish
//! ```

use std::ops::{Add, Range};

use crate::sums::total;
use crate::{Block, Components, Dyadic, Guide, Pixel};

/// Pixels along the side of a cell: the pixels of a cell stop together, whatever the size of the tiles.
pub const CELL: u32 = 8;

/// A rectangle of pixels whose samples are summed.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Its index, row by row from the top left.
    pub number: usize,
    /// Sums of each pixel, row by row; one for each block where the tile belongs to a part.
    pub pixels: Vec<Pixel>,
    /// The same for guides; empty without AOVs.
    pub guides: Vec<Guide>,
    /// The same for components; empty where none is requested.
    pub components: Vec<Components>,
    /// Rays traced.
    pub n_rays: u64,
}

/// The sums of one pixel while its samples are taken.
#[derive(Clone, Default)]
pub struct Sums {
    /// Radiance.
    pub pixel: Dyadic<Pixel>,
    /// AOVs.
    pub guide: Dyadic<Guide>,
    /// Radiance in its parts.
    pub components: Dyadic<Components>,
}

impl Sums {
    /// Removes all samples.
    pub fn clear(&mut self) {
        self.pixel.clear();
        self.guide.clear();
        self.components.clear();
    }
}

/// How a picture is split into tiles, and what is stored for each pixel.
#[derive(Clone, Debug)]
pub struct Tiling {
    size: [u32; 2],
    side: u32,
    columns: u32,
    rows: u32,
    n_sums: usize,
    /// The sample range of which each block is stored.
    part: Option<Range<u32>>,
    has_guides: bool,
    has_components: bool,
    means_only: bool,
}

impl Tiling {
    /// Tiles of `side` x `side` pixels, rounded up to a multiple of [`CELL`]; smaller at the right and bottom borders.
    ///
    /// With `part` each block of that sample range is stored separately, otherwise one sum per pixel.
    #[must_use]
    pub fn new(size: [u32; 2], side: u32, part: Option<Range<u32>>, has_guides: bool) -> Self {
        // The upper limit keeps the multiple in 32 bits and is far above the size of any picture.
        let side = side.clamp(1, 1 << 16).next_multiple_of(CELL);
        let n_sums = part.clone().map_or(1, |range| Block::of(range).len());
        let [columns, rows] = size.map(|n| n.div_ceil(side));
        Self { size, side, columns, rows, n_sums, part, has_guides, has_components: false, means_only: false }
    }

    /// The same tiles of a film that keeps only the mean of each pixel: 12 bytes instead of 64.
    ///
    /// # Panics
    /// If the film is a part of all samples or has AOVs, which are sums.
    #[must_use]
    pub fn means_only(self) -> Self {
        assert!(self.part.is_none() && !self.has_guides && !self.has_components, "parts and AOVs are sums");
        Self { means_only: true, ..self }
    }

    /// The same tiles of a film that also stores the [`Components`] of each pixel.
    ///
    /// # Panics
    /// If the film keeps only means.
    #[must_use]
    pub fn with_components(self) -> Self {
        assert!(!self.means_only, "components are sums");
        Self { has_components: true, ..self }
    }

    /// Whether a film of these tiles keeps only means.
    #[must_use]
    pub fn keeps_means_only(&self) -> bool {
        self.means_only
    }

    /// The sample range of which each block is stored.
    pub(crate) fn part(&self) -> Option<Range<u32>> {
        self.part.clone()
    }

    /// Width and height of the picture.
    #[must_use]
    pub fn picture_size(&self) -> [u32; 2] {
        self.size
    }

    /// Number of tiles.
    #[must_use]
    pub fn n_tiles(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Tiles in a row.
    pub(crate) fn n_columns(&self) -> usize {
        self.columns as usize
    }

    /// Sums stored per pixel.
    #[must_use]
    pub fn n_sums(&self) -> usize {
        self.n_sums
    }

    /// Whether guides are stored.
    #[must_use]
    pub fn has_guides(&self) -> bool {
        self.has_guides
    }

    /// Whether components are stored.
    #[must_use]
    pub fn has_components(&self) -> bool {
        self.has_components
    }

    /// Column and row of the top left pixel of a tile.
    #[must_use]
    pub fn corner(&self, number: usize) -> [u32; 2] {
        let columns = self.columns as usize;
        [(number % columns) as u32 * self.side, (number / columns) as u32 * self.side]
    }

    /// Width and height of a tile in pixels.
    #[must_use]
    pub fn size(&self, number: usize) -> [u32; 2] {
        let corner = self.corner(number);
        std::array::from_fn(|k| self.side.min(self.size[k] - corner[k]))
    }

    /// An empty tile.
    #[must_use]
    pub fn tile(&self, number: usize) -> Tile {
        let [width, height] = self.size(number);
        let n = width as usize * height as usize * self.n_sums;
        Tile {
            number,
            pixels: vec![Pixel::default(); n],
            guides: vec![Guide::default(); if self.has_guides { n } else { 0 }],
            components: vec![Components::default(); if self.has_components { n } else { 0 }],
            n_rays: 0,
        }
    }

    /// The pixels of each cell of a tile, by column and row in the tile.
    pub fn cells(&self, number: usize) -> impl Iterator<Item = Vec<[u32; 2]>> + use<> {
        let [width, height] = self.size(number);
        cells(height)
            .flat_map(move |y| cells(width).map(move |x| (y.clone(), x)))
            .map(|(y, x)| y.flat_map(|y| x.clone().map(move |x| [x, y])).collect())
    }

    /// Stores the sums of a cell's pixels in a tile.
    pub fn store(&self, pixels: &[[u32; 2]], sums: &[Sums], tile: &mut Tile) {
        let [width, _] = self.size(tile.number);
        for ([x, y], sums) in pixels.iter().zip(sums) {
            let first = (y * width + x) as usize * self.n_sums;
            self.store_values(&sums.pixel, &mut tile.pixels[first..]);
            if self.has_guides {
                self.store_values(&sums.guide, &mut tile.guides[first..]);
            }
            if self.has_components {
                self.store_values(&sums.components, &mut tile.components[first..]);
            }
        }
    }

    /// Stores the sums of one pixel at the front of `out`.
    fn store_values<S: Copy + Default + Add<Output = S>>(&self, sums: &Dyadic<S>, out: &mut [S]) {
        if self.part.is_none() {
            out[0] = sums.total();
            return;
        }
        out.iter_mut().zip(sums.values()).for_each(|(out, value)| *out = value);
    }

    /// Whether `tile` has the sums that this picture stores.
    #[must_use]
    pub fn fits(&self, tile: &Tile) -> bool {
        if tile.number >= self.n_tiles() {
            return false;
        }
        let [width, height] = self.size(tile.number).map(|n| n as usize);
        let n = width * height * self.n_sums;
        let n_if = |is_stored: bool| if is_stored { n } else { 0 };
        tile.pixels.len() == n
            && tile.guides.len() == n_if(self.has_guides)
            && tile.components.len() == n_if(self.has_components)
    }

    /// The index in the picture of the first pixel of each row of a tile.
    pub(crate) fn rows(&self, number: usize) -> impl Iterator<Item = usize> + use<> {
        let ([x, y], [_, height], [width, _]) = (self.corner(number), self.size(number), self.size);
        (y..y + height).map(move |y| y as usize * width as usize + x as usize)
    }

    /// The pixels of a tile, row by row.
    pub(crate) fn totals<'a>(&self, tile: &'a Tile) -> impl Iterator<Item = Total> + use<'a> {
        let (width, n_sums) = (self.size(tile.number)[0] as usize, self.n_sums);
        let indices = self.rows(tile.number).flat_map(move |first| first..first + width);
        let (mut guides, mut components) = (tile.guides.chunks(n_sums), tile.components.chunks(n_sums));
        indices.zip(tile.pixels.chunks(n_sums)).map(move |(index, pixels)| Total {
            index,
            pixel: total(pixels.iter().copied()),
            guide: total(guides.next().unwrap_or_default().iter().copied()),
            components: total(components.next().unwrap_or_default().iter().copied()),
        })
    }
}

/// A pixel of a tile with its sums over all samples; those that are not stored are zero.
pub(crate) struct Total {
    /// Index in the picture.
    pub(crate) index: usize,
    pub(crate) pixel: Pixel,
    pub(crate) guide: Guide,
    pub(crate) components: Components,
}

/// The cells along `n` pixels.
fn cells(n: u32) -> impl Iterator<Item = Range<u32>> + Clone {
    (0..n).step_by(CELL as usize).map(move |start| start..(start + CELL).min(n))
}
