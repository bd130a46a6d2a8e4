use std::ops::Range;

use canted_film::{Aovs, Filter, Record, Tiling};

use crate::{Lod, Pattern};

/// Which light is gathered, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Integrator {
    /// Direct light, diffuse bounces, ambient light with occlusion: every surface is Lambert's. Biased, see
    /// [`Settings::ao_radius`].
    #[default]
    Hybrid,
    /// The rendering equation with all materials; biased by nothing but [`Settings::bounces`].
    Path,
}

impl Integrator {
    /// Bounces where nothing is said: for the path integrator so many that roulette ends nearly all paths before.
    #[must_use]
    pub fn bounces(self) -> u32 {
        match self {
            Self::Hybrid => 2,
            Self::Path => 32,
        }
    }
}

/// What a picture is made of, beside scene and camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Which light is gathered.
    pub integrator: Integrator,
    /// Samples per pixel.
    pub samples: u32,
    /// First and one past the last number of the samples to take, of those; `None` for all of them.
    ///
    /// The film then keeps a [`canted_film::Part`] that joins with others to the bits of the whole.
    pub part: Option<[u32; 2]>,
    /// Relative standard error below which a neighbourhood of pixels takes no further samples, see [`crate::render`].
    pub noise: Option<f32>,
    /// What the film keeps beside light.
    pub aovs: Aovs,
    /// Bounces after the surface that the camera sees; with 0 surfaces show what they emit, and light of lights and sky.
    pub bounces: u32,
    /// Chooses the random numbers.
    pub seed: u32,
    /// How the samples are spread.
    pub pattern: Pattern,
    /// How light around the middle of a pixel is weighed.
    pub filter: Filter,
    /// How much of a texture a lookup averages.
    pub lod: Lod,
    /// Of the hybrid integrator, the world-space distance over which ambient light returns beside an occluder; infinite
    /// for none, `None` for a tenth of the diagonal of the scene's bounds.
    pub ao_radius: Option<f32>,
    /// Pixels along the side of a tile, the unit of work, rounded up to a multiple of 8; no effect on the picture.
    pub tile: u32,
}

impl Default for Settings {
    /// 1280 x 720 pixels, 16 stratified samples, two bounces.
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            integrator: Integrator::Hybrid,
            samples: 16,
            part: None,
            noise: None,
            aovs: Aovs::NONE,
            bounces: 2,
            seed: 0,
            pattern: Pattern::Stratified,
            filter: Filter::BOX,
            lod: Lod::default(),
            ao_radius: None,
            tile: 32,
        }
    }
}

impl Settings {
    /// Numbers of the samples to take.
    #[must_use]
    pub fn range(&self) -> Range<u32> {
        let [start, end] = self.part.unwrap_or([0, self.samples]);
        start..end
    }

    /// Tiles of the picture.
    #[must_use]
    pub fn tiling(&self) -> Tiling {
        let Self { width, height, tile, part, aovs, .. } = *self;
        Tiling::new([width, height], tile, part.map(|[start, end]| start..end), !aovs.is_empty())
    }

    /// What decides the value of a sample, by name: equal records and equal scenes make samples of one picture.
    ///
    /// Which samples are taken, and what is kept of them, is not in it.
    #[must_use]
    pub fn record(&self) -> Record {
        // Without `..`: a new setting must not be forgotten.
        let Self {
            width,
            height,
            integrator,
            samples,
            part: _,
            noise: _,
            aovs: _,
            bounces,
            seed,
            pattern,
            filter,
            lod,
            ao_radius,
            tile: _,
        } = self;
        let pattern = match pattern {
            // Its cells depend on how many there are.
            Pattern::Stratified => format!("stratified of {samples}"),
            pattern => format!("{pattern:?}").to_lowercase(),
        };
        let radius = ao_radius.map_or_else(|| "auto".to_owned(), |radius| radius.to_string());
        [
            ("size", format!("{width}x{height}")),
            ("integrator", format!("{integrator:?}").to_lowercase()),
            ("bounces", bounces.to_string()),
            ("seed", seed.to_string()),
            ("sampler", pattern),
            ("filter", filter.to_string()),
            ("lod", format!("{lod:?}").to_lowercase()),
            ("ao-radius", radius),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .to_vec()
    }
}
