use canted_obb::Aabb;

/// Length of a Morton code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Bits {
    /// 10 bits per axis.
    B30,
    /// 21 bits per axis.
    #[default]
    B63,
}

impl Bits {
    /// Bits per axis.
    #[must_use]
    pub fn per_axis(self) -> u32 {
        match self {
            Self::B30 => 10,
            Self::B63 => 21,
        }
    }
}

/// The grid of Morton cells.
///
/// Reads: the bounding box of all corners. Writes: offset and scale for all later stages.
/// Holds: both are rounded here, once, so the cells are the same integers on every device.
/// Source: Lauterbach et al. 2009; uniform scale by the largest extent, 0 for a zero extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Least coordinates times the number of points summed per primitive.
    pub offset: [f32; 3],
    /// Cells per unit of that sum; 0 for a box of zero or infinite extent.
    pub scale: f32,
    /// Length of the codes.
    pub bits: Bits,
}

impl Domain {
    /// The grid over `bounds` for primitives located by the sum of `n_points` points: 3 for triangles, 2 for boxes.
    #[must_use]
    pub fn new(bounds: &Aabb, n_points: u8, bits: Bits) -> Self {
        let n = f32::from(n_points);
        let extent = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(0.0, f32::max);
        #[expect(clippy::cast_precision_loss, reason = "a power of two")]
        let cells = (1u32 << bits.per_axis()) as f32;
        let scale = cells / (n * extent);
        Self { offset: bounds.min.map(|m| n * m), scale: if scale.is_finite() { scale } else { 0.0 }, bits }
    }

    /// The cell of a sum of coordinates on one axis; the upper end belongs to the last cell.
    ///
    /// A subtraction followed by a product cannot be fused by a compiler.
    #[inline]
    #[must_use]
    pub fn cell(&self, axis: usize, sum: f32) -> u32 {
        let last = (1u32 << self.bits.per_axis()) - 1;
        // `as` truncates like floor above zero, and maps negative numbers and NaN (∞·0) to 0.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating by definition")]
        let cell = ((sum - self.offset[axis]) * self.scale) as u32;
        cell.min(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_degenerate_extents() {
        let unit = Domain::new(&Aabb { min: [0.0; 3], max: [1.0; 3] }, 3, Bits::B30);
        assert_eq!((unit.cell(0, 0.0), unit.cell(0, 3.0), unit.cell(0, -1.0)), (0, 1023, 0));
        let point = Domain::new(&Aabb { min: [2.0; 3], max: [2.0; 3] }, 3, Bits::B63);
        assert_eq!((point.scale, point.cell(1, 6.0)), (0.0, 0));
        let huge = Domain::new(&Aabb { min: [f32::MIN; 3], max: [f32::MAX; 3] }, 3, Bits::B30);
        assert_eq!((huge.scale, huge.cell(2, f32::INFINITY)), (0.0, 0));
        let tiny = Domain::new(&Aabb { min: [0.0; 3], max: [1e-45; 3] }, 3, Bits::B63);
        assert_eq!(tiny.cell(0, 3e-45), 0);
    }
}
