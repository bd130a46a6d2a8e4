//! ETC1S with BasisLZ: blocks of 4 x 4 texels, each one of a list of pairs of colors and one of a list of selectors.
//!
//! Source: KTX File Format Specification, version 2.0, "BasisLZ Bitstream Specification".

use super::Flaw;
use super::bits::{Bits, Code};

/// What is added to a color for each selector, by intensity.
const OFFSETS: [[i16; 4]; 8] = [
    [-8, -2, 2, 8],
    [-17, -5, 5, 17],
    [-29, -9, 9, 29],
    [-42, -13, 13, 42],
    [-60, -18, 18, 60],
    [-80, -24, 24, 80],
    [-106, -33, 33, 106],
    [-183, -47, 47, 183],
];

/// The symbol that repeats the last predictors of endpoints.
const REPEAT: u32 = 256;
/// Shortest runs of predictors and of selectors.
const MIN_RUN: u32 = 3;
/// The run of selectors whose length follows.
const LONG_RUN: u32 = 63;

/// Lengths of the parts of the global data after its header.
const HEADER: usize = 20;
/// Bytes of the description of an image.
const DESCRIPTION: usize = 20;

/// The lists and codes that all images of a file share.
pub(super) struct Palettes {
    /// The four colors of blocks.
    colors: Vec<[[u8; 3]; 4]>,
    /// Two bits for each texel, from left to right and down.
    selectors: Vec<u32>,
    predictors: Code,
    differences: Code,
    selector: Code,
    runs: Code,
    n_recent: usize,
}

/// Bytes of an image in its level.
pub(super) struct Slices {
    pub(super) color: [u32; 2],
    /// Length 0 without alpha.
    pub(super) alpha: [u32; 2],
}

impl Palettes {
    /// Reads the global data of a file with `n_images`; also the slices of the first image.
    pub(super) fn read(bytes: &[u8], n_images: usize) -> Result<(Self, Slices), Flaw> {
        let half = |at: usize| bytes.get(at..at + 2).map(|half| u16::from_le_bytes([half[0], half[1]]));
        let word = |at: usize| Some(u32::from(half(at)?) | u32::from(half(at + 2)?) << 16);
        let end = "unexpected end of global data";
        let [n_colors, n_selectors] = [half(0).ok_or(end)?, half(2).ok_or(end)?];
        let mut rest = n_images
            .checked_mul(DESCRIPTION)
            .and_then(|length| bytes.get(HEADER..)?.get(length..))
            .ok_or("unexpected end of global data")?;
        let mut part = |at: usize| {
            let (part, tail) = rest.split_at_checked(word(at)? as usize)?;
            rest = tail;
            Some(part)
        };
        let [colors, selectors, tables] = [part(4).ok_or(end)?, part(8).ok_or(end)?, part(12).ok_or(end)?];
        let slice = |at: usize| Some([word(HEADER + at)?, word(HEADER + at + 4)?]);
        let slices = Slices { color: slice(4).ok_or(end)?, alpha: slice(12).ok_or(end)? };
        let mut tables = Bits::new(tables);
        let palettes = Self {
            colors: read_colors(colors, n_colors.into())?,
            selectors: read_selectors(selectors, n_selectors.into())?,
            predictors: Code::read(&mut tables)?,
            differences: Code::read(&mut tables)?,
            selector: Code::read(&mut tables)?,
            runs: Code::read(&mut tables)?,
            n_recent: tables.get(13)? as usize,
        };
        Ok((palettes, slices))
    }

    /// Decodes a slice of `width` x `height` blocks. `put` gets the number of each block and the colors of its texels.
    pub(super) fn decode(
        &self,
        bytes: &[u8],
        [width, height]: [usize; 2],
        mut put: impl FnMut(usize, [[u8; 3]; 16]),
    ) -> Result<(), Flaw> {
        let mut bits = Bits::new(bytes);
        let mut selectors = Selectors { recent: vec![0; self.n_recent], next: self.n_recent / 2, n_left: 0 };
        // Predictors of squares of 2 x 2 blocks, two bits for each block.
        let (mut last, mut n_repeats) = (0, 0);
        let mut below = vec![0; width];
        let mut endpoints: Vec<usize> = vec![0; width * height];
        let mut previous = 0;
        for y in 0..height {
            let mut square = 0;
            for (x, below) in below.iter_mut().enumerate() {
                let at = y * width + x;
                if x % 2 == 0 {
                    if y % 2 == 0 {
                        if n_repeats > 0 {
                            n_repeats -= 1;
                        } else {
                            match self.predictors.get(&mut bits)? {
                                REPEAT => n_repeats = bits.number(4)?.saturating_add(MIN_RUN - 1),
                                symbol => last = symbol,
                            }
                        }
                        (square, *below) = (last, last >> 4);
                    } else {
                        square = *below;
                    }
                }
                let outside = "a block is predicted from outside the image";
                previous = match square & 3 {
                    0 if x > 0 => previous,
                    1 if y > 0 => endpoints[at - width],
                    2 if x > 0 && y > 0 => endpoints[at - width - 1],
                    3 => {
                        let next = previous + self.differences.get(&mut bits)? as usize;
                        if next < self.colors.len() { next } else { next - self.colors.len() }
                    }
                    _ => return Err(outside),
                };
                square >>= 2;
                endpoints[at] = previous;
                let selector = selectors.get(self, &mut bits)?;
                let colors = self.colors.get(previous).ok_or("endpoint out of range")?;
                let selector = self.selectors.get(selector).ok_or("selector out of range")?;
                put(at, std::array::from_fn(|texel| colors[(selector >> (2 * texel) & 3) as usize]));
            }
        }
        Ok(())
    }
}

/// The selectors that occurred recently.
struct Selectors {
    recent: Vec<usize>,
    /// Where the next one goes, in the second half.
    next: usize,
    /// How often the first is still repeated.
    n_left: u32,
}

impl Selectors {
    /// Reads the number of a selector.
    fn get(&mut self, palettes: &Palettes, bits: &mut Bits<'_>) -> Result<usize, Flaw> {
        let mut symbol = palettes.selectors.len();
        if self.n_left > 0 {
            self.n_left -= 1;
        } else {
            symbol = palettes.selector.get(bits)? as usize;
            if symbol == palettes.selectors.len() + self.recent.len() {
                let run = palettes.runs.get(bits)?;
                let run = if run == LONG_RUN { bits.number(7)? } else { run };
                self.n_left = run.saturating_add(MIN_RUN - 1);
                symbol = palettes.selectors.len();
            }
        }
        match symbol.checked_sub(palettes.selectors.len()) {
            Some(recent) => {
                let &selector = self.recent.get(recent).ok_or("selector out of range")?;
                // Those that occur again move toward the front.
                self.recent.swap(recent / 2, recent);
                Ok(selector)
            }
            None => {
                if let Some(slot) = self.recent.get_mut(self.next) {
                    *slot = symbol;
                    self.next += 1;
                    if self.next == self.recent.len() {
                        self.next /= 2;
                    }
                }
                Ok(symbol)
            }
        }
    }
}

/// The four colors of each pair of endpoints.
fn read_colors(bytes: &[u8], n: usize) -> Result<Vec<[[u8; 3]; 4]>, Flaw> {
    let mut bits = Bits::new(bytes);
    // Differences of components, by the component before: up to 9, up to 21, above.
    let codes = [Code::read(&mut bits)?, Code::read(&mut bits)?, Code::read(&mut bits)?];
    let intensities = Code::read(&mut bits)?;
    let is_gray = bits.get(1)? == 1;
    let (mut color, mut intensity) = ([16_u32; 3], 0);
    let mut next = || {
        intensity = (intensity + intensities.get(&mut bits)?) % 8;
        for component in color.iter_mut().take(if is_gray { 1 } else { 3 }) {
            let code = &codes[usize::from(*component > 9) + usize::from(*component > 21)];
            *component = (*component + code.get(&mut bits)?) % 32;
        }
        let color = if is_gray { [color[0]; 3] } else { color };
        let color = color.map(|component| (component << 3 | component >> 2) as i16);
        let offsets = OFFSETS[intensity as usize];
        Ok(offsets.map(|offset| color.map(|component| (component + offset).clamp(0, 255) as u8)))
    };
    (0..n).map(|_| next()).collect()
}

/// The selectors of blocks.
fn read_selectors(bytes: &[u8], n: usize) -> Result<Vec<u32>, Flaw> {
    let mut bits = Bits::new(bytes);
    if bits.get(2)? != 0 {
        return Err("lists of selectors outside the file are not supported");
    }
    if bits.get(1)? == 1 {
        return (0..n).map(|_| bits.get(32)).collect();
    }
    let differences = Code::read(&mut bits)?;
    let mut last = None;
    let mut next = || {
        let selector = match last {
            None => bits.get(32)?,
            Some(last) => {
                let mut difference = 0;
                for shift in [0, 8, 16, 24] {
                    difference |= (differences.get(&mut bits)? & 255) << shift;
                }
                last ^ difference
            }
        };
        last = Some(selector);
        Ok(selector)
    };
    (0..n).map(|_| next()).collect()
}
