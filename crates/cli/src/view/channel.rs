//! Channels as pictures.

use canted_film::{Aov, AovValues, Film, Picture, false_color};

/// Shows a channel of a film: depth as gray, near bright; normals as colors from -1 to 1; ids as a color each; tests in false color.
pub(super) fn picture(film: &Film, aov: Aov) -> Picture {
    let size = [film.width(), film.height()];
    let black = || Picture::filled(size[0], size[1], [0.0; 3]);
    let pixels = match (film.aov(aov), aov) {
        (None, _) => return black(),
        (Some(AovValues::Ids(ids)), _) => ids.into_iter().map(color_of).collect(),
        (Some(AovValues::Numbers(numbers)), Aov::Depth) => grays(&numbers),
        (Some(AovValues::Numbers(numbers)), Aov::Tests) => {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts")]
            let boxes = numbers.chunks(2).map(|tests| tests[0] as u64);
            return false_color(boxes, size, 128);
        }
        (Some(AovValues::Numbers(numbers)), Aov::Albedo) => numbers.chunks(3).map(|c| [c[0], c[1], c[2]]).collect(),
        (Some(AovValues::Numbers(numbers)), _) => {
            numbers.chunks(3).map(|c| [c[0], c[1], c[2]].map(|x| linear(0.5 + 0.5 * x))).collect()
        }
    };
    Picture { pixels, ..black() }
}

/// The linear value that is encoded as `x`, so that a value of one half is a middle gray on the screen.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn linear(x: f32) -> f32 {
    canted_film::srgb::to_linear(f64::from(x)) as f32
}

/// Depths between the nearest and the farthest, from white to dark gray; black without hits.
fn grays(depths: &[f32]) -> Vec<[f32; 3]> {
    let finite = || depths.iter().copied().filter(|depth| depth.is_finite());
    let (near, far) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let range = (far - near).max(f32::MIN_POSITIVE);
    let gray = |&depth: &f32| if depth.is_finite() { linear(1.0 - 0.85 * (depth - near) / range) } else { 0.0 };
    depths.iter().map(|depth| [gray(depth); 3]).collect()
}

/// A color for an id; black for none. Near ids have different colors.
fn color_of(id: u32) -> [f32; 3] {
    if id == u32::MAX {
        return [0.0; 3];
    }
    let mixed = id.wrapping_add(1).wrapping_mul(0x9E37_79B9);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85EB_CA6B);
    #[expect(clippy::cast_precision_loss, reason = "eight bits")]
    let part = |shift: u32| linear(0.2 + 0.8 * ((mixed >> shift & 255) as f32) / 255.0);
    [part(0), part(8), part(16)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_bright_and_a_miss_is_black() {
        let [near, far, miss] = grays(&[1.0, 5.0, f32::INFINITY])[..] else { panic!("three pixels") };
        assert!(near[0] > far[0] && far[0] > 0.0 && miss == [0.0; 3]);
        assert_eq!(grays(&[2.0])[0], [1.0; 3]);
        assert!(color_of(0) != color_of(1) && color_of(u32::MAX) == [0.0; 3]);
    }
}
