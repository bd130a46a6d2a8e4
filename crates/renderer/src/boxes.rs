//! Boxes of an acceleration structure, drawn over a picture.
//!
//! ```text
//! Structure -> boxes of a level, world space -> edges -> View -> lines over a Picture
//! ```

mod line;

use std::fmt;
use std::str::FromStr;

use canted_film::Picture;
use canted_obb::Obb;
use canted_wide::LaneKernel;

use crate::vector::{Vector, add, scale, sub};
use crate::{Structure, View};
use line::{Canvas, draw_line};

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

impl<K: LaneKernel> Structure<K> {
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
        match self {
            Self::One(flat) => flat.bvh.each_box(|obb, level, is_leaf| keep(&|| obb, level, is_leaf)),
            Self::Two(tlas) => {
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
        if let Self::Two(tlas) = self {
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
                if let Some([from, to]) = view.line(corners[a], corners[b]) {
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
    fn line(&self, a: Vector, b: Vector) -> Option<[[f64; 2]; 2]> {
        /// The depth at which lines are cut off, relative to the greater depth of their ends.
        const NEAR: f64 = 1e-4;
        if !self.is_perspective {
            return Some([a, b].map(|point| self.position(point, 1.0)));
        }
        let [near_a, near_b] = [a, b].map(|point| self.depth(point));
        let near = NEAR * near_a.max(near_b);
        if near.is_nan() || near <= 0.0 {
            return None;
        }
        let cut = |point: Vector, depth: f64, other: Vector, other_depth: f64| {
            if depth >= near {
                return (point, depth);
            }
            let part = (near - depth) / (other_depth - depth);
            (add(point, scale(sub(other, point), part)), near)
        };
        let ends = [cut(a, near_a, b, near_b), cut(b, near_b, a, near_a)];
        Some(ends.map(|(point, depth)| self.position(point, depth)))
    }
}

#[cfg(test)]
mod tests;
