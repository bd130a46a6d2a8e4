use crate::{Filter, Pattern};

/// What a picture is made of, beside scene and camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Diffuse bounces after the surface that the camera sees; 0 is direct light and ambient alone.
    pub bounces: u32,
    /// Chooses the random numbers.
    pub seed: u32,
    /// How the samples are spread.
    pub pattern: Pattern,
    /// How light around the middle of a pixel is weighed.
    pub filter: Filter,
    /// World-space distance over which ambient light returns beside an occluder; infinite for none, `None` for a
    /// tenth of the diagonal of the scene's bounds.
    pub ao_radius: Option<f32>,
    /// Pixels along the side of a tile, the unit of work; no effect on the picture.
    pub tile: u32,
}

impl Default for Settings {
    /// 1280 x 720 pixels, 16 stratified samples, two bounces.
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            samples: 16,
            bounces: 2,
            seed: 0,
            pattern: Pattern::Stratified,
            filter: Filter::BOX,
            ao_radius: None,
            tile: 32,
        }
    }
}
