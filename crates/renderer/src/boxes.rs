//! Boxes of an acceleration structure, drawn over a picture.
//!
//! ```text
//! SceneBvh -> boxes of a level, world space -> edges -> View -> lines over a Picture
//! ```

use glam::DVec3;
use std::fmt;
use std::str::FromStr;

use canted_film::Picture;
use canted_obb::Obb;

use crate::{SceneBvh, SceneLevels, View};





/// Which boxes of a structure are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxLevel {
    /// Those at this distance from the root, which is at level 0.
    ///
    /// In two levels of BVHs, the levels of the top level come first, and then those of the BVHs of all instances, whose roots are at
    /// the level after the last of the top level.
    Level(u32),
    /// Those of the leaves over triangles.
    Leaves,
}

impl FromStr for BoxLevel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "leaves" => Ok(Self::Leaves),
            _ => text.parse().map(Self::Level).map_err(|_| "expected a level, 0 for the root, or leaves".to_owned()),
        }
    }
}

impl fmt::Display for BoxLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Level(level) => write!(f, "{level}"),
            Self::Leaves => f.write_str("leaves"),
        }
    }
}

impl SceneBvh {
    /// The boxes that rays are tested with at a level, world space, up to rounding; as the shutter opens where instances move.
    #[must_use]
    pub fn boxes(&self, shown: BoxLevel) -> Vec<Obb> {
        let mut boxes = vec![];
        let mut keep = |obb: &dyn Fn() -> Obb, level: u32, is_leaf: bool| {
            let is_shown = match shown {
                BoxLevel::Level(wanted) => level == wanted,
                BoxLevel::Leaves => is_leaf,
            };
            if is_shown {
                boxes.push(obb());
            }
        };
        match &self.levels {
            SceneLevels::One(flat) => flat.bvh.each_box(|obb, level, is_leaf| keep(&|| obb, level, is_leaf)),
            SceneLevels::Two(tlas) => {
                tlas.each_box(|obb, level, _| keep(&|| obb, level, false));
                let first = self.n_top_levels();
                for instance in tlas.instances() {
                    let to_world = &instance.world_from_object;
                    tlas.blas()[instance.blas as usize].each_box(|obb, level, is_leaf| {
                        keep(&|| obb.transformed(to_world), first + level, is_leaf);
                    });
                }
            }
        }
        boxes
    }

    /// The number of levels with boxes.
    #[must_use]
    pub fn n_levels(&self) -> u32 {
        let mut n_below = 0;
        for bvh in self.bottom() {
            bvh.each_box(|_, level, _| n_below = n_below.max(level + 1));
        }
        self.n_top_levels() + n_below
    }

    /// The number of levels of the top level.
    fn n_top_levels(&self) -> u32 {
        let mut n = 0;
        if let SceneLevels::Two(tlas) = &self.levels {
            tlas.each_box(|_, level, _| n = n.max(level + 1));
        }
        n
    }
}

/// Linear color of axis-aligned boxes: blue.
const ALIGNED: [f32; 3] = [0.02, 0.3, 1.0];

/// Linear color of oriented boxes: orange.
const ORIENTED: [f32; 3] = [1.0, 0.22, 0.0];

/// Draws the edges of boxes in world space over a picture, or over the part of one that begins at `corner`. Nothing hides them.
/// Axis-aligned boxes are blue, others orange.
///
/// `view` is that of the whole picture. Colors are linear; a picture that is to be encoded has its tone curve already.
pub fn draw_boxes(picture: &mut Picture, corner: [u32; 2], view: &View, boxes: &[Obb]) {
    let canvas = &mut Canvas { part: picture, corner, size: view.size() };
    // Oriented boxes last, on top: there are usually fewer.
    for is_oriented in [false, true] {
        let color = if is_oriented { ORIENTED } else { ALIGNED };
        for obb in boxes.iter().filter(|obb| is_aligned(obb) != is_oriented) {
            let corners = obb.corners();
            for (a, b) in EDGES {
                if let Some([from, to]) = view.line(corners[a].into(), corners[b].into()) {
                    draw_line(canvas, from, to, color);
                }
            }
        }
    }
}

/// The pairs of corners, as [`Obb::corners`] numbers them, that differ in one bit.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

/// Whether each axis is along one of the coordinates.
fn is_aligned(obb: &Obb) -> bool {
    obb.frame.iter().all(|axis| axis.iter().filter(|x| **x != 0.0).count() == 1)
}

impl View {
    /// The image positions, in pixels, of the ends of a line in world space, cut off behind the eye; `None` where all of it is.
    fn line(&self, a: DVec3, b: DVec3) -> Option<[[f64; 2]; 2]> {
        /// The depth at which lines are cut off, relative to the greater depth of their ends.
        const NEAR: f64 = 1e-4;
        if !self.is_perspective {
            return Some([a, b].map(|point| self.position(point, 1.0)));
        }
        let [near_a, near_b] = [a, b].map(|point| self.depth(point.into()));
        let near = NEAR * near_a.max(near_b);
        if near.is_nan() || near <= 0.0 {
            return None;
        }
        let cut = |point: DVec3, depth: f64, other: DVec3, other_depth: f64| {
            if depth >= near {
                return (point, depth);
            }
            let part = (near - depth) / (other_depth - depth);
            (point + (other - point) * part, near)
        };
        let ends = [cut(a, near_a, b, near_b), cut(b, near_b, a, near_a)];
        Some(ends.map(|(point, depth)| self.position(point, depth)))
    }
}

#[cfg(test)]
mod tests;

/// How much a line covers what is behind it.
const OPACITY: f32 = 0.85;

/// A picture, or the part of one of `size` that begins at `corner`.
struct Canvas<'a> {
    part: &'a mut Picture,
    corner: [u32; 2],
    size: [f64; 2],
}

/// Draws a line one pixel wide with soft edges: in each column, or each row of a steep line, it covers two pixels by the distances of
/// their centers. The parts outside the picture are cut off.
fn draw_line(canvas: &mut Canvas, from: [f64; 2], to: [f64; 2], color: [f32; 3]) {
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
