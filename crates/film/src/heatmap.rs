use crate::colormap::viridis;
use crate::{Picture, digits};

/// Shows one number per pixel, row by row, in false color: 0 in the darkest color, `full_scale` and above in the brightest.
///
/// A picture that is large enough has a legend in its lower left corner.
#[must_use]
pub fn false_color(numbers: impl Iterator<Item = u64>, [width, height]: [u32; 2], full_scale: u32) -> Picture {
    #[expect(clippy::cast_precision_loss, reason = "counts per pixel are below 2^53")]
    let color = |n: u64| viridis(n as f64 / f64::from(full_scale.max(1)));
    let mut picture = Picture { width, height, pixels: numbers.map(color).collect() };
    draw_legend(&mut picture, full_scale);
    picture
}

/// Draws a color bar on black, with the numbers 0, half and full scale above it.
fn draw_legend(picture: &mut Picture, full_scale: u32) {
    const BAR: [u32; 2] = [128, 6];
    const MARGIN: u32 = 4;
    const GAP: u32 = 2;
    let size = [BAR[0] + 2 * MARGIN, digits::HEIGHT + GAP + BAR[1] + 2 * MARGIN];
    // Dots grow with the picture; a legend that would fill half of it is not drawn.
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
    for (number, halves) in [(0, 0), (full_scale / 2, 1), (full_scale, 2)] {
        // Flush left, centered, flush right.
        let slack = (BAR[0] * scale).saturating_sub(digits::width(number, scale));
        digits::draw(picture, number, [MARGIN * scale + slack * halves / 2, top + MARGIN * scale], scale, [1.0; 3]);
    }
}
