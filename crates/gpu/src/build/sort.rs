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

/// Most tiles of which each sums the counts of those before it, instead of a dispatch that does so for all.
const FEW_TILES: u32 = 64;

/// As in `shared/build.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Digit {
    pub(super) n_keys: u32,
    pub(super) n_tiles: u32,
    pub(super) shift: u32,
    pub(super) is_scanned: u32,
}

/// Constants of kernels that process tiles of keys.
pub(super) fn tiled() -> Variant {
    Variant::none().number(Number::Group, GROUP).number(Number::KeysEach, KEYS_EACH).number(Number::Radix, RADIX)
}

/// A stable radix sort.
pub struct Sorter<'a> {
    gpu: &'a Gpu,
}

/// Primitives in sorted order, refined word by word.
struct Order {
    n: u32,
    /// Keys and items, each double-buffered.
    keys: [Buffer<u32>; 2],
    items: [Buffer<u32>; 2],
    counts: Buffer<u32>,
    totals: Buffer<u32>,
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
        self.sort_as("sort", build, words)
    }

    /// [`Sorter::sort`] as part of another stage.
    pub(super) fn sort_as(
        &self,
        stage: &'static str,
        build: &mut BuildEncoder<'_>,
        words: &[(&Buffer<u32>, u32)],
    ) -> Result<Buffer<u32>, GpuError> {
        let n = words.first().map_or(0, |(word, _)| word.len());
        let mut order = Order::new(self.gpu, n)?;
        build.stage(stage, |dispatches| {
            for (number, &(word, bits)) in words.iter().enumerate() {
                let from = if number == 0 { choice::Keys::First } else { choice::Keys::Gathered };
                if order.n <= GROUP * KEYS_EACH {
                    self.at_once(dispatches, &mut order, (word, from), bits)?;
                } else {
                    self.by_digits(dispatches, &mut order, (word, from), bits)?;
                }
            }
            Ok(())
        })?;
        Ok(order.into_items())
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

    /// Sorts what fits in a tile by a word of the keys, in one work-group.
    fn at_once(
        &self,
        dispatches: &mut Dispatches<'_>,
        order: &mut Order,
        (words, from): (&Buffer<u32>, choice::Keys),
        bits: u32,
    ) -> Result<(), GpuError> {
        let digit = self.gpu.uniform("bits", &Digit { n_keys: order.n, n_tiles: 1, shift: bits, is_scanned: 0 })?;
        let [values_in, values_out] = &order.items;
        let bound: [NamedBinding<'_>; 4] =
            [("digit", &digit), ("words", words), ("values_in", values_in), ("values_out", values_out)];
        let kernel = self.gpu.kernel(wgsl::build::sort::SMALL, &tiled().with(from))?;
        dispatches.tiles(&kernel, &bound, [0, u32::from(order.n > 0)])?;
        order.items.swap(0, 1);
        Ok(())
    }

    /// Sorts by the lowest `bits` bits of a word of the keys.
    fn by_digits(
        &self,
        dispatches: &mut Dispatches<'_>,
        order: &mut Order,
        (words, from): (&Buffer<u32>, choice::Keys),
        bits: u32,
    ) -> Result<(), GpuError> {
        let n_tiles = order.n.div_ceil(GROUP * KEYS_EACH);
        let is_scanned = n_tiles > FEW_TILES;
        // At least one digit, which writes the items.
        for shift in (0..bits.max(1)).step_by(DIGIT_BITS as usize) {
            let digit = Digit { n_keys: order.n, n_tiles, shift, is_scanned: is_scanned.into() };
            let digit = self.gpu.uniform("digit", &digit)?;
            let [keys_in, keys_out] = &order.keys;
            let [values_in, values_out] = &order.items;
            let bound = [
                ("digit", &digit as _),
                ("words", words as _),
                ("keys_in", keys_in as _),
                ("values_in", values_in as _),
                ("keys_out", keys_out as _),
                ("values_out", values_out as _),
                ("counts", &order.counts as _),
                ("totals", &order.totals as _),
            ];
            let chosen = tiled().with(if shift == 0 { from } else { choice::Keys::Moved });
            dispatches.tiles(&*self.gpu.kernel(wgsl::build::sort::COUNT, &chosen)?, &bound, [0, n_tiles])?;
            if is_scanned {
                let scan = self.gpu.kernel(wgsl::build::sort::SCAN, &tiled())?;
                dispatches.work.dispatch(&scan, &bound, [RADIX, 1, 1])?;
            }
            dispatches.tiles(&*self.gpu.kernel(wgsl::build::sort::SCATTER, &chosen)?, &bound, [0, n_tiles])?;
            order.keys.swap(0, 1);
            order.items.swap(0, 1);
        }
        Ok(())
    }
}

impl Order {
    fn new(gpu: &Gpu, n: usize) -> Result<Self, GpuError> {
        let n_tiles = n.div_ceil((GROUP * KEYS_EACH) as usize);
        // One tile is sorted at once, without keys of its own.
        let n_keys = if n_tiles > 1 { n } else { 0 };
        Ok(Self {
            n: count(n),
            keys: [gpu.zeroed("keys", n_keys)?, gpu.zeroed("keys, second buffer", n_keys)?],
            items: [gpu.zeroed("items", n)?, gpu.zeroed("items, second buffer", n)?],
            counts: gpu.zeroed("counts of a digit", n_tiles * RADIX as usize)?,
            totals: gpu.zeroed("totals of a digit", RADIX as usize)?,
        })
    }

    fn into_items(self) -> Buffer<u32> {
        let [items, _] = self.items;
        items
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
    let totals = gpu.zeroed::<u32>("sum", 1)?;
    let digit = gpu.uniform("digit", &Digit { n_keys: end, n_tiles, shift: 0, is_scanned: 0 })?;
    let bound: [NamedBinding<'_>; 5] =
        [("digit", &digit), ("values", values), ("counts", &counts), ("totals", &totals), ("prefixes", prefixes)];
    dispatches.tiles(&*gpu.kernel(wgsl::build::sort::TILE_SUMS, &tiled())?, &bound, tiles)?;
    if n_tiles > 0 {
        // One row of sums.
        dispatches.work.dispatch(&*gpu.kernel(wgsl::build::sort::SCAN, &tiled())?, &bound, [1, 1, 1])?;
    }
    dispatches.tiles(&*gpu.kernel(wgsl::build::sort::TILE_PREFIXES, &tiled())?, &bound, tiles)
}
