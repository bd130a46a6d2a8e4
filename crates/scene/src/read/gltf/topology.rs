//! Triangles of lists, strips and fans (glTF 2.0, section 3.7.2.1).

use gltf::json::mesh::Mode;

/// Triangles that a run of `corners` makes, all wound alike, and the number of corners left over.
///
/// `None` for points and lines. Every second triangle of a strip takes its last two corners in turn; a fan turns about
/// its first corner, which comes last in each triangle.
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
    fn lists_leave_what_is_no_triangle() {
        let (list, rest) = triangles(Mode::Triangles, &[7, 8, 9, 1, 2, 3, 4, 5]).unwrap();
        assert_eq!((list, rest), (vec![[7, 8, 9], [1, 2, 3]], 2));
    }

    #[test]
    fn strips_alternate() {
        let (strip, rest) = triangles(Mode::TriangleStrip, &[0, 1, 2, 3, 4]).unwrap();
        assert_eq!((strip, rest), (vec![[0, 1, 2], [1, 3, 2], [2, 3, 4]], 0));
    }

    #[test]
    fn fans_turn_about_their_first_corner() {
        let (fan, rest) = triangles(Mode::TriangleFan, &[5, 6, 7, 8]).unwrap();
        assert_eq!((fan, rest), (vec![[6, 7, 5], [7, 8, 5]], 0));
    }

    #[test]
    fn strips_and_fans_of_a_convex_polygon_are_wound_alike() {
        // Around the polygon in fan order, across it in strip order: all signed areas must be positive.
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
    fn short_runs_make_nothing() {
        for mode in [Mode::TriangleStrip, Mode::TriangleFan] {
            for n in 0..3 {
                assert_eq!(triangles(mode, &[0, 1][..n.min(2)]).unwrap(), (vec![], n.min(2)));
            }
        }
        assert!(triangles(Mode::Lines, &[0, 1, 2]).is_none());
    }
}
