use canted_film::Picture;

/// How much a line covers what is behind it.
const OPACITY: f32 = 0.85;

/// A picture, or the part of one of `size` that begins at `corner`.
pub(super) struct Canvas<'a> {
    pub(super) part: &'a mut Picture,
    pub(super) corner: [u32; 2],
    pub(super) size: [f64; 2],
}

/// Draws a line one pixel wide with soft edges: in each column, or each row of a steep line, it covers two pixels by the distances of
/// their centers. The parts outside the picture are cut off.
pub(super) fn draw_line(canvas: &mut Canvas, from: [f64; 2], to: [f64; 2], color: [f32; 3]) {
    // Pixel centers are at integers from here on.
    let Some([from, to]) = clipped(from.map(|x| x - 0.5), to.map(|x| x - 0.5), canvas.size) else { return };
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let (along, across) = if dx.abs() >= dy.abs() { (0, 1) } else { (1, 0) };
    let (start, end) = if from[along] <= to[along] { (from, to) } else { (to, from) };
    let length = end[along] - start[along];
    let slope = if length > 0.0 { (end[across] - start[across]) / length } else { 0.0 };
    // A line that is shorter than a pixel covers the nearest one.
    let first = start[along].round();
    let last = end[along].round().max(first);
    let mut position = first;
    while position <= last {
        let center = start[across] + slope * (position - start[along]).clamp(0.0, length);
        let below = center.floor();
        let part = center - below;
        for (offset, coverage) in [(0.0, 1.0 - part), (1.0, part)] {
            let mut pixel = [0.0; 2];
            (pixel[along], pixel[across]) = (position, below + offset);
            blend(canvas, pixel, coverage, color);
        }
        position += 1.0;
    }
}

/// Mixes a color into a pixel, if the part has it.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked: a pixel of the picture")]
fn blend(Canvas { part: picture, corner, .. }: &mut Canvas, [x, y]: [f64; 2], coverage: f64, color: [f32; 3]) {
    let [x, y] = [x - f64::from(corner[0]), y - f64::from(corner[1])];
    if x < 0.0 || y < 0.0 || x >= f64::from(picture.width) || y >= f64::from(picture.height) {
        return;
    }
    let index = picture.index(x as u32, y as u32);
    let opacity = OPACITY * coverage as f32;
    let pixel = &mut picture.pixels[index];
    *pixel = std::array::from_fn(|k| pixel[k] + opacity * (color[k] - pixel[k]));
}

/// The part of a line that is within a pixel of a picture of this size (Liang, Barsky 1984); `None` where there is none.
fn clipped(from: [f64; 2], to: [f64; 2], size: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let step = to[k] - from[k];
        if !step.is_finite() {
            return None;
        }
        let (low, high) = (-1.0 - from[k], size[k] - from[k]);
        if step == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
        } else {
            let (near, far) = if step > 0.0 { (low / step, high / step) } else { (high / step, low / step) };
            (enter, leave) = (enter.max(near), leave.min(far));
        }
    }
    let at = |t: f64| std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
    (enter <= leave).then(|| [at(enter), at(leave)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of a line's coverage, and the pixels that it touches.
    fn drawn(from: [f64; 2], to: [f64; 2]) -> (f32, Vec<[u32; 2]>) {
        let mut picture = Picture::filled(8, 6, [0.0; 3]);
        draw_line(&mut Canvas { part: &mut picture, corner: [0, 0], size: [8.0, 6.0] }, from, to, [1.0; 3]);
        let pixels = (0..48).map(|i| [i % 8, i / 8]);
        let touched = pixels.filter(|&[x, y]| picture.pixels[picture.index(x, y)][0] > 0.0).collect();
        (picture.pixels.iter().map(|p| p[0] / OPACITY).sum(), touched)
    }

    #[test]
    fn a_line_covers_a_pixel_in_each_column_or_row() {
        assert_eq!(drawn([0.5, 2.5], [7.5, 2.5]), (8.0, (0..8).map(|x| [x, 2]).collect()));
        assert_eq!(drawn([3.5, 5.5], [3.5, 0.5]), (6.0, (0..6).map(|y| [3, y]).collect()));
        // Between two rows, it covers half of each.
        let (sum, touched) = drawn([0.5, 3.0], [7.5, 3.0]);
        assert!((sum - 8.0).abs() < 1e-5 && touched.len() == 16);
        let (sum, _) = drawn([0.5, 0.5], [7.5, 5.5]);
        assert!((sum - 8.0).abs() < 1e-5, "{sum}");
        assert_eq!(drawn([2.6, 2.4], [2.4, 2.6]).1, [[2, 2]], "a point is a pixel");
    }

    #[test]
    fn what_is_outside_is_cut_off() {
        // From far outside to far outside, through the picture along its third row.
        assert_eq!(drawn([-1e12, 2.5], [1e12, 2.5]).1.len(), 8);
        assert_eq!(drawn([-5.0, -5.0], [-1.0, 9.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([20.0, 1.0], [30.0, 1.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([f64::NAN, 1.0], [3.0, 1.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([f64::INFINITY, 1.0], [3.0, 1.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([9.0, 7.0], [9.0, 7.0]).1, [[0; 2]; 0]);
    }
}
