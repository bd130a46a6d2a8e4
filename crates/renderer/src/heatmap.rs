use canted_film::{Picture, false_color};
use canted_scene::Camera;
use canted_trace::{Counts, Intersect};
use rayon::prelude::*;

use crate::{CameraError, CountedHitFilter, HitFilter, Surfaces, View};

/// Which tests a heat map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Measure {
    /// Ray-box tests.
    Boxes,
    /// Ray-triangle tests.
    Triangles,
}

impl Measure {
    /// All measures.
    pub const ALL: [Self; 2] = [Self::Boxes, Self::Triangles];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Boxes => "boxes",
            Self::Triangles => "triangles",
        }
    }
}

/// Intersection tests of primary rays, per pixel.
#[derive(Clone, Debug)]
pub struct Heatmap {
    /// Tests of the ray through the center of each pixel, row by row from the top.
    pub counts: Vec<Counts>,
    /// The counts of one measure in false color, with a legend.
    pub picture: Picture,
}

impl Heatmap {
    /// Sums over all rays.
    #[must_use]
    pub fn total(&self) -> Counts {
        self.counts.iter().fold(Counts::default(), |sum, counts| Counts {
            boxes: sum.boxes + counts.boxes,
            triangles: sum.triangles + counts.triangles,
        })
    }

    /// Mean box tests and mean triangle tests per ray.
    #[must_use]
    pub fn mean(&self) -> [f64; 2] {
        let total = self.total();
        let n = self.counts.len() as f64;
        [total.boxes as f64 / n, total.triangles as f64 / n]
    }
}

/// Traces one ray through the center of each pixel, in the caller's thread pool, and shows its tests in false color.
///
/// Surfaces are seen from both sides. The scale is fixed, so that heat maps of different BVHs are comparable: see [`false_color`].
///
/// # Errors
/// [`CameraError`] if the camera is invalid.
pub fn heatmap(
    surfaces: &Surfaces,
    bvh: &dyn Intersect,
    camera: &Camera,
    [width, height]: [u32; 2],
    measure: Measure,
    full_scale: u32,
) -> Result<Heatmap, CameraError> {
    let view = View::new(camera, width, height)?;
    let row = |y: u32| {
        (0..width).map(move |x| {
            let mut query = CountedHitFilter { filter: HitFilter::new(surfaces), counts: Counts::default() };
            bvh.closest_hit_with(&view.ray([f64::from(x) + 0.5, f64::from(y) + 0.5]), &mut query);
            query.counts
        })
    };
    let counts: Vec<Counts> = (0..height).into_par_iter().flat_map_iter(row).collect();
    let numbers = counts.iter().map(|counts| match measure {
        Measure::Boxes => counts.boxes,
        Measure::Triangles => counts.triangles,
    });
    let picture = false_color(numbers, [width, height], full_scale);
    Ok(Heatmap { counts, picture })
}
