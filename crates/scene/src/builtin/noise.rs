//! Hash-based noise with integer arithmetic, identical on every platform.

/// A uniform random number in `[0, 1)` per cell.
pub(super) fn random(cell: [i32; 2], seed: u32) -> f64 {
    let [x, y] = cell.map(i32::cast_unsigned);
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    for multiplier in [0x7feb_352d, 0x846c_a68b] {
        h = (h ^ (h >> 16)).wrapping_mul(multiplier);
    }
    f64::from(h ^ (h >> 16)) / 4_294_967_296.0
}

/// Smooth value noise in `[-1, 1]` with lattice spacing 1 and the given period.
///
/// Source: Perlin, "Improving noise", 2002, for the quintic interpolation.
#[expect(clippy::cast_possible_truncation, reason = "the scene spans some thousand cells")]
pub(super) fn noise(x: f64, y: f64, period: i32, seed: u32) -> f64 {
    let (cell_x, cell_y) = (x.floor(), y.floor());
    let [u, v] = [x - cell_x, y - cell_y].map(|f| f * f * f * (f * (f * 6.0 - 15.0) + 10.0));
    let at =
        |i: i32, j: i32| random([(cell_x as i32 + i).rem_euclid(period), (cell_y as i32 + j).rem_euclid(period)], seed);
    let near = at(0, 0) + (at(1, 0) - at(0, 0)) * u;
    let far = at(0, 1) + (at(1, 1) - at(0, 1)) * u;
    2.0 * (near + (far - near) * v) - 1.0
}

/// Five octaves of noise in `[-1, 1]`; the first has lattice spacing 1.
pub(super) fn hills(x: f64, y: f64, seed: u32) -> f64 {
    let octave = |i: u32| {
        let frequency = f64::from(1 << i);
        noise(frequency * x, frequency * y, 1 << 20, seed + i) / frequency
    };
    (0..5).map(octave).sum::<f64>() / 1.9375
}
