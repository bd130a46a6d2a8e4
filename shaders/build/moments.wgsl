// Volumes, `pca-unbounded`, first dispatches, one per height: moments of everything below a node, and its principal axes.
// Reads: nodes, leaves, moments of the children.
// Writes: moments; the frame of each node and a point of it as the center of its box.
// Source: moments of triangles by area (Gottschalk et al. 1996), merged by the parallel-axis theorem (Chan, Golub, LeVeque 1979).
//
// Covariances are means, so that merging only needs the fraction of each child. Areas are clamped, so that no sum overflows; those
// that underflow count equally. Either changes a frame, never whether a box encloses its node.
// use shared/build/slice
// use shared/build/tree
// use shared/volumes/boxes
// use shared/volumes/bounded
// use ?item

@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<Node>;
@group(0) @binding(3) var<storage, read> leaves: array<u32>;
/// Ten floats per node: weight, mean, squares of the covariance, products of the covariance.
@group(0) @binding(6) var<storage, read_write> node_moments: array<f32>;

const MAX_WEIGHT: f32 = 1e28;

fn moment_three(at: u32) -> vec3<f32> {
    return vec3<f32>(node_moments[at], node_moments[at + 1u], node_moments[at + 2u]);
}

fn put_three(at: u32, v: vec3<f32>) {
    node_moments[at] = v.x;
    node_moments[at + 1u] = v.y;
    node_moments[at + 2u] = v.z;
}

/// Moments of a child. Of a triangle, a twelfth of the sum over its corners.
fn moments_below(child: u32) -> Moments {
    if (child & LEAF) == 0u {
        let at = 10u * child;
        return Moments(node_moments[at], moment_three(at + 1u), moment_three(at + 4u), moment_three(at + 7u));
    }
    let content = item_content(leaves[child & ~LEAF]);
    let weight = min(content_area(content), MAX_WEIGHT);
    if content.is_box {
        let edges = sides(content);
        var moments = Moments(weight, content.center, vec3(0.0), vec3(0.0));
        for (var k = 0u; k < 3u; k++) {
            moments = add_square(moments, edges[k], 1.0);
        }
        return moments;
    }
    let ab = content.columns[1] - content.columns[0];
    let ac = content.columns[2] - content.columns[0];
    let to_mean = (ab + ac) / 3.0;
    var moments = Moments(weight, content.columns[0] + to_mean, vec3(0.0), vec3(0.0));
    moments = add_square(moments, to_mean, 1.0 / 12.0);
    moments = add_square(moments, ab - to_mean, 1.0 / 12.0);
    return add_square(moments, ac - to_mean, 1.0 / 12.0);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    let slot = order[i];
    let a = moments_below(nodes[slot].left);
    let b = moments_below(nodes[slot].right);
    let sum = a.weight + b.weight;
    let fraction = select(0.5, b.weight / max(sum, 1e-37), sum > 1e-36);
    let apart = b.mean - a.mean;
    var all = Moments(min(sum, MAX_WEIGHT), a.mean + fraction * apart, mix(a.diagonal, b.diagonal, fraction), mix(a.coupling, b.coupling, fraction));
    all = add_square(all, apart, fraction * (1.0 - fraction));
    let at = 10u * slot;
    node_moments[at] = all.weight;
    put_three(at + 1u, all.mean);
    put_three(at + 4u, all.diagonal);
    put_three(at + 7u, all.coupling);
    let greatest = max(all.diagonal.x, max(all.diagonal.y, all.diagonal.z));
    var frame = IDENTITY;
    if greatest > 1e-36 {
        frame = principal_axes(all.diagonal / greatest, all.coupling / greatest);
    }
    put_box(slot, Box(item_content(leaves[nodes[slot].first]).center, frame, vec3(0.0)));
}
