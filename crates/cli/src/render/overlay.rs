//! `--boxes`: boxes of the acceleration structure over the picture.

use anyhow::Result;
use canted_film::Picture;
use canted_obb::Obb;
use canted_renderer::{BoxLevel, Structure, View, draw_boxes};
use canted_scene::Camera;
use canted_wide::LaneKernel;

use super::Args;
use crate::output;

/// Boxes that are drawn over a picture.
pub(crate) struct Overlay {
    view: View,
    boxes: Vec<Obb>,
}

impl Overlay {
    /// The boxes that the options show, if any. Warns about a level without boxes.
    pub(super) fn new<K: LaneKernel>(args: &Args, structure: &Structure<K>, camera: &Camera) -> Result<Option<Self>> {
        let Some(level) = args.boxes else { return Ok(None) };
        let boxes = structure.boxes(level);
        if boxes.is_empty() {
            output::warn(&no_boxes(level, structure.n_levels()));
        }
        let [width, height] = args.size;
        Ok(Some(Self { view: View::new(camera, width, height)?, boxes }))
    }

    /// Draws them over the part of the picture that begins at `corner`.
    pub(super) fn draw(&self, picture: &mut Picture, corner: [u32; 2]) {
        draw_boxes(picture, corner, &self.view, &self.boxes);
    }
}

/// The warning about a level without boxes.
pub(crate) fn no_boxes(level: BoxLevel, n_levels: u32) -> String {
    match n_levels {
        0 => format!("--boxes {level} shows nothing: the scene has no triangles"),
        n => format!("--boxes {level} shows nothing: the structure has the levels 0 to {}", n - 1),
    }
}
