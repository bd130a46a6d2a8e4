use canted_scene::{Magnification, Wrap};

use super::Footprint;
use super::mip_map::{Image, MipMap};

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
        #[expect(clippy::cast_precision_loss, reason = "at most 16")]
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
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the last level")]
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
        let [above, below] = texels.map(|[left, right]| blend(decoded(*left), decoded(*right), x));
        blend(above, below, y)
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
        (rows.map(|j| columns.map(|i| &texels[j * width as usize + i])), weights)
    }
}

/// Linear interpolation that never leaves the range of its ends.
fn blend<const N: usize>(a: [f32; N], b: [f32; N], weight: f32) -> [f32; N] {
    std::array::from_fn(|k| a[k] + weight * (b[k] - a[k]))
}

/// The two texels around a coordinate along one axis, and the weight of the second.
#[expect(clippy::cast_possible_truncation, reason = "the coordinate was reduced to at most two images")]
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
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "integers below 2^52 are exact")]
fn floor(x: f64) -> f64 {
    if x.abs() >= FIRST_INTEGER {
        return x;
    }
    let towards_zero = (x as i64) as f64;
    if towards_zero > x { towards_zero - 1.0 } else { towards_zero }
}

/// The texel with index `i` after wrapping, for `i` at most one beyond the reduced range.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the result lies in 0..n")]
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
    use super::*;
    use canted_scene::{Encoding, Texture};

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
