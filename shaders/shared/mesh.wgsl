// Triangles and vertices. Only the attributes that the scene has are stored, in columns of `STRIDE` words. `COLOR` and similar
// constants are the first column of an attribute; 0 means absent, because positions come first.
// const STRIDE
// const COLOR

struct Triangle {
    vertices: vec3<u32>,
    /// Index of the material; the highest bit is set if a flattened instance mirrors.
    material: u32,
    /// Unit normal, from which the triangle is counter-clockwise; zero if it has no area.
    normal: vec3<f32>,
    /// Square root of twice the area.
    area_root: f32,
}

@group(2) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(2) @binding(2) var<storage, read> vertices: array<f32>;

fn position_of(vertex: u32) -> vec3<f32> {
    return three_of(vertex, 0u);
}

/// Three words of a vertex, starting at `column`.
fn three_of(vertex: u32, column: u32) -> vec3<f32> {
    let first = vertex * STRIDE + column;
    return vec3(vertices[first], vertices[first + 1u], vertices[first + 2u]);
}

fn blend_positions(corners: vec3<u32>, weights: vec3<f32>) -> vec3<f32> {
    return blend_three(corners, weights, 0u);
}

fn blend_three(corners: vec3<u32>, weights: vec3<f32>, column: u32) -> vec3<f32> {
    return weights.x * three_of(corners.x, column) + weights.y * three_of(corners.y, column) + weights.z * three_of(corners.z, column);
}

/// Vectors from the first vertex to the second and third.
fn edges(corners: vec3<u32>) -> mat2x3<f32> {
    let first = position_of(corners.x);
    return mat2x3(position_of(corners.y) - first, position_of(corners.z) - first);
}

/// Interpolated vertex color and alpha; white if absent.
fn vertex_color(corners: vec3<u32>, weights: vec3<f32>) -> vec4<f32> {
    if COLOR == 0u {
        return vec4(1.0);
    }
    let at = COLOR + 3u;
    let alpha = vec3(vertices[corners.x * STRIDE + at], vertices[corners.y * STRIDE + at], vertices[corners.z * STRIDE + at]);
    return vec4(blend_three(corners, weights, COLOR), dot(weights, alpha));
}
