// Items that are triangles, by their corners.
// use shared/build/ordered
// use shared/build/content

/// Points whose sum codes an item.
const N_POINTS: f32 = 3.0;

/// Bits of the coordinates, nine a triangle.
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
