// The grid of cells on which a tree's items are coded.

struct Domain {
    /// Least coordinates, times the number of points summed for an item.
    offset: vec3<f32>,
    /// Cells per unit of that sum; 0 where the items have no finite extent.
    scale: f32,
}
