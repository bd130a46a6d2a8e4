// The child of a node: a box or a triangle.
// use shared/build/length

/// A box, all points `center + columns * q` with `|q[k]| <= half_extents[k]`; or a triangle whose vertices are the columns.
struct Content {
    is_box: bool,
    /// Center of a box, a vertex of a triangle.
    center: vec3<f32>,
    columns: mat3x3<f32>,
    half_extents: vec3<f32>,
}

/// The three vectors from the center of a box to its faces.
fn sides(box: Content) -> mat3x3<f32> {
    return mat3x3<f32>(box.columns[0] * box.half_extents.x, box.columns[1] * box.half_extents.y, box.columns[2] * box.half_extents.z);
}

fn length_1(v: vec3<f32>) -> f32 {
    return abs(v.x) + abs(v.y) + abs(v.z);
}

/// Surface area; both sides of a triangle count.
fn content_area(content: Content) -> f32 {
    let columns = content.columns;
    if !content.is_box {
        return length_of(cross(columns[1] - columns[0], columns[2] - columns[0]));
    }
    let edges = sides(content);
    let faces = length_of(cross(edges[0], edges[1])) + length_of(cross(edges[1], edges[2])) + length_of(cross(edges[2], edges[0]));
    return 8.0 * faces;
}
