use std::ops::Range;

use canted_film::{Aov, Aovs, Block, Filter, Record, Tiling};

use crate::{Hemisphere, Lod, Pattern};

/// The rendering algorithm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Integrator {
    /// Direct light, diffuse bounces and ambient occlusion; all surfaces are Lambertian. Biased, see
    /// [`Settings::ao_radius`].
    #[default]
    Hybrid,
    /// Path tracing with all materials, unbiased up to [`Settings::bounces`].
    Path,
}

impl Integrator {
    /// All integrators.
    pub const ALL: [Self; 2] = [Self::Hybrid, Self::Path];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::Path => "path",
        }
    }

    /// The AOVs that it computes: all of them, but that `path` does not separate the light at the first surface.
    #[must_use]
    pub fn aovs(self) -> Aovs {
        let all: Aovs = Aov::ALL.into_iter().collect();
        match self {
            Self::Hybrid => all,
            Self::Path => all.without_factors(),
        }
    }

    /// The default number of bounces; with path tracing, Russian roulette ends nearly all paths earlier.
    #[must_use]
    pub fn bounces(self) -> u32 {
        match self {
            Self::Hybrid => 2,
            Self::Path => 32,
        }
    }
}

/// Which faces of surfaces rays pass from behind. Surfaces that transmit light are seen from both sides.
///
/// A face that camera rays pass lets light through from behind, too, where the eye is behind it. Closed solids look the same with any of
/// them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cull {
    /// Faces of materials that their file says to be single-sided: [`canted_scene::Material::double_sided`].
    #[default]
    Auto,
    /// None.
    Off,
    /// All faces.
    Back,
}

impl Cull {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Off, Self::Back];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Off => "off",
            Self::Back => "back",
        }
    }
}

/// How the hybrid integrator finds the first hits of camera rays on a device. The picture does not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FirstHit {
    /// The faster of the others, measured before the first sample; on software drivers, which rasterize as slowly as they trace, and
    /// where a picture cannot be rasterized, [`FirstHit::Trace`].
    #[default]
    Auto,
    /// A raster pass draws what is at the center of each pixel. Rays are traced no farther than that, and again where it was not
    /// there: samples lie beside the center, and alpha tests may reject what was drawn.
    Raster,
    /// Rays are traced to their end.
    Trace,
}

impl FirstHit {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Raster, Self::Trace];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Raster => "raster",
            Self::Trace => "trace",
        }
    }
}

/// Where the samples of a pixel are summed that a device takes.
///
/// The bits are the same: the device computes the `f64` of the host in integers, with the same additions in the same order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleSums {
    /// Every sample is downloaded.
    #[default]
    Host,
    /// The device sums the samples of a pixel: 64 bytes are downloaded for any number of them, instead of 16 for each. With AOVs, what camera rays hit first
    /// are 112 bytes more, instead of 64 for each; the light in parts 72, instead of 36, and that at the first surface 96, instead of 48. With
    /// [`Settings::part`], for each block whose sum the film keeps; with [`Settings::noise`], each time that it decides, and for each block of
    /// the last samples.
    Device,
}

impl SampleSums {
    /// Where fewer bytes are downloaded.
    #[must_use]
    pub fn of_fewer_bytes(settings: &Settings) -> Self {
        let n_records = settings.part.map_or(1, |[first, end]| Block::of(first..end).len());
        let Settings { aovs, .. } = settings;
        // Bytes of a sample, and of a sum: of light, of what camera rays hit first, and of parts of the light.
        let kept = [
            (true, [16, 64]),
            (!aovs.is_empty(), [64, 112]),
            (aovs.has_components(), [36, 72]),
            (aovs.has_factors(), [48, 96]),
        ];
        let bytes = |k: usize| kept.iter().filter(|(is_kept, _)| *is_kept).map(|(_, bytes)| bytes[k]).sum::<usize>();
        if bytes(0) * settings.range().len() > bytes(1) * n_records { Self::Device } else { Self::Host }
    }

    /// All of them.
    pub const ALL: [Self; 2] = [Self::Host, Self::Device];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Device => "device",
        }
    }
}

/// Everything that determines a picture besides scene and camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The rendering algorithm.
    pub integrator: Integrator,
    /// Samples per pixel.
    pub samples: u32,
    /// The first sample to take and one past the last; `None` for all samples.
    ///
    /// The film then has a [`canted_film::Part`], and joined parts have the bits of an undivided render.
    pub part: Option<[u32; 2]>,
    /// Relative standard error below which cells of pixels stop, see [`crate::render`].
    pub noise: Option<f32>,
    /// AOVs to store.
    pub aovs: Aovs,
    /// Bounces after the first hit; 0 renders emission and direct light.
    pub bounces: u32,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Sampling pattern.
    pub pattern: Pattern,
    /// Pixel reconstruction filter.
    pub filter: Filter,
    /// Texture filtering.
    pub lod: Lod,
    /// Which faces rays pass.
    pub cull: Cull,
    /// Greatest radiance, in the brightest channel, of light that at least two surfaces scattered before it reaches the camera, by
    /// sample; mirrors and clear glass in front of the first count as none. `None` for no limit. It removes rare bright samples, and
    /// the light that they carry.
    pub clamp: Option<f32>,
    /// Whether `path` gives back the light that rough surfaces lose by multiple scattering between their microfacets. Renderers
    /// with single scattering give the picture without.
    pub energy_compensation: bool,
    /// How diffuse and ambient directions are sampled.
    pub hemisphere: Hemisphere,
    /// Ambient occlusion radius of the hybrid integrator in world units: occluders at this distance no longer darken. `None` for a
    /// tenth of the diagonal of the scene's bounds.
    pub ao_radius: Option<f32>,
    /// Whether the film keeps only the mean of each pixel, in 12 bytes instead of 64. Ignored with `part`, `noise` and `aovs`, which
    /// need sums.
    pub means_only: bool,
    /// Where samples of a device are summed; the CPU ignores it.
    pub sums: SampleSums,
    /// Side of a tile in pixels, rounded up to a multiple of 8; the picture does not depend on it.
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
            cull: Cull::default(),
            clamp: None,
            energy_compensation: true,
            hemisphere: Hemisphere::Cosine,
            ao_radius: None,
            means_only: false,
            sums: SampleSums::Host,
            tile: 32,
        }
    }
}

impl Settings {
    /// The samples to take.
    #[must_use]
    pub fn range(&self) -> Range<u32> {
        let [start, end] = self.part.unwrap_or([0, self.samples]);
        start..end
    }

    /// Tiles of the picture.
    #[must_use]
    pub fn tiling(&self) -> Tiling {
        let Self { width, height, tile, part, aovs, noise, means_only, .. } = *self;
        let tiling = Tiling::new([width, height], tile, part.map(|[start, end]| start..end), !aovs.is_empty());
        let tiling = if aovs.has_components() { tiling.with_components() } else { tiling };
        let needs_sums = part.is_some() || noise.is_some() || !aovs.is_empty();
        if means_only && !needs_sums { tiling.means_only() } else { tiling }
    }

    /// The settings that determine the value of a sample: samples with equal records and equal scenes can be joined.
    ///
    /// Which samples are taken, and which sums are stored, is not included.
    #[must_use]
    pub fn record(&self) -> Record {
        // Without `..`, so that a new setting cannot be forgotten.
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
            cull,
            clamp,
            energy_compensation,
            hemisphere,
            ao_radius,
            means_only: _,
            sums: _,
            tile: _,
        } = self;
        let pattern = match pattern {
            // The strata depend on the number of samples.
            Pattern::Stratified => format!("stratified of {samples}"),
            pattern => pattern.name().to_owned(),
        };
        let radius = ao_radius.map_or_else(|| "auto".to_owned(), |radius| radius.to_string());
        // The default is not stated, so that records without it keep their meaning.
        let hemisphere = (*hemisphere != Hemisphere::Cosine).then(|| ("hemisphere", hemisphere.name().to_owned()));
        [
            ("size", format!("{width}x{height}")),
            ("integrator", integrator.name().to_owned()),
            ("bounces", bounces.to_string()),
            ("seed", seed.to_string()),
            ("sampler", pattern),
            ("filter", filter.to_string()),
            ("lod", lod.name().to_owned()),
            ("cull", cull.name().to_owned()),
            ("clamp", clamp.map_or_else(|| "off".to_owned(), |clamp| clamp.to_string())),
            ("energy-compensation", if *energy_compensation { "on" } else { "off" }.to_owned()),
            ("ao-radius", radius),
        ]
        .into_iter()
        .chain(hemisphere)
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_summed_where_fewer_bytes_are_downloaded() {
        let [depth, direct, shadow] = [Aov::Depth, Aov::Direct, Aov::Shadow].map(|aov| Aovs::NONE.with(aov));
        for (samples, part, aovs, expected) in [
            (4, None, Aovs::NONE, SampleSums::Host),
            (5, None, Aovs::NONE, SampleSums::Device),
            (2, None, depth, SampleSums::Host),
            (3, None, depth, SampleSums::Device),
            // Three blocks, and six.
            (64, Some([1, 8]), Aovs::NONE, SampleSums::Host),
            (64, Some([1, 64]), Aovs::NONE, SampleSums::Device),
            // 116 bytes a sample and 248 a sum, then 164 and 344.
            (2, None, direct, SampleSums::Host),
            (3, None, direct, SampleSums::Device),
            (2, None, shadow, SampleSums::Host),
            (3, None, shadow, SampleSums::Device),
            (64, Some([1, 4]), shadow, SampleSums::Host),
            (64, Some([1, 8]), shadow, SampleSums::Device),
        ] {
            let settings = Settings { samples, part, aovs, ..Settings::default() };
            assert_eq!(SampleSums::of_fewer_bytes(&settings), expected, "{samples} samples, {part:?}, {aovs}");
        }
    }
}
