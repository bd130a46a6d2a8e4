//! What every reader does with bad triangles: drop what is not finite, count what has no area, say so once.

use std::path::Path;

use super::ReadError;
use crate::Scene;

/// Counts of the triangles that a reader has seen, kept and dropped.
#[derive(Debug, Default)]
pub(crate) struct Repair {
    n_kept: usize,
    n_flat: usize,
    n_dropped: usize,
}

impl Repair {
    /// Whether a triangle is kept: all its corners are finite. Flat ones are kept, so that the numbering stays the file's.
    pub(crate) fn keeps(&mut self, corners: [[f32; 3]; 3]) -> bool {
        let finite = corners.as_flattened().iter().all(|x| x.is_finite());
        if finite {
            self.n_kept += 1;
            self.n_flat += usize::from(is_flat(corners));
        } else {
            self.n_dropped += 1;
        }
        finite
    }

    /// Adds the warnings to the scene; triangles without any area are an error, as are no triangles.
    pub(crate) fn finish(self, path: &Path, scene: &mut Scene) -> Result<(), ReadError> {
        let Self { n_kept, n_flat, n_dropped } = self;
        if n_kept == 0 && n_dropped > 0 {
            return Err(ReadError::empty(path, format!("all {n_dropped} triangles use vertices that are not finite")));
        }
        if n_kept == 0 {
            return Err(ReadError::empty(path, "no triangle"));
        }
        if n_flat == n_kept {
            return Err(ReadError::empty(path, format!("all {n_kept} triangles have no area")));
        }
        if n_dropped > 0 {
            scene.warnings.push(format!("triangles that use vertices that are not finite: {n_dropped} dropped"));
        }
        if n_flat > 0 {
            scene.warnings.push(format!("triangles without area: {n_flat} kept"));
        }
        let bounds = scene.bounds_world();
        if bounds.extent().into_iter().any(|side| side > f64::from(f32::MAX)) || bounds.area() > f64::from(f32::MAX) {
            scene.warnings.push(format!(
                "coordinates up to {:e}: the area of the scene is beyond single precision",
                bounds.reach()
            ));
        }
        Ok(())
    }
}

/// Whether the cross product of two edges is zero in `f64`.
///
/// Exact where the three corners' coordinates on an axis span few powers of two, so that edges have at most 26 bits and
/// their products at most 53. Elsewhere a rounding may hide a flat triangle; only the warnings depend on it.
fn is_flat(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let edge = |to: [f64; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2]];
    let (u, v) = (edge(b), edge(c));
    u[1] * v[2] == u[2] * v[1] && u[2] * v[0] == u[0] * v[2] && u[0] * v[1] == u[1] * v[0]
}
