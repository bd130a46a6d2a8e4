//! What the tests of several readers share: a cube, an image, damaged files.

use image::ImageFormat;
use proptest::prelude::*;
use proptest::sample::Index;

use super::error::ReadError;
use crate::Scene;

/// The sides of the unit cube, counter-clockwise seen from outside, by the numbers of its corners.
pub(crate) const QUADS: [[u8; 4]; 6] =
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// Corner `k` of the unit cube.
pub(crate) fn corner(k: u8) -> [f32; 3] {
    [0, 1, 2].map(|axis| f32::from(k >> axis & 1))
}

/// Asserts that a scene is the cube in the order of its corners and sides.
#[track_caller]
pub(crate) fn is_cube(scene: Result<Scene, ReadError>, warnings: &[&str]) -> Scene {
    let scene = scene.unwrap();
    assert_eq!(scene.warnings, warnings);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [0, 1, 2, 3, 4, 5, 6, 7].map(corner));
    let fans = QUADS.map(|quad| quad.map(u32::from)).map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    assert_eq!(mesh.triangles, fans.as_flattened());
    scene
}

/// Asserts that every file cut off before the byte `end` is rejected.
#[track_caller]
pub(crate) fn rejects_truncations<'a, T, E>(bytes: &'a [u8], end: usize, read: impl Fn(&'a [u8]) -> Result<T, E>) {
    for length in 0..end {
        assert!(read(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
}

/// A 5 x 3 image with a different color in each texel.
pub(crate) fn encoded(format: ImageFormat) -> Vec<u8> {
    let channel = |x: u32| u8::try_from(x).unwrap();
    let image = image::RgbImage::from_fn(5, 3, |x, y| image::Rgb([channel(40 * x), channel(80 * y), 200]));
    let mut bytes = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), format).unwrap();
    bytes
}

/// Bytes that replace others, and where the file ends.
pub(crate) type Damage = (Vec<(Index, u8)>, Option<Index>);

pub(crate) fn damage() -> impl Strategy<Value = Damage> {
    (prop::collection::vec((any::<Index>(), any::<u8>()), 1..6), prop::option::of(any::<Index>()))
}

/// A file after a change.
pub(crate) fn damaged(mut bytes: Vec<u8>, (patches, end): &Damage) -> Vec<u8> {
    for (at, byte) in patches {
        let at = at.index(bytes.len());
        bytes[at] = *byte;
    }
    if let Some(end) = end {
        bytes.truncate(end.index(bytes.len()));
    }
    bytes
}
