//! Vertex colors of PLY, OFF and OBJ files, which do not state their encoding.
//!
//! They are taken as sRGB-encoded, as MeshLab and Blender write them.

/// The mark of a vertex without a color; it becomes white.
pub(crate) const NO_COLOR: [f32; 3] = [f32::NAN; 3];

/// Decodes RGB colors to linear RGBA with alpha 1, each value divided by `max`.
///
/// Without `max` it is 255 if any value exceeds 1, else 1. Values that are not finite become 1, others are clamped. The error
/// is a warning: negative values are not colors (some files have normals in their place).
pub(crate) fn linear(colors: Vec<[f32; 3]>, max: Option<f32>) -> Result<Vec<[f32; 4]>, String> {
    if let Some(at) = colors.iter().position(|color| color.iter().any(|&x| x < 0.0)) {
        let [r, g, b] = colors[at];
        return Err(format!("ignoring vertex colors: negative value at vertex {at}: {r} {g} {b}"));
    }
    let exceeds_one = || colors.iter().flatten().any(|&x| x > 1.0 && x.is_finite());
    let max = max.unwrap_or_else(|| if exceeds_one() { 255.0 } else { 1.0 });
    let decode = |x: f32| if x.is_finite() { decode((x / max).min(1.0)) } else { 1.0 };
    Ok(colors.into_iter().map(|[r, g, b]| [decode(r), decode(g), decode(b), 1.0]).collect())
}

/// The transfer function of sRGB (IEC 61966-2-1).
fn decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_of_bytes_and_unit_numbers_agree() {
        let unit = linear(vec![[0.0, 1.0, 0.2], NO_COLOR], None).unwrap();
        assert_eq!(unit[1], [1.0; 4]);
        assert_eq!(linear(vec![[0.0, 255.0, 51.0], NO_COLOR], None).unwrap(), unit);
        assert_eq!(linear(vec![[0.0, 65535.0, 13107.0], NO_COLOR], Some(65535.0)).unwrap(), unit);
        // 0.2 is 0.0331 in linear light, by the published table.
        assert!((unit[0][2] - 0.0331).abs() < 5e-5, "{}", unit[0][2]);
        assert_eq!(unit[0], [0.0, 1.0, unit[0][2], 1.0]);
        assert_eq!(linear(vec![[300.0, 0.0, 0.0]], Some(255.0)).unwrap(), [[1.0, 0.0, 0.0, 1.0]]);
    }

    #[test]
    fn negative_values_are_not_colors() {
        let warning = linear(vec![[0.0; 3], [0.0, -1.0, 0.0]], None).unwrap_err();
        assert_eq!(warning, "ignoring vertex colors: negative value at vertex 1: 0 -1 0");
    }
}
