use canted_scene::Camera;
use canted_trace::Counts;
use rayon::prelude::*;

use crate::colormap::viridis;
use crate::{CameraError, Masked, Picture, Surfaces, Tracer, View, digits};

/// Which tests of a primary ray the colours show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Measure {
    /// Ray-box tests.
    Boxes,
    /// Ray-triangle tests.
    Triangles,
}

/// What primary rays cost, pixel by pixel.
#[derive(Clone, Debug)]
pub struct Heatmap {
    /// Tests of the ray through the middle of each pixel, row by row from the top.
    pub counts: Vec<Counts>,
    /// The counts of one measure as colours, with a legend.
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
    #[expect(clippy::cast_precision_loss, reason = "means need no more than 53 bits")]
    pub fn mean(&self) -> [f64; 2] {
        let total = self.total();
        let n = self.counts.len() as f64;
        [total.boxes as f64 / n, total.triangles as f64 / n]
    }
}

/// Traces one ray through the middle of each pixel and shows its tests in false colour.
///
/// The scale is fixed, so pictures of different trees compare: 0 is the darkest colour, `full_scale` and above the
/// brightest. Pictures that have room carry a legend in the lower left corner. The work runs in the caller's thread
/// pool.
///
/// # Errors
/// [`CameraError`] where the camera cannot be used.
pub fn heatmap<T: Tracer>(
    surfaces: &Surfaces,
    tracer: &T,
    camera: &Camera,
    [width, height]: [u32; 2],
    measure: Measure,
    full_scale: u32,
) -> Result<Heatmap, CameraError> {
    let view = View::new(camera, width, height)?;
    let row = |y: u32| {
        (0..width).map(move |x| {
            let mut query = Masked::new(surfaces, Counts::default());
            tracer.closest_hit(&view.ray([f64::from(x) + 0.5, f64::from(y) + 0.5]), &mut query);
            query.inner
        })
    };
    let counts: Vec<Counts> = (0..height).into_par_iter().flat_map_iter(row).collect();
    let color = |counts: &Counts| {
        let n = match measure {
            Measure::Boxes => counts.boxes,
            Measure::Triangles => counts.triangles,
        };
        #[expect(clippy::cast_precision_loss, reason = "counts of one ray are below 2^53")]
        viridis(n as f64 / f64::from(full_scale.max(1)))
    };
    let mut picture = Picture { width, height, pixels: counts.iter().map(color).collect() };
    draw_legend(&mut picture, full_scale);
    Ok(Heatmap { counts, picture })
}

/// Draws a bar of the colours over a black ground, with the numbers 0, half and full scale above it.
fn draw_legend(picture: &mut Picture, full_scale: u32) {
    const BAR: [u32; 2] = [128, 6];
    const MARGIN: u32 = 4;
    const GAP: u32 = 2;
    let size = [BAR[0] + 2 * MARGIN, digits::HEIGHT + GAP + BAR[1] + 2 * MARGIN];
    // Dots grow with the picture; a legend that would fill half of it is left out.
    let scale = (picture.height / 360).max(1).min(picture.width / size[0]);
    if scale == 0 || 2 * size[1] * scale > picture.height {
        return;
    }
    let top = picture.height - size[1] * scale;
    picture.fill([0, top], size.map(|s| s * scale), [0.0; 3]);
    let bar_top = top + (MARGIN + digits::HEIGHT + GAP) * scale;
    for x in 0..BAR[0] * scale {
        let value = f64::from(x) / f64::from(BAR[0] * scale - 1);
        picture.fill([MARGIN * scale + x, bar_top], [1, BAR[1] * scale], viridis(value));
    }
    for (number, place) in [(0, 0), (full_scale / 2, 1), (full_scale, 2)] {
        // Flush left, centred, flush right.
        let slack = (BAR[0] * scale).saturating_sub(digits::width(number, scale));
        digits::draw(picture, number, [MARGIN * scale + slack * place / 2, top + MARGIN * scale], scale, [1.0; 3]);
    }
}
