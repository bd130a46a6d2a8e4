use crate::srgb;

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
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the anchors")]
pub(crate) fn viridis(value: f64) -> [f32; 3] {
    let last = ANCHORS.len() - 1;
    #[expect(clippy::cast_precision_loss, reason = "a small integer")]
    let position = value.clamp(0.0, 1.0) * last as f64;
    let first = (position as usize).min(last - 1);
    let weight = position - position.floor().min((last - 1) as f64);
    std::array::from_fn(|k| {
        let (a, b) = (f64::from(ANCHORS[first][k]), f64::from(ANCHORS[first + 1][k]));
        srgb::to_linear((a + weight * (b - a)) / 255.0) as f32
    })
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
}
