// choice boxes
// Boxes as items, represented by the axis-aligned boxes around them.
// use shared/build/ordered
// use shared/build/content

/// Number of points summed for the code of an item.
const N_POINTS: f32 = 2.0;

/// Float bits of the minima and maxima, six per box.
@group(1) @binding(0) var<storage, read> item_aabbs: array<u32>;

/// Fifteen floats per box: center, three axes, half-extents.
@group(1) @binding(1) var<storage, read> item_boxes: array<f32>;

fn box_ends(item: u32, side: u32) -> vec3<u32> {
    let at = 6u * item + 3u * side;
    return vec3<u32>(item_aabbs[at], item_aabbs[at + 1u], item_aabbs[at + 2u]);
}

fn item_sum(item: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(box_ends(item, 0u)) + bitcast<vec3<f32>>(box_ends(item, 1u));
}

fn item_reach(item: u32) -> Reach {
    let low = box_ends(item, 0u);
    let high = box_ends(item, 1u);
    return Reach(reach_of(low.x, low.y, low.z).low, reach_of(high.x, high.y, high.z).high);
}

fn box_part(item: u32, part: u32) -> vec3<f32> {
    let at = 15u * item + 3u * part;
    return vec3<f32>(item_boxes[at], item_boxes[at + 1u], item_boxes[at + 2u]);
}

fn item_content(item: u32) -> Content {
    let columns = mat3x3<f32>(box_part(item, 1u), box_part(item, 2u), box_part(item, 3u));
    return Content(true, box_part(item, 0u), columns, box_part(item, 4u));
}

// choice triangles
// Triangles as items, represented by their vertices.
// use shared/build/ordered
// use shared/build/content

/// Number of points summed for the code of an item.
const N_POINTS: f32 = 3.0;

/// Float bits of the coordinates, nine per triangle.
@group(1) @binding(0) var<storage, read> corners: array<u32>;

fn corner(item: u32, k: u32) -> vec3<f32> {
    let at = 9u * item + 3u * k;
    return bitcast<vec3<f32>>(vec3<u32>(corners[at], corners[at + 1u], corners[at + 2u]));
}

fn item_sum(item: u32) -> vec3<f32> {
    return (corner(item, 0u) + corner(item, 1u)) + corner(item, 2u);
}

fn item_reach(item: u32) -> Reach {
    var reach = reach_of(corners[9u * item], corners[9u * item + 1u], corners[9u * item + 2u]);
    for (var at = 9u * item + 3u; at < 9u * item + 9u; at += 3u) {
        reach = joined(reach, reach_of(corners[at], corners[at + 1u], corners[at + 2u]));
    }
    return reach;
}

fn item_content(item: u32) -> Content {
    let columns = mat3x3<f32>(corner(item, 0u), corner(item, 1u), corner(item, 2u));
    return Content(false, columns[0], columns, vec3(0.0));
}
