use canted_obb::Aabb;

/// The scale of the box around all boxes: [`Aabb::unit_scale`].
pub(crate) fn unit_scale(leaf_boxes: &[Aabb]) -> Option<f32> {
    leaf_boxes.iter().fold(Aabb::EMPTY, |all, leaf| all.union(*leaf)).unit_scale()
}
