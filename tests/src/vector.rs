//! Vectors in `f64`, for oracles.

/// A vector, or a point.
pub type Vector = [f64; 3];

/// `a - b`.
#[must_use]
pub fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

/// The dot product.
#[must_use]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cross product.
#[must_use]
pub fn cross(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

/// The Euclidean norm.
#[must_use]
pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Distance of a point from a triangle, including degenerate ones: from its plane if the projection is inside, else from its edges.
#[must_use]
pub fn distance(p: Vector, corners: [Vector; 3]) -> f64 {
    let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
    let edges = [0, 1, 2].map(|i| (corners[i], sub(corners[(i + 1) % 3], corners[i])));
    if dot(normal, normal) > 0.0 && edges.iter().all(|(start, edge)| dot(cross(*edge, sub(p, *start)), normal) >= 0.0) {
        return dot(sub(p, corners[0]), normal).abs() / length(normal);
    }
    let to_edge = |(start, edge): &(Vector, Vector)| {
        let squared = dot(*edge, *edge);
        let along = if squared > 0.0 { (dot(sub(p, *start), *edge) / squared).clamp(0.0, 1.0) } else { 0.0 };
        length(sub(p, std::array::from_fn(|k| start[k] + along * edge[k])))
    };
    edges.iter().map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_to_plane_edge_corner_and_degenerate_triangle() {
        let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        assert_eq!(distance([0.5, 0.5, 3.0], corners), 3.0);
        assert_eq!(distance([1.0, -4.0, 3.0], corners), 5.0);
        assert_eq!(distance([-3.0, -4.0, 0.0], corners), 5.0);
        assert_eq!(distance([1.0, 1.0, 0.0], [[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 1.0);
        assert_eq!(distance([3.0, 4.0, 0.0], [[0.0; 3]; 3]), 5.0);
    }
}
