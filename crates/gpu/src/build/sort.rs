//! Radix sort, and the prefix sums that it and other stages need.

use canted_shaders::{Number, choice, wgsl};

use bytemuck::{Pod, Zeroable};

use super::BuildEncoder;
use super::encoder::Dispatches;
use super::primitives::count;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// Invocations per work-group.
pub(super) const GROUP: u32 = 64;

/// Keys per invocation. A tile has GROUP times as many.
pub(super) const KEYS_EACH: u32 = 16;

/// Bits per digit: few digits, so few dispatches. A tile is sorted four bits at a time, whose counters fit in the memory of a work-group on any device.
const DIGIT_BITS: u32 = 8;
const RADIX: u32 = 1 << DIGIT_BITS;

/// Most tiles without blocks, and tiles of a block: `BLOCK` of `shared/build/digit/counts`.
const FEW_TILES: u32 = 64;
const BLOCK: u32 = 32;

/// As in `shared/build.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Digit {
    n_keys: u32,
    n_tiles: u32,
    shift: u32,
    first_count: u32,
    n_blocks: u32,
    next: u32,
}

/// The digit after a digit, as in `shared/build/digit/counts`.
#[derive(Clone, Copy)]
enum Next {
    None,
    OfWord,
    Word,
}

/// `chosen` with the constants of kernels that process tiles of keys.
pub(super) fn tiled(chosen: Variant) -> Variant {
    chosen.number(Number::Group, GROUP).number(Number::KeysEach, KEYS_EACH).number(Number::Radix, RADIX)
}

/// The number of keys with each value of each digit, in each tile. Each digit is counted while keys are moved by the one before, so counts
/// serve one sort.
pub(super) struct Counts {
    pub(super) counts: Buffer<u32>,
    n_keys: u32,
    n_tiles: u32,
    n_blocks: u32,
}

impl Counts {
    /// Zeros for `n` keys whose words have these numbers of bits. One tile needs no counts.
    pub(super) fn new(gpu: &Gpu, n: u32, bits: impl IntoIterator<Item = u32>) -> Result<Self, GpuError> {
        let n_tiles = n.div_ceil(GROUP * KEYS_EACH);
        let n_blocks = if n_tiles <= FEW_TILES { 0 } else { n_tiles.div_ceil(BLOCK) };
        let n_digits: u32 = bits.into_iter().map(digits_of).sum();
        let n_counts = if n_tiles > 1 { (n_digits * RADIX) as usize * (n_blocks + n_tiles) as usize } else { 0 };
        Ok(Self { counts: gpu.zeroed("counts of digits", n_counts)?, n_keys: n, n_tiles, n_blocks })
    }

    /// The first digit.
    pub(super) fn first(&self) -> Digit {
        self.digit(0, 0, Next::None)
    }

    /// Digit `number` of all, from a bit of its word on.
    fn digit(&self, number: u32, shift: u32, next: Next) -> Digit {
        let Self { n_keys, n_tiles, n_blocks, .. } = *self;
        let first_count = number * RADIX * (n_blocks + n_tiles);
        Digit { n_keys, n_tiles, shift, first_count, n_blocks, next: next as u32 }
    }
}

/// Digits of a word with so many bits: at least one, which writes the items.
fn digits_of(bits: u32) -> u32 {
    bits.max(1).div_ceil(DIGIT_BITS)
}

/// A stable radix sort.
pub struct Sorter<'a> {
    gpu: &'a Gpu,
}

/// Primitives in sorted order, refined word by word.
pub(super) struct Order {
    n: u32,
    /// Keys and items, each double-buffered.
    keys: [Buffer<u32>; 2],
    items: [Buffer<u32>; 2],
}

impl<'a> Sorter<'a> {
    /// A sorter on a device, which compiles its kernels when they are used.
    #[must_use]
    pub fn new(gpu: &'a Gpu) -> Self {
        Self { gpu }
    }

    /// Sorts the item indices `0..` stably by key. `words` are the words of the key from least to most significant, each with
    /// its number of significant bits.
    ///
    /// # Errors
    /// Out of memory, or device lost.
    pub fn sort(&self, build: &mut BuildEncoder<'_>, words: &[(&Buffer<u32>, u32)]) -> Result<Buffer<u32>, GpuError> {
        let n = words.first().map_or(0, |(word, _)| word.len());
        let counts = Counts::new(self.gpu, count(n), words.iter().map(|&(_, bits)| bits))?;
        if let (Some((word, _)), true) = (words.first(), counts.n_tiles > 1) {
            let digit = self.gpu.uniform("digit", &counts.first())?;
            let bound: [NamedBinding<'_>; 3] = [("digit", &digit), ("words", *word), ("counts", &counts.counts)];
            build.stage("sort", |dispatches| {
                let kernel = self.gpu.kernel(wgsl::build::sort::COUNT, &tiled(Variant::none()))?;
                dispatches.tiles(&kernel, &bound, [0, counts.n_tiles])
            })?;
        }
        Ok(self.sort_counted(build, words, counts)?.into_items())
    }

    /// The same where the first digit is counted.
    pub(super) fn sort_counted(
        &self,
        build: &mut BuildEncoder<'_>,
        words: &[(&Buffer<u32>, u32)],
        counts: Counts,
    ) -> Result<Order, GpuError> {
        let mut order = Order::new(self.gpu, counts.n_keys as usize)?;
        build.stage("sort", |dispatches| {
            let mut n_digits = 0;
            for (number, &(word, bits)) in words.iter().enumerate() {
                let from = if number == 0 { choice::Keys::First } else { choice::Keys::Gathered };
                let next = words.get(number + 1).map(|(word, _)| *word);
                if counts.n_tiles <= 1 {
                    let next = next.map_or(Next::None, |_| Next::Word);
                    self.at_once(
                        dispatches,
                        &mut order,
                        (word, from),
                        Digit { shift: bits, ..counts.digit(0, 0, next) },
                    )?;
                    continue;
                }
                for digit in 0..digits_of(bits) {
                    let is_last = digit + 1 == digits_of(bits);
                    let from = if digit == 0 { from } else { choice::Keys::Moved };
                    let after = match (is_last, next) {
                        (false, _) => Next::OfWord,
                        (true, Some(_)) => Next::Word,
                        (true, None) => Next::None,
                    };
                    let uniform = counts.digit(n_digits, digit * DIGIT_BITS, after);
                    self.by_digit(dispatches, &mut order, (word, from, next.unwrap_or(word)), (&counts, uniform))?;
                    n_digits += 1;
                }
            }
            Ok(())
        })?;
        Ok(order)
    }

    /// `words` in the order of `items`.
    ///
    /// # Errors
    /// As for [`Sorter::sort`].
    pub fn gather(
        &self,
        build: &mut BuildEncoder<'_>,
        words: &Buffer<u32>,
        items: &Buffer<u32>,
    ) -> Result<Buffer<u32>, GpuError> {
        let gathered = self.gpu.zeroed("gathered words", items.len())?;
        let bound: [NamedBinding<'_>; 3] = [("words", words), ("items", items), ("gathered", &gathered)];
        build.stage("sort", |dispatches| {
            let kernel = self.gpu.kernel(wgsl::build::sort::GATHER, &Variant::none())?;
            dispatches.items(&kernel, &bound, count(items.len()))
        })?;
        Ok(gathered)
    }

    /// Two words in the order of `items`.
    pub(super) fn gather_two(
        &self,
        build: &mut BuildEncoder<'_>,
        [low, high]: [&Buffer<u32>; 2],
        items: &Buffer<u32>,
    ) -> Result<[Buffer<u32>; 2], GpuError> {
        let gathered = || self.gpu.zeroed::<u32>("gathered words", items.len());
        let gathered = [gathered()?, gathered()?];
        let bound: [NamedBinding<'_>; 5] = [
            ("words", low),
            ("high_words", high),
            ("items", items),
            ("gathered", &gathered[0]),
            ("high_gathered", &gathered[1]),
        ];
        build.stage("sort", |dispatches| {
            let kernel = self.gpu.kernel(wgsl::build::sort::GATHER_TWO, &Variant::none())?;
            dispatches.items(&kernel, &bound, count(items.len()))
        })?;
        Ok(gathered)
    }

    /// Sorts what fits in a tile by a word of the keys, in one work-group.
    fn at_once(
        &self,
        dispatches: &mut Dispatches<'_>,
        order: &mut Order,
        (words, from): (&Buffer<u32>, choice::Keys),
        digit: Digit,
    ) -> Result<(), GpuError> {
        let digit = self.gpu.uniform("bits", &digit)?;
        let [values_in, values_out] = &order.items;
        let bound: [NamedBinding<'_>; 5] = [
            ("digit", &digit),
            ("words", words),
            ("values_in", values_in),
            ("values_out", values_out),
            ("keys_out", &order.keys[0]),
        ];
        let kernel = self.gpu.kernel(wgsl::build::sort::SMALL, &tiled(Variant::none().with(from)))?;
        dispatches.tiles(&kernel, &bound, [0, u32::from(order.n > 0)])?;
        order.items.swap(0, 1);
        Ok(())
    }

    /// Sorts by a digit of a word of the keys, and counts the next digit.
    fn by_digit(
        &self,
        dispatches: &mut Dispatches<'_>,
        order: &mut Order,
        (words, from, next_words): (&Buffer<u32>, choice::Keys, &Buffer<u32>),
        (counts, digit): (&Counts, Digit),
    ) -> Result<(), GpuError> {
        let digit = self.gpu.uniform("digit", &digit)?;
        let [keys_in, keys_out] = &order.keys;
        let [values_in, values_out] = &order.items;
        let bound: [NamedBinding<'_>; 8] = [
            ("digit", &digit),
            ("words", words),
            ("keys_in", keys_in),
            ("values_in", values_in),
            ("keys_out", keys_out),
            ("values_out", values_out),
            ("counts", &counts.counts),
            ("next_words", next_words),
        ];
        let kernel = self.gpu.kernel(wgsl::build::sort::SCATTER, &tiled(Variant::none().with(from)))?;
        dispatches.tiles(&kernel, &bound, [0, counts.n_tiles])?;
        order.keys.swap(0, 1);
        order.items.swap(0, 1);
        Ok(())
    }
}

impl Order {
    fn new(gpu: &Gpu, n: usize) -> Result<Self, GpuError> {
        Ok(Self {
            n: count(n),
            keys: [gpu.zeroed("keys", n)?, gpu.zeroed("keys, second buffer", n)?],
            items: [gpu.zeroed("items", n)?, gpu.zeroed("items, second buffer", n)?],
        })
    }

    fn into_items(self) -> Buffer<u32> {
        let [items, _] = self.items;
        items
    }

    /// The sorted items, and the last word of their keys in the same order.
    pub(super) fn into_items_and_keys(self) -> (Buffer<u32>, Buffer<u32>) {
        let ([items, _], [keys, _]) = (self.items, self.keys);
        (items, keys)
    }
}

/// Writes the sum of the values before each of a range of values, counted from the start of its first tile.
pub(super) fn prefix_sums(
    dispatches: &mut Dispatches<'_>,
    values: &Buffer<u32>,
    prefixes: &Buffer<u32>,
    [first, end]: [u32; 2],
) -> Result<(), GpuError> {
    let gpu = dispatches.gpu;
    let n_tiles = end.div_ceil(GROUP * KEYS_EACH);
    let tiles = [first / (GROUP * KEYS_EACH), n_tiles];
    let counts = gpu.zeroed::<u32>("sums of tiles", n_tiles as usize)?;
    let digit = Digit { n_keys: end, n_tiles, shift: 0, first_count: 0, n_blocks: 0, next: 0 };
    let digit = gpu.uniform("digit", &digit)?;
    let bound: [NamedBinding<'_>; 4] =
        [("digit", &digit), ("values", values), ("counts", &counts), ("prefixes", prefixes)];
    // Sums before the first tile do not matter.
    if tiles[1] - tiles[0] > 1 {
        dispatches.tiles(&*gpu.kernel(wgsl::build::sort::TILE_SUMS, &tiled(Variant::none()))?, &bound, tiles)?;
    }
    dispatches.tiles(&*gpu.kernel(wgsl::build::sort::TILE_PREFIXES, &tiled(Variant::none()))?, &bound, tiles)
}
