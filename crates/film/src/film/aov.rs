use std::fmt;

use exr::prelude::FlatSamples;

use super::{Film, Guide, Pixel};
use crate::output::canonical;

/// Arbitrary output variable: a property of the first hit of camera rays.
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
}

impl Aov {
    /// All AOVs.
    pub const ALL: [Self; 7] =
        [Self::Depth, Self::Normal, Self::ShadingNormal, Self::Albedo, Self::Instance, Self::Primitive, Self::Tests];

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
        }
    }

    /// The values of channel `k`, one per pixel.
    pub(crate) fn values(self, k: usize, pixels: &[Pixel], guides: &[Guide]) -> FlatSamples {
        let ids =
            |k: usize| FlatSamples::U32(guides.iter().map(|guide| guide.first.map_or(u32::MAX, |id| id[k])).collect());
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
        let mean = |(pixel, guide)| self.mean(k, pixel, guide) as f32;
        match self {
            Self::Instance => ids(0),
            Self::Primitive => ids(1),
            _ => FlatSamples::F32(pixels.iter().zip(guides).map(mean).collect()),
        }
    }

    fn mean(self, k: usize, pixel: &Pixel, guide: &Guide) -> f64 {
        let sum = match self {
            // Zero would put the background in front of everything, and a mix with hits into the air.
            Self::Depth if guide.n_hits == 0 => return f64::INFINITY,
            Self::Depth => return guide.depth / f64::from(guide.n_hits),
            Self::Normal => guide.normal[k],
            Self::ShadingNormal => guide.shading_normal[k],
            Self::Albedo => guide.albedo[k],
            Self::Tests => guide.tests[k],
            // Ids have no mean.
            Self::Instance | Self::Primitive => 0.0,
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
    /// The values of an AOV, the bits that [`write_film`](crate::write_film) writes; `None` if the film was rendered without AOVs.
    #[must_use]
    pub fn aov(&self, aov: Aov) -> Option<AovValues> {
        if self.guides().is_empty() {
            return None;
        }
        let n = aov.channels().len();
        let mut ids = Vec::new();
        let mut numbers = vec![0.0; n * self.guides().len()];
        for k in 0..n {
            match aov.values(k, self.pixels(), self.guides()) {
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
pub struct Aovs(u8);

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
        let values = |aov: Aov, k| aov.values(k, &[light; 2], &[edge, Guide::default()]);
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
