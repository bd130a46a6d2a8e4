use std::sync::{Arc, LazyLock};

use canted_film::srgb;
use canted_scene::{Encoding, Magnification, Texture, Wrap};
use rayon::prelude::*;

use super::Footprint;

/// Each byte over 255.
static FRACTION: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| f32::from(byte as u8) / 255.0));

/// A texture with its mip levels. Each level is half as wide and high as the previous one, rounded down, to a single
/// texel.
///
/// A texel is the mean over its box in the previous level, in linear light, with fractional weights at the edges of the
/// box. All levels have the same mean, up to a rounding to 8 bits that does not accumulate. For a texture with cutout
/// alpha, colors are weighted by alpha, so that transparent texels do not contribute.
#[derive(Clone, Debug)]
pub(crate) struct MipMap<'a> {
    texture: &'a Texture,
    /// Decodes bytes of red, green and blue.
    pub(super) colors: &'static [f32; 256],
    /// Decodes bytes of alpha.
    pub(super) fractions: &'static [f32; 256],
    reduced: Arc<Vec<Reduced>>,
}

/// A mip level above 0.
#[derive(Clone, Debug)]
pub(super) struct Reduced {
    size: [u32; 2],
    texels: Vec<[u8; 4]>,
}

/// A view of a mip level.
#[derive(Clone, Copy)]
pub(crate) struct Image<'a> {
    pub(crate) size: [u32; 2],
    pub(crate) texels: &'a [[u8; 4]],
}

impl<'a> MipMap<'a> {
    /// A texture with only level 0.
    pub(super) fn flat(texture: &'a Texture) -> Self {
        let colors = match texture.encoding {
            Encoding::Srgb => srgb::linear(),
            Encoding::Linear => &*FRACTION,
        };
        Self { texture, colors, fractions: &FRACTION, reduced: Arc::default() }
    }

    /// A texture with all mip levels; with `uses_alpha`, colors are weighted by alpha.
    pub(super) fn new(texture: &'a Texture, uses_alpha: bool) -> Self {
        let mut mip_map = Self::flat(texture);
        if texture.texels.is_empty() {
            return mip_map;
        }
        let mut size = [texture.width, texture.height];
        let (mut means, mut levels): (Vec<[f32; 4]>, _) = (Vec::new(), Vec::new());
        while size != [1, 1] {
            let (from, halved) = (size, size.map(|n| (n / 2).max(1)));
            means = if means.is_empty() {
                reduced(from, halved, uses_alpha, |i| mip_map.decoded(texture.texels[i]))
            } else {
                reduced(from, halved, uses_alpha, |i| means[i])
            };
            size = halved;
            let texels = means.par_iter().with_min_len(1024).map(|&mean| mip_map.encoded(mean)).collect();
            levels.push(Reduced { size, texels });
        }
        mip_map.reduced = Arc::new(levels);
        mip_map
    }

    /// A texture with the mip levels that [`MipMap::shared_levels`] gave for it.
    pub(super) fn with_levels(texture: &'a Texture, levels: &Arc<Vec<Reduced>>) -> Self {
        Self { reduced: Arc::clone(levels), ..Self::flat(texture) }
    }

    /// The levels above 0.
    pub(super) fn shared_levels(&self) -> &Arc<Vec<Reduced>> {
        &self.reduced
    }

    /// Number of levels, including level 0.
    pub(crate) fn n_levels(&self) -> usize {
        1 + self.reduced.len()
    }

    /// A mip level; 0 is the texture.
    pub(crate) fn level(&self, level: usize) -> Image<'_> {
        match level.checked_sub(1) {
            None => Image { size: [self.texture.width, self.texture.height], texels: &self.texture.texels },
            Some(k) => Image { size: self.reduced[k].size, texels: &self.reduced[k].texels },
        }
    }

    pub(super) fn texture(&self) -> &'a Texture {
        self.texture
    }

    /// Width and height of the texture.
    pub(crate) fn size(&self) -> [f64; 2] {
        [self.texture.width, self.texture.height].map(f64::from)
    }

    #[inline]
    pub(super) fn decoded(&self, [r, g, b, a]: [u8; 4]) -> [f32; 4] {
        let color = |byte| self.colors[usize::from(byte)];
        [color(r), color(g), color(b), self.fractions[usize::from(a)]]
    }

    fn encoded(&self, [r, g, b, a]: [f32; 4]) -> [u8; 4] {
        let plain = |x: f32| (255.0 * x).round() as u8;
        match self.texture.encoding {
            Encoding::Srgb => [srgb::encode(r), srgb::encode(g), srgb::encode(b), plain(a)],
            Encoding::Linear => [r, g, b, a].map(plain),
        }
    }
}

/// The texels along one axis that a texel of the next level covers, with their weights.
#[derive(Clone, Copy)]
struct Coverage {
    first: usize,
    /// Two if the size is even, three if it is odd.
    weights: [f32; 3],
}

/// The coverage of `n` texels by `m = max(n / 2, 1)` texels.
fn coverage(n: u32, m: u32) -> Vec<Coverage> {
    let (n, m) = (u64::from(n), u64::from(m));
    // In units of 1/(n·m): a texel of the previous level is m wide, one of the next is n wide.
    let cover = |j: u64| {
        let first = j * n / m;
        let part = |i: u64| ((i + 1) * m).min((j + 1) * n).saturating_sub((i * m).max(j * n)) as f32 / n as f32;
        let first_index = first as usize;
        Coverage { first: first_index, weights: [part(first), part(first + 1), part(first + 2)] }
    };
    (0..m).map(cover).collect()
}

/// Box-filters the image given by `texel`, row by row.
fn reduced(from: [u32; 2], to: [u32; 2], uses_alpha: bool, texel: impl Fn(usize) -> [f32; 4] + Sync) -> Vec<[f32; 4]> {
    let [columns, rows] = [coverage(from[0], to[0]), coverage(from[1], to[1])];
    let width = from[0] as usize;
    let mean = |row: &Coverage, column: &Coverage| {
        let mut plain = [0.0; 4];
        let mut weighted = [0.0; 3];
        for (j, y) in (row.first..).zip(row.weights).filter(|(_, y)| *y > 0.0) {
            for (i, x) in (column.first..).zip(column.weights).filter(|(_, x)| *x > 0.0) {
                let value = texel(j * width + i);
                plain = std::array::from_fn(|k| plain[k] + x * y * value[k]);
                weighted = std::array::from_fn(|k| weighted[k] + x * y * value[3] * value[k]);
            }
        }
        // If all texels are transparent, the weights are zero.
        match weighted.map(|sum| sum / plain[3]) {
            [r, g, b] if uses_alpha && plain[3] > 0.0 => [r, g, b, plain[3]],
            _ => plain,
        }
    };
    let row = |row: &Coverage| columns.iter().map(|column| mean(row, column)).collect::<Vec<_>>();
    rows.par_iter().flat_map_iter(row).collect()
}

/// The four texels around a point, row by row.
pub(crate) type Texels<'a> = [[&'a [u8; 4]; 2]; 2];

impl MipMap<'_> {
    /// Filtered RGBA around `uv`, linear RGB or plain values.
    ///
    /// `v` points up: row 0 of the image is the top, `v = 1`. Trilinear interpolation of decoded values. A texture
    /// without texels is opaque white; a coordinate that is not finite counts as 0.
    pub(crate) fn lookup(&self, uv: [f64; 2], footprint: &Footprint) -> [f32; 4] {
        if self.texture().texels.is_empty() {
            return [1.0; 4];
        }
        let (levels, weight) = self.levels(footprint.level);
        let n = footprint.n_probes;
        if n == 1 {
            return self.trilinear(uv, levels, weight);
        }
        let mut sum = [0.0; 4];
        for probe in 0..n {
            let position = (f64::from(probe) + 0.5) / f64::from(n) - 0.5;
            let uv = std::array::from_fn(|k| uv[k] + position * footprint.along[k]);
            let value = self.trilinear(uv, levels, weight);
            sum = std::array::from_fn(|k| sum[k] + value[k]);
        }
        let n = n as f32;
        sum.map(|x| x / n)
    }

    /// Alpha at `uv`, bilinear at full resolution.
    pub(crate) fn alpha(&self, uv: [f64; 2]) -> f32 {
        if self.texture().texels.is_empty() {
            return 1.0;
        }
        let [alpha] = self.bilinear(0, uv, |texel| [self.fractions[usize::from(texel[3])]]);
        alpha
    }

    /// The finer of two mip levels and the next, and the weight of the second.
    fn levels(&self, level: f64) -> ([usize; 2], f32) {
        let coarsest = (self.n_levels() - 1) as f64;
        // In this order, NaN becomes 0; clamp would keep it.
        let level = level.max(0.0).min(coarsest);
        let finer = level.floor();
        let (first, weight) = (finer as usize, (level - finer) as f32);
        ([first, first + 1], weight)
    }

    fn trilinear(&self, uv: [f64; 2], [finer, coarser]: [usize; 2], weight: f32) -> [f32; 4] {
        let decoded = |texel| self.decoded(texel);
        let fine = self.bilinear(finer, uv, decoded);
        if weight == 0.0 { fine } else { blend(fine, self.bilinear(coarser, uv, decoded), weight) }
    }

    /// The texels around a point at full resolution; `None` without texels.
    #[inline]
    pub(crate) fn texels(&self, uv: [f64; 2]) -> Option<Texels<'_>> {
        (!self.texture().texels.is_empty()).then(|| self.texels_around(0, uv).0)
    }

    #[inline]
    fn bilinear<const N: usize>(&self, level: usize, uv: [f64; 2], decoded: impl Fn([u8; 4]) -> [f32; N]) -> [f32; N] {
        let (texels, [x, y]) = self.texels_around(level, uv);
        let in_row = |[left, right]: [&[u8; 4]; 2]| blend(decoded(*left), decoded(*right), x);
        blend(in_row(texels[0]), in_row(texels[1]), y)
    }

    /// The texels of a mip level around a point, and the weights of the second column and the second row.
    #[inline]
    fn texels_around(&self, level: usize, uv: [f64; 2]) -> (Texels<'_>, [f32; 2]) {
        let Image { size: [width, height], texels } = self.level(level);
        let [wrap_u, wrap_v] = self.texture().wrap;
        let (columns, x) = neighbors(uv[0], width, wrap_u);
        let (rows, y) = neighbors(1.0 - uv[1], height, wrap_v);
        let weights = match self.texture().magnification {
            Magnification::Nearest if level == 0 => [x, y].map(|weight| if weight < 0.5 { 0.0 } else { 1.0 }),
            _ => [x, y],
        };
        let texel = |row: usize, column: usize| &texels[rows[row] * width as usize + columns[column]];
        ([[texel(0, 0), texel(0, 1)], [texel(1, 0), texel(1, 1)]], weights)
    }
}

/// Linear interpolation that never leaves the range of its ends.
#[inline]
fn blend<const N: usize>(a: [f32; N], b: [f32; N], weight: f32) -> [f32; N] {
    let mut blended = a;
    for k in 0..N {
        blended[k] += weight * (b[k] - a[k]);
    }
    blended
}

/// The two texels around a coordinate along one axis, and the weight of the second.
fn neighbors(coordinate: f64, n: u32, wrap: Wrap) -> ([usize; 2], f32) {
    let coordinate = if coordinate.is_finite() { coordinate } else { 0.0 };
    // Reduce first, so that the integers below are small for any coordinate.
    let reduced = match wrap {
        Wrap::Repeat => coordinate - floor(coordinate),
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
        Wrap::Mirror => coordinate - 2.0 * floor(0.5 * coordinate),
    };
    let texels = reduced * f64::from(n) - 0.5;
    let first = floor(texels);
    let index = |i: i64| wrapped(i, i64::from(n), wrap);
    ([index(first as i64), index(first as i64 + 1)], (texels - first) as f32)
}

/// 2^52: larger numbers are integers.
const FIRST_INTEGER: f64 = (1_u64 << 52) as f64;

/// `f64::floor` for a finite `x`, up to the sign of zero. Without SSE4.1 the library version is a function call.
#[inline]
fn floor(x: f64) -> f64 {
    if x.abs() >= FIRST_INTEGER {
        return x;
    }
    let towards_zero = (x as i64) as f64;
    if towards_zero > x { towards_zero - 1.0 } else { towards_zero }
}

/// The texel with index `i` after wrapping, for `i` at most one beyond the reduced range.
fn wrapped(i: i64, n: i64, wrap: Wrap) -> usize {
    // Comparisons instead of a division, because this runs for every texel.
    let inside = match wrap {
        Wrap::Repeat if i < 0 => n - 1,
        Wrap::Repeat if i >= n => 0,
        Wrap::Repeat => i,
        Wrap::Clamp => i.clamp(0, n - 1),
        // At the mirrored edge both neighbors are texel 0.
        Wrap::Mirror if i < 0 || i >= 2 * n => 0,
        Wrap::Mirror => i.min(2 * n - 1 - i),
    };
    inside as usize
}

#[cfg(test)]
mod tests {
    use canted_scene::{Encoding, Magnification, Texture, Wrap};

    use super::*;

    fn texture(width: u32, height: u32, encoding: Encoding, texel: impl Fn(u32) -> [u8; 4]) -> Texture {
        let texels = (0..width * height).map(texel).collect();
        let (name, wrap, magnification) = (String::new(), [Wrap::Repeat; 2], Magnification::Linear);
        Texture { name, width, height, texels, encoding, wrap, magnification }
    }

    /// Pseudorandom bytes.
    fn noise(i: u32) -> [u8; 4] {
        i.wrapping_mul(2_654_435_761).rotate_left(i % 32).to_le_bytes()
    }

    fn mean(mip_map: &MipMap, level: usize) -> [f64; 4] {
        let image = mip_map.level(level);
        let sum = image
            .texels
            .iter()
            .map(|&texel| mip_map.decoded(texel))
            .fold([0.0; 4], |sum: [f64; 4], texel| std::array::from_fn(|k| sum[k] + f64::from(texel[k])));
        sum.map(|x| x / image.texels.len() as f64)
    }

    /// The first level whose mean differs from the texture's by more than half a byte, at the steepest slope of the
    /// sRGB curve, 2.4 / 1.055. The millionth exceeds the rounding error of the sums.
    fn first_changed_level(mip_map: &MipMap) -> Option<usize> {
        const HALF_BYTE: f64 = 0.5 / 255.0 * 2.4 / 1.055 + 1e-6;
        let all = mean(mip_map, 0);
        (1..mip_map.n_levels()).find(|&level| (0..4).any(|k| (mean(mip_map, level)[k] - all[k]).abs() > HALF_BYTE))
    }

    #[test]
    fn levels_are_filtered_in_linear_light() {
        let checker = |i: u32| if (i / 2 + i).is_multiple_of(2) { [0, 0, 0, 255] } else { [255; 4] };
        let half = |encoding| MipMap::new(&texture(2, 2, encoding, checker), false).level(1).texels.to_vec();
        // Linear 0.5 is sRGB byte 188.
        assert_eq!(half(Encoding::Srgb), [[188, 188, 188, 255]]);
        assert_eq!(half(Encoding::Linear), [[128, 128, 128, 255]]);
        // Five columns become two of width 2.5, which share the center column.
        let row = texture(5, 1, Encoding::Linear, |i| [[10, 20, 30, 60, 120][i as usize]; 4]);
        assert_eq!(MipMap::new(&row, false).level(1).texels, [[18; 4], [78; 4]]);
    }

    #[test]
    fn levels_preserve_the_mean() {
        for [width, height] in [[64, 64], [1, 1], [1, 37], [29, 1], [31, 17], [100, 3], [5, 6]] {
            for encoding in [Encoding::Srgb, Encoding::Linear] {
                let texture = texture(width, height, encoding, noise);
                let mip_map = MipMap::new(&texture, false);
                assert_eq!(mip_map.level(mip_map.n_levels() - 1).size, [1, 1]);
                assert_eq!(first_changed_level(&mip_map), None, "{width} x {height} {encoding:?}");
            }
        }
    }

    #[test]
    fn test_detects_level_that_is_too_bright() {
        let texture = texture(16, 16, Encoding::Linear, noise);
        let mut mip_map = MipMap::new(&texture, false);
        for texel in &mut Arc::make_mut(&mut mip_map.reduced)[1].texels {
            texel[0] = texel[0].saturating_add(3);
        }
        assert_eq!(first_changed_level(&mip_map), Some(2));
    }

    #[test]
    fn transparent_texels_do_not_contribute() {
        let leaf = texture(2, 1, Encoding::Srgb, |i| if i == 0 { [200, 10, 0, 255] } else { [0, 255, 255, 0] });
        assert_eq!(MipMap::new(&leaf, true).level(1).texels, [[200, 10, 0, 128]]);
        let clear = texture(2, 1, Encoding::Linear, |i| if i == 0 { [200, 10, 0, 0] } else { [100, 20, 0, 0] });
        assert_eq!(MipMap::new(&clear, true).level(1).texels, [[150, 15, 0, 0]]);
    }

    fn lookup(texture: &Texture, uv: [f64; 2]) -> [f32; 4] {
        MipMap::flat(texture).lookup(uv, &Footprint::POINT)
    }

    /// Two columns and two rows: top left, top right, bottom left, bottom right in the red channel.
    fn checker(wrap: Wrap) -> Texture {
        let texel = |r| [r, 0, 0, r];
        Texture {
            name: "checker".into(),
            width: 2,
            height: 2,
            texels: vec![texel(255), texel(0), texel(0), texel(255)],
            encoding: Encoding::Srgb,
            wrap: [wrap; 2],
            magnification: Magnification::Linear,
        }
    }

    #[test]
    fn nearest_texels_have_sharp_edges() {
        let nearest = |u: f64| {
            let texture = Texture { magnification: Magnification::Nearest, ..checker(Wrap::Repeat) };
            let mip_map = MipMap::new(&texture, false);
            [0.0, 0.5].map(|level| mip_map.lookup([u, 0.9], &Footprint { level, ..Footprint::POINT })[0])
        };
        for (u, want) in [(0.01, 1.0), (0.3, 1.0), (0.499, 1.0), (0.501, 0.0), (0.99, 0.0), (-0.01, 0.0), (1.01, 1.0)] {
            let [near, between] = nearest(u);
            assert_eq!(near, want, "{u}");
            // Half of it is the mean of all texels.
            assert!((between - (0.5 * want + 0.25)).abs() < 0.01, "{u}: {between}");
        }
        assert_eq!(lookup(&checker(Wrap::Repeat), [0.5, 0.75])[0], 0.5);
    }

    #[test]
    fn texel_centers_are_exact_and_v_points_up() {
        let texture =
            Texture { texels: vec![[255, 0, 0, 1], [0, 255, 0, 2], [0, 0, 255, 3], [128; 4]], ..checker(Wrap::Repeat) };
        assert_eq!(lookup(&texture, [0.25, 0.75]), [1.0, 0.0, 0.0, 1.0 / 255.0]);
        assert_eq!(lookup(&texture, [0.75, 0.75]), [0.0, 1.0, 0.0, 2.0 / 255.0]);
        assert_eq!(lookup(&texture, [0.25, 0.25]), [0.0, 0.0, 1.0, 3.0 / 255.0]);
    }

    #[test]
    fn midpoint_is_the_linear_mean() {
        assert_eq!(lookup(&checker(Wrap::Repeat), [0.5, 0.5])[0], 0.5);
    }

    #[test]
    fn wrap_modes_extend_the_image() {
        // Along the top row the texels are 1, 0; sampled at the center of texel i for i = -2..4.
        for (wrap, expected) in [
            (Wrap::Repeat, [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]),
            (Wrap::Clamp, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
            (Wrap::Mirror, [0.0, 1.0, 1.0, 0.0, 0.0, 1.0]),
        ] {
            let texture = checker(wrap);
            for (i, want) in (-2..4).zip(expected) {
                assert_eq!(lookup(&texture, [0.25 + 0.5 * f64::from(i), 0.75])[0], want, "{wrap:?} texel {i}");
            }
        }
    }

    #[test]
    fn edges_interpolate_with_wrapped_texels() {
        let left_edge = |wrap| lookup(&checker(wrap), [0.0, 0.75])[0];
        assert_eq!(left_edge(Wrap::Repeat), 0.5);
        assert_eq!(left_edge(Wrap::Clamp), 1.0);
        assert_eq!(left_edge(Wrap::Mirror), 1.0);
    }

    #[test]
    fn floor_matches_std() {
        let last = FIRST_INTEGER - 0.5;
        for x in [0.0, 1e-320, 0.5, 1.0 - 0.5 * f64::EPSILON, 1.0, 1.5, 1e9 + 0.25, last, FIRST_INTEGER, 1e30, f64::MAX]
        {
            for x in [x, -x] {
                assert_eq!(floor(x), x.floor(), "{x}");
            }
        }
    }

    #[test]
    fn every_coordinate_has_a_color() {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for c in [1e30, -1e30, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1.0 - f64::EPSILON, -1e-320] {
                let [r, .., a] = lookup(&checker(wrap), [c, c]);
                assert!((0.0..=1.0).contains(&r) && (0.0..=1.0).contains(&a), "{wrap:?} {c}");
            }
        }
    }
}
