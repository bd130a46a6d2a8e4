//! Ten digits of 5 x 7 dots, for the numbers of a legend.

use crate::Picture;

/// Width of a digit, and the distance between digits, in dots.
const WIDTH: u32 = 5;
const STEP: u32 = WIDTH + 1;
/// Height of a digit in dots.
pub(crate) const HEIGHT: u32 = 7;

/// Rows from the top; bit 4 is the leftmost dot.
const DIGITS: [[u8; HEIGHT as usize]; 10] = [
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
pub(crate) fn width(number: u32, scale: u32) -> u32 {
    // A number has at most ten digits.
    let n = u32::try_from(digits_of(number).len()).unwrap_or(u32::MAX);
    (n * STEP - 1) * scale
}

/// Draws a number with its top left corner at (`left`, `top`), clipped to the picture.
pub(crate) fn draw(picture: &mut Picture, number: u32, [left, top]: [u32; 2], scale: u32, color: [f32; 3]) {
    for (index, digit) in (0..).zip(digits_of(number)) {
        for (row, bits) in (0..).zip(DIGITS[usize::from(digit)]) {
            for column in (0..WIDTH).filter(|column| bits >> (WIDTH - 1 - column) & 1 == 1) {
                picture.fill([left + (index * STEP + column) * scale, top + row * scale], [scale; 2], color);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_differ_and_fill_their_height() {
        for (i, digit) in DIGITS.iter().enumerate() {
            assert!(digit.iter().all(|&row| row != 0 && row < 1 << WIDTH), "digit {i}");
            assert!(DIGITS[..i].iter().all(|other| other != digit), "digit {i}");
        }
    }

    #[test]
    fn a_number_has_its_position_and_width() {
        let mut picture = Picture::filled(40, 20, [0.0; 3]);
        draw(&mut picture, 11, [3, 4], 2, [1.0; 3]);
        let lit: Vec<[u32; 2]> = (0..20)
            .flat_map(|y| (0..40).map(move |x| [x, y]))
            .filter(|&[x, y]| picture.pixels[picture.index(x, y)] == [1.0; 3])
            .collect();
        // The digit 1 has eleven dots of four pixels each, and no dot in its outermost columns.
        let dots: u32 = DIGITS[1].iter().map(|row| row.count_ones()).sum();
        assert_eq!(lit.len(), 2 * 4 * dots as usize);
        let (left, right) = (lit.iter().map(|p| p[0]).min().unwrap(), lit.iter().map(|p| p[0]).max().unwrap());
        assert_eq!((left, right), (3 + 2, 3 + width(11, 2) - 1 - 2));
        assert_eq!(lit.iter().map(|p| p[1]).min(), Some(4));
        assert_eq!(lit.iter().map(|p| p[1]).max(), Some(4 + 2 * HEIGHT - 1));
    }

    #[test]
    fn numbers_are_clipped() {
        let mut picture = Picture::filled(4, 4, [0.0; 3]);
        draw(&mut picture, u32::MAX, [2, 2], 3, [1.0; 3]);
        draw(&mut picture, 8, [100, 100], 1, [1.0; 3]);
        assert_eq!(picture.pixels[0], [0.0; 3]);
    }
}
