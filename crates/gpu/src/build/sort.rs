//! Radix sort, and the prefix sums that it and other stages need.

use canted_shaders::{Number, wgsl};
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::BuildEncoder;
use super::encoder::Dispatches;
use super::primitives::count;
use crate::{Buffer, Gpu, GpuError, Kernel, NamedBinding, Variant};

/// Invocations per work-group.
pub(super) const GROUP: u32 = 64;

/// Keys per invocation. A tile has GROUP times as many: enough for runs of whole cache lines for each value of a digit.
pub(super) const KEYS_EACH: u32 = 16;

/// Bits per digit, few enough that the counters of a work-group fit on any device.
const DIGIT_BITS: u32 = 4;
const RADIX: u32 = 1 << DIGIT_BITS;

/// As in `shared/build.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Digit {
    pub(super) n_keys: u32,
    pub(super) n_tiles: u32,
    pub(super) shift: u32,
}

/// Constants of kernels that process tiles of keys.
pub(super) fn tiled() -> Variant {
    Variant::none().number(Number::Group, GROUP).number(Number::KeysEach, KEYS_EACH).number(Number::Radix, RADIX)
}

/// Kernels of a stable radix sort.
pub struct Sorter {
    number: Arc<Kernel>,
    count: Arc<Kernel>,
    scan: Arc<Kernel>,
    scatter: Arc<Kernel>,
    gather: Arc<Kernel>,
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

impl Sorter {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// The device does not support them.
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let tiled = tiled();
        Ok(Self {
            number: gpu.kernel(wgsl::build::sort::ITEM_INDICES, &Variant::none())?,
            count: gpu.kernel(wgsl::build::sort::COUNT, &tiled)?,
            scan: gpu.kernel(wgsl::build::sort::SCAN, &tiled)?,
            scatter: gpu.kernel(wgsl::build::sort::SCATTER, &tiled)?,
            gather: gpu.kernel(wgsl::build::sort::GATHER, &Variant::none())?,
        })
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
        let mut order = Order::new(build.gpu(), n)?;
        build.stage(stage, |dispatches| {
            dispatches.items(&self.number, &[("items", &order.items[0])], order.n)?;
            for &(word, bits) in words {
                dispatches.items(&self.gather, &order.gathering(word), order.n)?;
                self.by_keys(dispatches, &mut order, bits)?;
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
        let gathered = build.gpu().zeroed("gathered words", items.len())?;
        let bound: [NamedBinding<'_>; 3] = [("words", words), ("items", items), ("gathered", &gathered)];
        build.stage("sort", |dispatches| dispatches.items(&self.gather, &bound, count(items.len())))?;
        Ok(gathered)
    }

    /// Sorts by the lowest `bits` bits of the keys.
    fn by_keys(&self, dispatches: &mut Dispatches<'_>, order: &mut Order, bits: u32) -> Result<(), GpuError> {
        let n_tiles = order.n.div_ceil(GROUP * KEYS_EACH);
        for shift in (0..bits).step_by(DIGIT_BITS as usize) {
            let digit = dispatches.gpu.uniform("digit", &Digit { n_keys: order.n, n_tiles, shift })?;
            let [keys_in, keys_out] = &order.keys;
            let [values_in, values_out] = &order.items;
            let bound = [
                ("digit", &digit as _),
                ("keys_in", keys_in as _),
                ("values_in", values_in as _),
                ("keys_out", keys_out as _),
                ("values_out", values_out as _),
                ("counts", &order.counts as _),
                ("totals", &order.totals as _),
            ];
            dispatches.tiles(&self.count, &bound, [0, n_tiles])?;
            if n_tiles > 0 {
                dispatches.work.dispatch(&self.scan, &bound, [RADIX, 1, 1])?;
            }
            dispatches.tiles(&self.scatter, &bound, [0, n_tiles])?;
            order.keys.swap(0, 1);
            order.items.swap(0, 1);
        }
        Ok(())
    }
}

impl Order {
    fn new(gpu: &Gpu, n: usize) -> Result<Self, GpuError> {
        let n_tiles = n.div_ceil((GROUP * KEYS_EACH) as usize);
        Ok(Self {
            n: count(n),
            keys: [gpu.zeroed("keys", n)?, gpu.zeroed("keys, second buffer", n)?],
            items: [gpu.zeroed("items", n)?, gpu.zeroed("items, second buffer", n)?],
            counts: gpu.zeroed("counts of a digit", n_tiles * RADIX as usize)?,
            totals: gpu.zeroed("totals of a digit", RADIX as usize)?,
        })
    }

    /// Bindings of the kernel that gathers keys from `words`.
    fn gathering<'a>(&'a self, words: &'a Buffer<u32>) -> [NamedBinding<'a>; 3] {
        [("words", words), ("items", &self.items[0]), ("gathered", &self.keys[0])]
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
    let digit = gpu.uniform("digit", &Digit { n_keys: end, n_tiles, shift: 0 })?;
    let bound: [NamedBinding<'_>; 5] =
        [("digit", &digit), ("values", values), ("counts", &counts), ("totals", &totals), ("prefixes", prefixes)];
    dispatches.tiles(&*gpu.kernel(wgsl::build::sort::TILE_SUMS, &tiled())?, &bound, tiles)?;
    if n_tiles > 0 {
        // One row of sums.
        dispatches.work.dispatch(&*gpu.kernel(wgsl::build::sort::SCAN, &tiled())?, &bound, [1, 1, 1])?;
    }
    dispatches.tiles(&*gpu.kernel(wgsl::build::sort::TILE_PREFIXES, &tiled())?, &bound, tiles)
}
