//! What the filter reads of each pixel: light without albedo, its variance, and the first surface.

use crate::{Film, Guide, Pixel, Tile, Tiling};

/// Added to the albedo before light is divided by it, so that black surfaces do not amplify their reflections.
const ALBEDO_FLOOR: f32 = 0.02;

/// Mean light of a pixel, divided by the albedo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Light {
    pub(super) color: [f32; 3],
    /// Variance of the mean, averaged over the channels; negative where it is unknown.
    pub(super) variance: f32,
}

/// The first surface of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Feature {
    /// Mean shading normal; shorter than 1 where normals differ, zero for a miss.
    pub(super) normal: [f32; 3],
    /// Mean depth of the hits; zero for a miss.
    pub(super) depth: f32,
    pub(super) albedo: [f32; 3],
    /// Whether the pixel has a sample.
    pub(super) is_present: bool,
}

impl Feature {
    /// What the light of a channel was divided by.
    pub(super) fn scale(&self, channel: usize) -> f32 {
        self.albedo[channel] + ALBEDO_FLOOR
    }
}

/// A noisy picture, as the filter reads it: 48 bytes per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Noisy {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) light: Vec<Light>,
    pub(super) features: Vec<Feature>,
}

impl Noisy {
    /// A picture without samples.
    #[must_use]
    pub fn new([width, height]: [u32; 2]) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, light: vec![Light::default(); n], features: vec![Feature::default(); n] }
    }

    /// The picture of a film; `None` if it was rendered without AOVs.
    #[must_use]
    pub fn of_film(film: &Film) -> Option<Self> {
        if film.guides().is_empty() {
            return None;
        }
        let mut noisy = Self::new([film.width(), film.height()]);
        for (index, (pixel, guide)) in film.pixels().iter().zip(film.guides()).enumerate() {
            noisy.set(index, pixel, guide);
        }
        Some(noisy)
    }

    /// Adds a finished tile of a picture with AOVs.
    ///
    /// # Panics
    /// If the tile does not belong to a picture of this size.
    pub fn add(&mut self, tiling: &Tiling, tile: &Tile) {
        assert_eq!(tiling.picture_size(), [self.width, self.height], "a tile of this picture");
        for (index, pixel, guide) in tiling.totals(tile) {
            self.set(index, &pixel, &guide);
        }
    }

    /// The part of the picture with this top left corner and this size.
    ///
    /// # Panics
    /// If it exceeds the picture.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        let light = crate::picture::cropped(&self.light, self.width, corner, size);
        let features = crate::picture::cropped(&self.features, self.width, corner, size);
        Self { width: size[0], height: size[1], light, features }
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    fn set(&mut self, index: usize, pixel: &Pixel, guide: &Guide) {
        // As for the AOVs, a miss counts as zero, except for the depth.
        let n = f64::from(pixel.n_taken().max(1));
        let feature = Feature {
            normal: guide.shading_normal.map(|x| (x / n) as f32),
            depth: (guide.depth / f64::from(guide.n_hits.max(1))) as f32,
            albedo: guide.albedo.map(|x| (x / n) as f32).map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 }),
            is_present: pixel.n_taken() > 0,
        };
        let mean = pixel.mean();
        let scale: [f64; 3] = std::array::from_fn(|k| f64::from(feature.scale(k)));
        let color = std::array::from_fn(|k| (mean[k] / scale[k]) as f32);
        let variances = pixel.variance_of_mean();
        let sum: f64 = (0..3).map(|k| variances[k] / (scale[k] * scale[k])).sum();
        let variance = if pixel.n_samples < 2 { -1.0 } else { (sum / 3.0) as f32 };
        self.light[index] = Light { color, variance };
        self.features[index] = feature;
    }
}
