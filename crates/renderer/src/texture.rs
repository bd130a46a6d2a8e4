use canted_scene::{Texture, Wrap};

use crate::srgb;

/// Linear RGB and alpha of a texture at `uv`, bilinear between the four nearest texel centres.
///
/// `v` runs up: row 0 of the image is the top, `v = 1`. Colours are decoded from sRGB before they are blended. A
/// texture without texels is opaque white, and a coordinate that is not finite counts as 0.
pub(crate) fn lookup(texture: &Texture, uv: [f64; 2]) -> [f32; 4] {
    if texture.texels.is_empty() {
        return [1.0; 4];
    }
    let (columns, x) = neighbours(uv[0], texture.width, texture.wrap[0]);
    let (rows, y) = neighbours(1.0 - uv[1], texture.height, texture.wrap[1]);
    let row = |j: usize| {
        let texel = |i: usize| {
            let [r, g, b, a] = texture.texels[rows[j] * texture.width as usize + columns[i]];
            [srgb::decode(r), srgb::decode(g), srgb::decode(b), f32::from(a) / 255.0]
        };
        blend(texel(0), texel(1), x)
    };
    blend(row(0), row(1), y)
}

/// `a` at weight 0, `b` at weight 1, never outside the range between them.
fn blend(a: [f32; 4], b: [f32; 4], weight: f32) -> [f32; 4] {
    std::array::from_fn(|k| a[k] + weight * (b[k] - a[k]))
}

/// The two texels about a coordinate along one axis, and the weight of the second.
#[expect(clippy::cast_possible_truncation, reason = "the coordinate was reduced to at most two images")]
fn neighbours(coordinate: f64, n: u32, wrap: Wrap) -> ([usize; 2], f32) {
    let coordinate = if coordinate.is_finite() { coordinate } else { 0.0 };
    // Reduce first, so that the integers below stay small for any coordinate.
    let reduced = match wrap {
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
        Wrap::Mirror => coordinate - 2.0 * (0.5 * coordinate).floor(),
    };
    let texels = reduced * f64::from(n) - 0.5;
    let first = texels.floor();
    let index = |i: i64| wrapped(i, i64::from(n), wrap);
    ([index(first as i64), index(first as i64 + 1)], (texels - first) as f32)
}

/// Index of texel `i` of the endless row that `wrap` makes of `n` texels.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the result lies in 0..n")]
fn wrapped(i: i64, n: i64, wrap: Wrap) -> usize {
    let inside = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let twice = i.rem_euclid(2 * n);
            twice.min(2 * n - 1 - twice)
        }
    };
    inside as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_scene::Encoding;

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
        }
    }

    #[test]
    fn texel_centres_are_exact_and_v_runs_up() {
        let texture =
            Texture { texels: vec![[255, 0, 0, 1], [0, 255, 0, 2], [0, 0, 255, 3], [128; 4]], ..checker(Wrap::Repeat) };
        assert_eq!(lookup(&texture, [0.25, 0.75]), [1.0, 0.0, 0.0, 1.0 / 255.0]);
        assert_eq!(lookup(&texture, [0.75, 0.75]), [0.0, 1.0, 0.0, 2.0 / 255.0]);
        assert_eq!(lookup(&texture, [0.25, 0.25]), [0.0, 0.0, 1.0, 3.0 / 255.0]);
    }

    #[test]
    fn halfway_is_the_linear_mean() {
        assert_eq!(lookup(&checker(Wrap::Repeat), [0.5, 0.5])[0], 0.5);
    }

    #[test]
    fn wrap_modes_continue_the_image_beyond_its_edges() {
        // Along the top row the texels are 1, 0; sampled at the centre of texel i for i = -2..4.
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
    fn the_edge_blends_with_what_the_wrap_mode_puts_beyond() {
        let left_edge = |wrap| lookup(&checker(wrap), [0.0, 0.75])[0];
        assert_eq!(left_edge(Wrap::Repeat), 0.5);
        assert_eq!(left_edge(Wrap::Clamp), 1.0);
        assert_eq!(left_edge(Wrap::Mirror), 1.0);
    }

    #[test]
    fn any_coordinate_has_a_colour() {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for c in [1e30, -1e30, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1.0 - f64::EPSILON, -1e-320] {
                let [r, .., a] = lookup(&checker(wrap), [c, c]);
                assert!((0.0..=1.0).contains(&r) && (0.0..=1.0).contains(&a), "{wrap:?} {c}");
            }
        }
    }
}
