//! What a picture may be made by: one name of several.

use canted_film::Filter;
use canted_renderer::{Integrator, Lod, Pattern};
use clap::ValueEnum;

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum SamplerArg {
    Random,
    Stratified,
    Sobol,
}

impl SamplerArg {
    pub(crate) fn pattern(self) -> Pattern {
        match self {
            Self::Random => Pattern::Random,
            Self::Stratified => Pattern::Stratified,
            Self::Sobol => Pattern::Sobol,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum FilterArg {
    Box,
    Tent,
    Gaussian,
    Mitchell,
    BlackmanHarris,
}

impl FilterArg {
    pub(crate) fn filter(self) -> Filter {
        match self {
            Self::Box => Filter::BOX,
            Self::Tent => Filter::TENT,
            Self::Gaussian => Filter::GAUSSIAN,
            Self::Mitchell => Filter::MITCHELL,
            Self::BlackmanHarris => Filter::BLACKMAN_HARRIS,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum IntegratorArg {
    Hybrid,
    Path,
}

impl IntegratorArg {
    pub(crate) fn integrator(self) -> Integrator {
        match self {
            Self::Hybrid => Integrator::Hybrid,
            Self::Path => Integrator::Path,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum LodArg {
    None,
    Cone,
    Aniso,
}

impl LodArg {
    pub(crate) fn lod(self) -> Lod {
        match self {
            Self::None => Lod::None,
            Self::Cone => Lod::Cone,
            Self::Aniso => Lod::Aniso,
        }
    }
}
