// The children of each wide node, which stay the same while only boxes change, in the order of shared/certain: child `i` toward the corner that is
// high along axis `k` where bit `k` of `i` is set.
//
// The children are halved at the median of their centers, along the axis where these spread most first, and each half along the next axis. All is done with
// integers, so the order is the same on every device, and each child has a place of its own whatever its numbers are.
// Reads: binary tree, boxes, items, the order of wide nodes.
// Writes: eight words for each wide node, as in `Node`, by its first unit; `NONE` where there is no child.
// use shared/build/wide/box

@group(0) @binding(4) var<storage, read> wide_slots: array<u32>;
@group(0) @binding(5) var<storage, read_write> wide_children: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let unit = slice_item(id, 64u);
    if unit >= slice.end || wide_slots[unit] == 0u {
        return;
    }
    let children = children_of(wide_slots[unit] - 1u);
    let places = places_of(children);
    for (var place = 0u; place < WIDTH; place++) {
        wide_children[WIDTH * unit + place] = NONE;
    }
    for (var child = 0u; child < children.n; child++) {
        wide_children[WIDTH * unit + places[child]] = children.words[child];
    }
}

/// The place of each child.
fn places_of(children: Children) -> array<u32, WIDTH> {
    var centers: array<vec3<u32>, WIDTH>;
    var least = vec3<u32>(0xffffffffu);
    var greatest = vec3<u32>(0u);
    for (var child = 0u; child < children.n; child++) {
        centers[child] = center_of(children.words[child]);
        least = min(least, centers[child]);
        greatest = max(greatest, centers[child]);
    }
    let spread = number_of(greatest) - number_of(least);
    let length = vec3<u32>(whole(spread.x), whole(spread.y), whole(spread.z));
    // The number of axes before x and before y.
    let before_x = u32(length.y > length.x) + u32(length.z > length.x);
    let before_y = u32(length.x >= length.y) + u32(length.z > length.y);
    var places: array<u32, WIDTH>;
    for (var step = 0u; step < 3u; step++) {
        let axis = select(select(2u, 1u, before_y == step), 0u, before_x == step);
        let open = places;
        for (var child = 0u; child < children.n; child++) {
            var n_together = 0u;
            var n_lower = 0u;
            for (var other = 0u; other < children.n; other++) {
                if open[other] == open[child] {
                    let a = centers[other][axis];
                    let b = centers[child][axis];
                    n_together += 1u;
                    n_lower += u32(a < b || (a == b && other < child));
                }
            }
            places[child] |= select(0u, 1u << axis, 2u * n_lower >= n_together);
        }
    }
    return places;
}

/// Twice the center of a child's box, as integers with the order of the numbers.
fn center_of(child: u32) -> vec3<u32> {
    let box = box_of(child);
    let low = bitcast<vec3<f32>>(vec3<u32>(box[0], box[1], box[2]));
    let high = bitcast<vec3<f32>>(vec3<u32>(box[3], box[4], box[5]));
    let sum = low + high;
    return vec3<u32>(whole(sum.x), whole(sum.y), whole(sum.z));
}

/// An integer with the order of the numbers. Devices may round what is below the normal numbers to zero, of either sign.
fn whole(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return ordered(select(bits, 0u, (bits & 0x7f800000u) == 0u));
}

fn number_of(keys: vec3<u32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(unordered(keys.x), unordered(keys.y), unordered(keys.z)));
}
