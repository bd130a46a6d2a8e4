//! AOVs: properties of first hits and parts of the light, which are read from the sums of a film.

use std::fmt;

use exr::prelude::FlatSamples;

use crate::Film;
use crate::picture_file::canonical;
use crate::sums::{Components, Guide, Pixel};

/// Arbitrary output variable: a property of the first hit of camera rays, or a part of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Distance along the view axis in world units: mean of the samples that hit, infinite without hits.
    Depth,
    /// Geometric normal in world space, towards the camera; a miss counts as zero.
    Normal,
    /// Shading normal in world space; a miss counts as zero.
    ShadingNormal,
    /// Reflectance, linear RGB; a miss counts as black.
    Albedo,
    /// Instance of the first sample that hits; `u32::MAX` without hits.
    Instance,
    /// Triangle of the first sample that hits, by its index in the mesh; `u32::MAX` without hits.
    Primitive,
    /// Mean number of box and triangle tests of a camera ray.
    Tests,
    /// Light that reaches the camera without a surface in between: lights, emissive surfaces and the environment as camera rays see them.
    /// With [`Aov::Direct`] and [`Aov::Indirect`] it adds up to the picture.
    Emission,
    /// Light that one surface scatters from lights, emissive surfaces and the environment to the camera.
    Direct,
    /// The rest of the light.
    Indirect,
    /// Light of the listed lights that the first surface would reflect to the camera if nothing occluded them.
    Diffuse,
    /// The part of [`Aov::Diffuse`] that arrives: 1 where there is none.
    Shadow,
    /// Light of the environment that the first surface would reflect to the camera if nothing occluded it.
    Ambient,
    /// The part of [`Aov::Ambient`] that arrives: 1 where there is none.
    Occlusion,
}

impl Aov {
    /// All AOVs.
    pub const ALL: [Self; 14] = [
        Self::Depth,
        Self::Normal,
        Self::ShadingNormal,
        Self::Albedo,
        Self::Instance,
        Self::Primitive,
        Self::Tests,
        Self::Emission,
        Self::Direct,
        Self::Indirect,
        Self::Diffuse,
        Self::Shadow,
        Self::Ambient,
        Self::Occlusion,
    ];

    /// The parts of the light, in the order of [`Components::sums`].
    pub const COMPONENTS: [Self; 3] = [Self::Emission, Self::Direct, Self::Indirect];

    /// The light at the first surface, each part before the factor of what arrives, in the order of [`Components::first`].
    pub const FACTORS: [Self; 4] = [Self::Diffuse, Self::Shadow, Self::Ambient, Self::Occlusion];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::ShadingNormal => "shading-normal",
            Self::Albedo => "albedo",
            Self::Instance => "instance",
            Self::Primitive => "primitive",
            Self::Tests => "tests",
            Self::Emission => "emission",
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Diffuse => "diffuse",
            Self::Shadow => "shadow",
            Self::Ambient => "ambient",
            Self::Occlusion => "occlusion",
        }
    }

    /// EXR channel names; compositing tools expect `Z` and `N`.
    #[must_use]
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Depth => &["Z"],
            Self::Normal => &["N.X", "N.Y", "N.Z"],
            Self::ShadingNormal => &["Ns.X", "Ns.Y", "Ns.Z"],
            Self::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Self::Instance => &["id.instance"],
            Self::Primitive => &["id.primitive"],
            Self::Tests => &["tests.boxes", "tests.triangles"],
            Self::Emission => &["emission.R", "emission.G", "emission.B"],
            Self::Direct => &["direct.R", "direct.G", "direct.B"],
            Self::Indirect => &["indirect.R", "indirect.G", "indirect.B"],
            Self::Diffuse => &["diffuse.R", "diffuse.G", "diffuse.B"],
            Self::Shadow => &["shadow.R", "shadow.G", "shadow.B"],
            Self::Ambient => &["ambient.R", "ambient.G", "ambient.B"],
            Self::Occlusion => &["occlusion.R", "occlusion.G", "occlusion.B"],
        }
    }

    /// Whether it is light, rather than a property of first hits.
    fn is_light(self) -> bool {
        Self::COMPONENTS.contains(&self) || Self::FACTORS.contains(&self)
    }

    /// The value of channel `k` of light in a pixel.
    fn light(self, k: usize, components: &Components, pixel: &Pixel) -> f64 {
        let Components { sums, first } = components.mean(pixel);
        let first = first.unwrap_or_default();
        if let Some(part) = Self::COMPONENTS.iter().position(|&part| part == self) {
            return sums[part][k];
        }
        match self {
            Self::Diffuse => first[0][k],
            // Of sums: the mean of ratios would not multiply to the mean of products.
            Self::Shadow => Components::arriving(first[0][k], first[1][k]),
            Self::Ambient => first[2][k],
            Self::Occlusion => Components::arriving(first[2][k], first[3][k]),
            _ => 0.0,
        }
    }

    /// The values of channel `k`, one per pixel; none if the film does not store them.
    pub(crate) fn values(self, k: usize, film: &Film) -> FlatSamples {
        let (pixels, guides, components) = (film.pixels(), film.guides(), film.components());
        if self.is_light() {
            let means = components.iter().zip(pixels).map(|(components, pixel)| self.light(k, components, pixel));
            return FlatSamples::F32(means.map(|x| x as f32).collect());
        }
        let ids =
            |k: usize| FlatSamples::U32(guides.iter().map(|guide| guide.first.map_or(u32::MAX, |id| id[k])).collect());
        let mean = |(pixel, guide)| self.mean(k, pixel, guide) as f32;
        match self {
            Self::Instance => ids(0),
            Self::Primitive => ids(1),
            _ => FlatSamples::F32(pixels.iter().zip(guides).map(mean).collect()),
        }
    }

    /// The mean of a property of first hits.
    pub(crate) fn mean(self, k: usize, pixel: &Pixel, guide: &Guide) -> f64 {
        let sum = match self {
            // Zero would put the background in front of everything, and a mix with hits into the air.
            Self::Depth if guide.n_hits == 0 => return f64::INFINITY,
            Self::Depth => return guide.depth / f64::from(guide.n_hits),
            Self::Normal => guide.normal[k],
            Self::ShadingNormal => guide.shading_normal[k],
            Self::Albedo => guide.albedo[k],
            Self::Tests => guide.tests[k],
            // Ids have no mean, and light is no property of first hits.
            _ => 0.0,
        };
        sum / f64::from(pixel.n_taken().max(1))
    }
}

/// The values of an AOV, pixel by pixel; of a pixel one for each of [`Aov::channels`].
#[derive(Clone, Debug, PartialEq)]
pub enum AovValues {
    /// Numbers.
    Numbers(Vec<f32>),
    /// Ids; `u32::MAX` without hits.
    Ids(Vec<u32>),
}

impl Film {
    /// Those of a set that the film stores: `path` does not separate the light at the first surface.
    #[must_use]
    pub fn stored(&self, aovs: Aovs) -> Aovs {
        let (has_guides, has_components) = (!self.guides().is_empty(), !self.components().is_empty());
        let has_first = self.components().iter().any(|components| components.first.is_some());
        let is_stored = |aov: &Aov| match Aov::FACTORS.contains(aov) {
            true => has_first,
            false if aov.is_light() => has_components,
            false => has_guides,
        };
        aovs.iter().filter(is_stored).collect()
    }

    /// The values of an AOV, the bits that [`write_film`](crate::write_film) writes; `None` if the film was rendered without AOVs, without
    /// parts of the light, or without the light at the first surface. Each of a kind stores all of that kind.
    #[must_use]
    pub fn aov(&self, aov: Aov) -> Option<AovValues> {
        if self.stored(Aovs::NONE.with(aov)).is_empty() {
            return None;
        }
        let n_stored = self.pixels().len();
        let n = aov.channels().len();
        let mut ids = Vec::new();
        let mut numbers = vec![0.0; n * n_stored];
        for k in 0..n {
            match aov.values(k, self) {
                FlatSamples::U32(values) => ids = values,
                FlatSamples::F32(values) => {
                    values.iter().enumerate().for_each(|(i, &x)| numbers[n * i + k] = canonical(x));
                }
                FlatSamples::F16(_) => unreachable!("no AOV has half precision"),
            }
        }
        Some(if ids.is_empty() { AovValues::Numbers(numbers) } else { AovValues::Ids(ids) })
    }
}

/// A set of AOVs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Aovs(u16);

impl Aovs {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Adds `aov`.
    #[must_use]
    pub fn with(self, aov: Aov) -> Self {
        Self(self.0 | 1 << aov as u8)
    }

    /// Whether `aov` is in the set.
    #[must_use]
    pub fn contains(self, aov: Aov) -> bool {
        self.0 >> aov as u8 & 1 == 1
    }

    /// Whether a part of the light is in the set; light at the first surface is stored with the parts.
    #[must_use]
    pub fn has_components(self) -> bool {
        Aov::COMPONENTS.iter().any(|&aov| self.contains(aov)) || self.has_factors()
    }

    /// Whether light at the first surface is in the set.
    #[must_use]
    pub fn has_factors(self) -> bool {
        Aov::FACTORS.iter().any(|&aov| self.contains(aov))
    }

    /// The set without light at the first surface.
    #[must_use]
    pub fn without_factors(self) -> Self {
        self.iter().filter(|aov| !Aov::FACTORS.contains(aov)).collect()
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its members in the order of [`Aov::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Aov> {
        Aov::ALL.into_iter().filter(move |&aov| self.contains(aov))
    }
}

impl fmt::Display for Aovs {
    /// The names, separated by commas; `none` for none.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.iter().map(Aov::name).collect();
        f.write_str(if names.is_empty() { "none".to_owned() } else { names.join(",") }.as_str())
    }
}

impl FromIterator<Aov> for Aovs {
    fn from_iter<I: IntoIterator<Item = Aov>>(aovs: I) -> Self {
        aovs.into_iter().fold(Self::NONE, Self::with)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn f32s(samples: FlatSamples) -> Vec<f32> {
        if let FlatSamples::F32(values) = samples { values } else { panic!("{samples:?}") }
    }

    #[test]
    fn misses_count_for_normals_but_not_for_depth() {
        let light = [[1.0; 3]; 4].map(Pixel::of).into_iter().reduce(|a, b| a + b).unwrap();
        let edge = Guide { n_hits: 2, first: Some([3, 9]), depth: 10.0, normal: [2.0, 0.0, 0.0], ..Guide::default() };
        let film = Film::new(2, 1, vec![light; 2], vec![edge, Guide::default()], 0);
        let values = |aov: Aov, k| aov.values(k, &film);
        assert_eq!(f32s(values(Aov::Depth, 0)), [5.0, f32::INFINITY]);
        assert_eq!(f32s(values(Aov::Normal, 0)), [0.5, 0.0]);
        assert_eq!(f32s(values(Aov::Albedo, 2)), [0.0, 0.0]);
        assert_eq!(values(Aov::Instance, 0), FlatSamples::U32(vec![3, u32::MAX]));
        assert_eq!(values(Aov::Primitive, 0), FlatSamples::U32(vec![9, u32::MAX]));
    }

    #[test]
    fn sets_contain_what_was_added() {
        let set: Aovs = [Aov::Tests, Aov::Depth].into_iter().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), [Aov::Depth, Aov::Tests]);
        assert!(!set.contains(Aov::Normal) && !set.is_empty() && Aovs::NONE.is_empty());
    }
}
