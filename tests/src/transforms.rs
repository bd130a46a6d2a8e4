//! Instance transforms: rotated, mirrored, stretched, sheared, small, large and far away.

use canted_fixtures::{Rotation, SplitMix64};
use canted_obb::Affine;

/// The columns of a rotation times a diagonal matrix, then a translation.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
pub fn affine(turn: &Rotation, scale: [f64; 3], shift: [f32; 3]) -> Affine {
    let column = |j: usize| turn.rows.map(|row| (row[j] * scale[j]) as f32);
    Affine { columns: [column(0), column(1), column(2), shift] }
}

/// One transform of each kind, by name.
#[must_use]
pub fn transforms() -> Vec<(&'static str, Affine)> {
    let turn = Rotation::off_axis();
    let far = [1e7, -1e7, 3e6];
    let shear = Affine { columns: [[1.0, 0.0, 0.0], [0.7, 1.0, 0.0], [-0.4, 0.9, 1.0], [0.2, 0.1, -0.3]] };
    vec![
        ("identity", Affine::IDENTITY),
        ("rotation", affine(&turn, [1.0; 3], [0.3, -0.2, 0.5])),
        ("mirror", affine(&Rotation::IDENTITY, [-1.0, 1.0, 1.0], [0.1, 0.0, 0.0])),
        ("unequal scale", affine(&turn, [3.0, 0.2, 1.5], [-0.5, 0.4, 0.0])),
        ("shear", shear),
        ("scale 1e-3", affine(&turn, [1e-3; 3], [0.4, 0.4, 0.4])),
        ("scale 1e3, mirrored", affine(&turn, [1e3, 1e3, -1e3], [-300.0, -200.0, 100.0])),
        ("far", affine(&turn, [50.0, 60.0, 40.0], far)),
        ("far, large", affine(&Rotation::IDENTITY, [1e4, -1e4, 2e4], far)),
        ("far, sheared", Affine { columns: [[90.0, 10.0, 0.0], [50.0, 100.0, 0.0], [-40.0, 9.0, 80.0], far] }),
    ]
}

/// All kinds of transforms, and many small rotated copies that overlap.
#[must_use]
pub fn crowd() -> Vec<Affine> {
    let mut rng = SplitMix64::new(31);
    let mut placed: Vec<Affine> = transforms().into_iter().map(|(_, affine)| affine).collect();
    placed.extend((0..40).map(|_| {
        let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
        let scale = std::array::from_fn(|_| 0.3 + rng.unit());
        #[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
        let shift = rng.signed3().map(|x| x as f32);
        affine(&turn, scale, shift)
    }));
    placed
}
