// Principal axes of the corners of two children, each weighted by its area: sixteen, eleven or six corners.
// Source: Ericson 2004; Sabino 2020, 3.5, variant 2, with the covariance of a box's corners in closed form.
// use shared/build/eigen

struct Moments {
    weight: f32,
    mean: vec3<f32>,
    diagonal: vec3<f32>,
    coupling: vec3<f32>,
}

fn add_square(moments: Moments, v: vec3<f32>, weight: f32) -> Moments {
    var sum = moments;
    sum.diagonal += weight * v * v;
    sum.coupling += weight * v.yzx * v.zxy;
    return sum;
}

/// Moments of a child's corners about `origin`, in units of `size`.
fn moments_of(content: Content, origin: vec3<f32>, size: f32, weight: f32) -> Moments {
    if content.is_box {
        let edges = sides(content);
        var moments = Moments(weight, (content.center - origin) / size, vec3(0.0), vec3(0.0));
        for (var a = 0u; a < 3u; a++) {
            moments = add_square(moments, edges[a] / size, weight);
        }
        return moments;
    }
    let a = (content.columns[0] - origin) / size;
    let b = (content.columns[1] - origin) / size;
    let c = (content.columns[2] - origin) / size;
    let mean = (a + b + c) / 3.0;
    var moments = Moments(weight, mean, vec3(0.0), vec3(0.0));
    moments = add_square(moments, a - mean, weight / 3.0);
    moments = add_square(moments, b - mean, weight / 3.0);
    return add_square(moments, c - mean, weight / 3.0);
}

/// Largest extent of both from the center of the first. Dividing by it brings the moments near one.
fn size_of(a: Content, b: Content) -> f32 {
    return max(size_from(a, a.center), size_from(b, a.center));
}

fn size_from(content: Content, origin: vec3<f32>) -> f32 {
    if content.is_box {
        let edges = sides(content);
        return length_1(content.center - origin) + length_1(edges[0]) + length_1(edges[1]) + length_1(edges[2]);
    }
    let columns = content.columns;
    return max(max(length_1(columns[0] - origin), length_1(columns[1] - origin)), length_1(columns[2] - origin));
}

fn bounded_frame(a: Content, b: Content) -> mat3x3<f32> {
    let size = size_of(a, b);
    if !(size > 1e-30) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let areas = vec2<f32>(content_area(a), content_area(b));
    let sum = areas.x + areas.y;
    // The weights sum to one. Corners count instead of areas if neither child has any area.
    let corners = vec2<f32>(select(3.0, 8.0, a.is_box), select(3.0, 8.0, b.is_box));
    let weights = select(corners / (corners.x + corners.y), areas / max(sum, 1e-37), sum > 1e-36);
    let of_a = moments_of(a, a.center, size, weights.x);
    let of_b = moments_of(b, a.center, size, weights.y);
    var all = Moments(1.0, vec3(0.0), of_a.diagonal + of_b.diagonal, of_a.coupling + of_b.coupling);
    all = add_square(all, of_b.mean - of_a.mean, weights.x * weights.y);
    return principal_axes(all.diagonal, all.coupling);
}
