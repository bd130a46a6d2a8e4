use canted_obb::Aabb;

/// The power of two that brings the largest extent to 1 or just above, so that no area leaves the range of `f32`;
/// `None` where the boxes have no extent, or no finite one.
pub(crate) fn unit_scale(leaf_boxes: &[Aabb]) -> Option<f32> {
    let bounds = leaf_boxes.iter().fold(Aabb::EMPTY, |all, leaf| all.union(*leaf));
    let extent = bounds.extent().into_iter().fold(0.0, f64::max);
    // The exponents whose powers of two `f32` holds; a shorter extent stays short, and its areas are few anyway.
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    let exponent = extent.log2().floor().clamp(-126.0, 126.0) as i32;
    (extent > 0.0 && extent.is_finite()).then(|| 2.0f32.powi(-exponent))
}
