//! FLIP compared with the authors' program, on pictures made of small integers.

use super::*;

const SIZE: [u32; 2] = [40, 28];

/// Multiples of 1/64 in 0..=1: tiles of three values with noise, shifted by `shift` pixels, as in `tests/oracle/flip.py`.
fn picture(shift: u32, is_hdr: bool) -> Picture {
    let mut picture = Picture::filled(SIZE[0], SIZE[1], [0.0; 3]);
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let index = picture.index(x, y);
        for (c, channel) in (0..).zip(&mut picture.pixels[index]) {
            let tile = ((x + shift) / 7 + y / 5) % 3;
            let grain = (x * 13 + y * 29 + c * 17 + x * y * (c + 3)) % 11;
            let value = (tile * 21 + grain * (1 + shift) + c * 4 * shift).min(64);
            let gain = if is_hdr { ((x / 8) as f32 - 1.0).exp2() } else { 1.0 };
            *channel = value as f32 / 64.0 * gain;
        }
    }
    picture
}

/// Output of `flip-evaluator` 1.7 in `tests/oracle/flip.py`: pixels per degree, mean, and errors at [`POSITIONS`].
type Published = (f64, f64, [f64; 4]);
const POSITIONS: [[u32; 2]; 4] = [[0, 0], [11, 9], [39, 27], [20, 14]];

/// The authors' program computes in `f32`: sums over about 400 weights and powers keep five digits.
const THEIR_ROUNDING: f64 = 2e-5;

#[track_caller]
fn assert_published(flip: &Flip, &(pixels_per_degree, mean, places): &Published) {
    let close = |a: f64, b: f64| (a - b).abs() < THEIR_ROUNDING;
    assert!(close(flip.mean(), mean), "{pixels_per_degree}: mean {} is not {mean}", flip.mean());
    for ([x, y], want) in POSITIONS.into_iter().zip(places) {
        let got = flip.errors()[(y * SIZE[0] + x) as usize].unwrap();
        assert!(close(got, want), "{pixels_per_degree}: at ({x}, {y}) {got} is not {want}");
    }
}

#[test]
fn ldr_errors_match_the_reference() {
    for published in [
        (PIXELS_PER_DEGREE, 0.461_863_0, [0.617_201, 0.387_120, 0.440_873, 0.439_847]),
        (30.0, 0.516_713_9, [0.636_657, 0.371_347, 0.435_173, 0.672_631]),
    ] {
        assert_published(&flip(&picture(1, false), &picture(0, false), published.0).unwrap(), &published);
    }
}

#[test]
fn hdr_errors_match_the_reference() {
    for published in [
        (PIXELS_PER_DEGREE, 0.435_380_1, [0.728_206, 0.403_897, 0.317_787, 0.334_842]),
        (30.0, 0.487_107_3, [0.768_770, 0.393_750, 0.253_116, 0.538_414]),
    ] {
        assert_published(&flip_hdr(&picture(1, true), &picture(0, true), published.0).unwrap(), &published);
    }
}

#[test]
fn equal_pictures_have_no_error_and_the_order_hardly_matters() {
    let [a, b] = [0, 1].map(|shift| picture(shift, false));
    assert!(flip(&a, &a, PIXELS_PER_DEGREE).unwrap().errors().iter().all(|&error| error == Some(0.0)));
    let [forth, back] = [(&a, &b), (&b, &a)].map(|(a, b)| flip(a, b, PIXELS_PER_DEGREE).unwrap().mean());
    assert!((forth - back).abs() < 1e-12, "LDR-FLIP is symmetric: {forth} {back}");
}

#[test]
fn pixels_that_are_not_finite_have_no_error() {
    let (a, mut b) = (picture(1, false), picture(0, false));
    b.pixels[7] = [f32::NAN; 3];
    let found = flip(&a, &b, PIXELS_PER_DEGREE).unwrap();
    assert!(found.errors()[7].is_none() && found.mean().is_finite());
    assert_eq!(found.picture().pixels[7], [1.0, 0.0, 1.0]);
    b.pixels.fill([f32::INFINITY; 3]);
    assert_eq!(flip_hdr(&a, &b, PIXELS_PER_DEGREE), Err(CompareError::NothingFinite));
    let small = Picture::filled(1, 1, [0.0; 3]);
    assert!(matches!(flip(&small, &b, PIXELS_PER_DEGREE), Err(CompareError::Size { .. })));
}
