//! Numbers in false color, with a legend of digits.

use crate::{Picture, srgb};

/// Shows one number per pixel, row by row, in false color: 0 in the darkest color, `full_scale` and above in the brightest.
///
/// A picture that is large enough has a legend in its lower left corner.
#[must_use]
pub fn false_color(numbers: impl Iterator<Item = u64>, [width, height]: [u32; 2], full_scale: u32) -> Picture {
    let color = |n: u64| viridis(n as f64 / f64::from(full_scale.max(1)));
    let mut picture = Picture { width, height, pixels: numbers.map(color).collect() };
    draw_legend(&mut picture, full_scale);
    picture
}

/// Draws a color bar on black, with the numbers 0, half and full scale above it.
fn draw_legend(picture: &mut Picture, full_scale: u32) {
    const BAR: [u32; 2] = [128, 6];
    const MARGIN: u32 = 4;
    const GAP: u32 = 2;
    let size = [BAR[0] + 2 * MARGIN, DIGIT_HEIGHT + GAP + BAR[1] + 2 * MARGIN];
    // Dots grow with the picture; a legend that would fill half of it is not drawn.
    let scale = (picture.height / 360).max(1).min(picture.width / size[0]);
    if scale == 0 || 2 * size[1] * scale > picture.height {
        return;
    }
    let top = picture.height - size[1] * scale;
    picture.fill([0, top], size.map(|s| s * scale), [0.0; 3]);
    let bar_top = top + (MARGIN + DIGIT_HEIGHT + GAP) * scale;
    for x in 0..BAR[0] * scale {
        let value = f64::from(x) / f64::from(BAR[0] * scale - 1);
        picture.fill([MARGIN * scale + x, bar_top], [1, BAR[1] * scale], viridis(value));
    }
    for (number, halves) in [(0, 0), (full_scale / 2, 1), (full_scale, 2)] {
        // Flush left, centered, flush right.
        let slack = (BAR[0] * scale).saturating_sub(number_width(number, scale));
        draw_number(picture, number, [MARGIN * scale + slack * halves / 2, top + MARGIN * scale], scale, [1.0; 3]);
    }
}

/// The viridis color map (van der Walt and Smith 2015) at nine even steps, in sRGB bytes, interpolated linearly.
///
/// Lightness increases evenly, so the order of values shows in gray and to color-blind readers too.
const ANCHORS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Linear RGB of a value, which is clamped to 0..=1.
pub(crate) fn viridis(value: f64) -> [f32; 3] {
    let last = ANCHORS.len() - 1;
    let position = value.clamp(0.0, 1.0) * last as f64;
    let first = (position as usize).min(last - 1);
    let weight = position - position.floor().min((last - 1) as f64);
    std::array::from_fn(|k| {
        let (a, b) = (f64::from(ANCHORS[first][k]), f64::from(ANCHORS[first + 1][k]));
        srgb::to_linear((a + weight * (b - a)) / 255.0) as f32
    })
}

/// Width of a digit, and the distance between digits, in dots.
const DIGIT_WIDTH: u32 = 5;
const DIGIT_STEP: u32 = DIGIT_WIDTH + 1;
/// Height of a digit in dots.
const DIGIT_HEIGHT: u32 = 7;

/// Ten digits of 5 x 7 dots: rows from the top; bit 4 is the leftmost dot.
const DIGITS: [[u8; DIGIT_HEIGHT as usize]; 10] = [
    [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
    [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
    [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
    [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110],
    [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
    [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
    [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
    [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
    [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
    [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
];

fn digits_of(number: u32) -> Vec<u8> {
    number.to_string().into_bytes().into_iter().map(|character| character - b'0').collect()
}

/// Width of a number in pixels, each dot `scale` pixels wide.
fn number_width(number: u32, scale: u32) -> u32 {
    // A number has at most ten digits.
    let n = u32::try_from(digits_of(number).len()).unwrap_or(u32::MAX);
    (n * DIGIT_STEP - 1) * scale
}

/// Draws a number with its top left corner at (`left`, `top`), clipped to the picture.
fn draw_number(picture: &mut Picture, number: u32, [left, top]: [u32; 2], scale: u32, color: [f32; 3]) {
    for (index, digit) in (0..).zip(digits_of(number)) {
        for (row, bits) in (0..).zip(DIGITS[usize::from(digit)]) {
            for column in (0..DIGIT_WIDTH).filter(|column| bits >> (DIGIT_WIDTH - 1 - column) & 1 == 1) {
                picture.fill([left + (index * DIGIT_STEP + column) * scale, top + row * scale], [scale; 2], color);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_increases() {
        let luminance = |value: f64| srgb::luminance(viridis(value).map(f64::from));
        for i in 0..256 {
            let value = f64::from(i) / 256.0;
            assert!(luminance(value) < luminance(value + 1.0 / 256.0), "at {value}");
        }
    }

    #[test]
    fn ends_and_anchors_are_the_published_bytes() {
        let bytes = |value| viridis(value).map(srgb::encode);
        assert_eq!(bytes(0.0), ANCHORS[0]);
        assert_eq!(bytes(0.5), ANCHORS[4]);
        assert_eq!(bytes(1.0), ANCHORS[8]);
        assert_eq!(bytes(-3.0), ANCHORS[0]);
        assert_eq!(bytes(7.0), ANCHORS[8]);
    }

    #[test]
    fn a_number_has_its_position_and_width() {
        let mut picture = Picture::filled(40, 20, [0.0; 3]);
        draw_number(&mut picture, 11, [3, 4], 2, [1.0; 3]);
        let lit: Vec<[u32; 2]> = (0..20)
            .flat_map(|y| (0..40).map(move |x| [x, y]))
            .filter(|&[x, y]| picture.pixels[picture.index(x, y)] == [1.0; 3])
            .collect();
        // The digit 1 has eleven dots of four pixels each, and no dot in its outermost columns.
        let dots: u32 = DIGITS[1].iter().map(|row| row.count_ones()).sum();
        assert_eq!(lit.len(), 2 * 4 * dots as usize);
        let (left, right) = (lit.iter().map(|p| p[0]).min().unwrap(), lit.iter().map(|p| p[0]).max().unwrap());
        assert_eq!((left, right), (3 + 2, 3 + number_width(11, 2) - 1 - 2));
        assert_eq!(lit.iter().map(|p| p[1]).min(), Some(4));
        assert_eq!(lit.iter().map(|p| p[1]).max(), Some(4 + 2 * DIGIT_HEIGHT - 1));
    }

    #[test]
    fn numbers_are_clipped() {
        let mut picture = Picture::filled(4, 4, [0.0; 3]);
        draw_number(&mut picture, u32::MAX, [2, 2], 3, [1.0; 3]);
        draw_number(&mut picture, 8, [100, 100], 1, [1.0; 3]);
        assert_eq!(picture.pixels[0], [0.0; 3]);
    }
}
