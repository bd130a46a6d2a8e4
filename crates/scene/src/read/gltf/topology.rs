//! Triangles of lists, strips and fans (glTF 2.0, section 3.7.2.1).

use gltf::json::mesh::Mode;

/// Triangles with consistent winding, and the number of unused corners; `None` for points and lines.
///
/// As in the specification, every second triangle of a strip swaps its last two corners, and the first corner of a fan is the
/// last of each triangle.
pub(super) fn triangles(mode: Mode, corners: &[u32]) -> Option<(Vec<[u32; 3]>, usize)> {
    let n = corners.len();
    match mode {
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => None,
        Mode::Triangles => {
            let (triangles, rest) = corners.as_chunks();
            Some((triangles.to_vec(), rest.len()))
        }
        Mode::TriangleStrip | Mode::TriangleFan if n < 3 => Some((Vec::new(), n)),
        Mode::TriangleStrip => {
            let triangle = |i: usize| [corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]];
            Some(((0..n - 2).map(triangle).collect(), 0))
        }
        Mode::TriangleFan => {
            let triangle = |i: usize| [corners[i + 1], corners[i + 2], corners[0]];
            Some(((0..n - 2).map(triangle).collect(), 0))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_ignore_incomplete_triangles() {
        let (list, rest) = triangles(Mode::Triangles, &[7, 8, 9, 1, 2, 3, 4, 5]).unwrap();
        assert_eq!((list, rest), (vec![[7, 8, 9], [1, 2, 3]], 2));
    }

    #[test]
    fn strips_alternate_winding() {
        let (strip, rest) = triangles(Mode::TriangleStrip, &[0, 1, 2, 3, 4]).unwrap();
        assert_eq!((strip, rest), (vec![[0, 1, 2], [1, 3, 2], [2, 3, 4]], 0));
    }

    #[test]
    fn fans_share_their_first_corner() {
        let (fan, rest) = triangles(Mode::TriangleFan, &[5, 6, 7, 8]).unwrap();
        assert_eq!((fan, rest), (vec![[6, 7, 5], [7, 8, 5]], 0));
    }

    #[test]
    fn strips_and_fans_of_a_convex_polygon_have_equal_winding() {
        // All signed areas must be positive.
        let at = |k: u32| (f64::from(k) * std::f64::consts::TAU / 7.0).sin_cos();
        let doubled_area = |[a, b, c]: [u32; 3]| {
            let ((ay, ax), (by, bx), (cy, cx)) = (at(a), at(b), at(c));
            (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        };
        let total = |triangles: Vec<[u32; 3]>| {
            assert!(triangles.iter().all(|&triangle| doubled_area(triangle) > 0.0));
            triangles.into_iter().map(doubled_area).sum::<f64>()
        };
        let (fan, _) = triangles(Mode::TriangleFan, &[0, 1, 2, 3, 4, 5, 6]).unwrap();
        let (strip, _) = triangles(Mode::TriangleStrip, &[0, 1, 6, 2, 5, 3, 4]).unwrap();
        let n_roundings = 100.0 * f64::EPSILON;
        assert!((total(fan) - total(strip)).abs() < n_roundings);
    }

    #[test]
    fn fewer_than_three_corners_make_no_triangle() {
        for mode in [Mode::TriangleStrip, Mode::TriangleFan] {
            for n in 0..3 {
                assert_eq!(triangles(mode, &[0, 1][..n.min(2)]).unwrap(), (vec![], n.min(2)));
            }
        }
        assert!(triangles(Mode::Lines, &[0, 1, 2]).is_none());
    }
}
