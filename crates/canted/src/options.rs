//! Options that several subcommands share, and how their values are read.

use canted_lbvh::Strategy;
use canted_renderer::{Builder, Filter, Integrator, Levels, Lod, Pattern, StructureConfig};
use canted_scene::Scene;
use canted_wide::Preset;
use clap::ValueEnum;

use crate::output;

/// How rays find triangles.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct StructureArgs {
    /// Levels of trees: `auto` takes two where meshes are repeated so often that one level would waste memory.
    #[arg(long, value_enum, default_value_t = LevelsArg::Auto, value_name = "LEVELS")]
    pub(crate) levels: LevelsArg,
    /// How much is spent on the build: `fast`, `balanced`, or `quality` for the fastest rays.
    #[arg(long, value_enum, default_value_t = PresetArg::Balanced, value_name = "PRESET")]
    pub(crate) preset: PresetArg,
    /// Builder of the binary trees that wide ones are made of: `auto` is the preset's; `ploc` joins neighbours by area,
    /// `lbvh` is the radix tree as it is, `sah` splits from the root down, `obvhs` is the peer's.
    #[arg(long, value_enum, default_value_t = BuilderArg::Auto, value_name = "BUILDER")]
    pub(crate) builder: BuilderArg,
    /// Volumes of the nodes: `auto` makes eight-wide nodes that lean where their predicted cost is lower, node by node;
    /// the others keep a binary tree.
    #[arg(long, value_enum, default_value_t = VolumesArg::Auto, value_name = "VOLUMES")]
    pub(crate) volumes: VolumesArg,
    /// Ray-triangle test.
    #[arg(long, value_enum, default_value_t = TrianglesArg::Watertight, value_name = "TEST")]
    pub(crate) triangles: TrianglesArg,
}

impl StructureArgs {
    pub(crate) fn defaults() -> Self {
        Self {
            levels: LevelsArg::Auto,
            preset: PresetArg::Balanced,
            builder: BuilderArg::Auto,
            volumes: VolumesArg::Auto,
            triangles: TrianglesArg::Watertight,
        }
    }

    /// What is asked of the structure of a scene. That one level cannot be had is told.
    pub(crate) fn config(&self, scene: &Scene) -> StructureConfig {
        if matches!(self.levels, LevelsArg::One) && scene.moves() {
            output::to_stderr("warning: --levels one makes two levels here: instances move");
        }
        StructureConfig {
            levels: match self.levels {
                LevelsArg::Auto => Levels::Auto,
                LevelsArg::One => Levels::One,
                LevelsArg::Two => Levels::Two,
            },
            preset: self.preset.preset(),
            builder: match self.builder {
                BuilderArg::Auto => Builder::Auto,
                BuilderArg::Sah => Builder::Sah,
                BuilderArg::Ploc => Builder::Ploc,
                BuilderArg::Lbvh => Builder::Lbvh,
                BuilderArg::Obvhs => Builder::Obvhs,
            },
            volumes: match self.volumes {
                VolumesArg::Auto => None,
                VolumesArg::Aabb => Some(Strategy::Aabb),
                VolumesArg::PcaUnbounded => Some(Strategy::PcaUnbounded),
                VolumesArg::PcaBounded => Some(Strategy::PcaBounded),
                VolumesArg::Quaternion => Some(Strategy::Quaternion),
                VolumesArg::Combined => Some(Strategy::Combined),
                VolumesArg::Dop => Some(Strategy::Dop),
            },
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum LevelsArg {
    Auto,
    One,
    Two,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum PresetArg {
    Fast,
    Balanced,
    Quality,
}

impl PresetArg {
    pub(crate) fn preset(self) -> Preset {
        match self {
            Self::Fast => Preset::Fast,
            Self::Balanced => Preset::Balanced,
            Self::Quality => Preset::Quality,
        }
    }

    /// The name by which the command line knows it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Quality => "quality",
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum BuilderArg {
    Auto,
    Sah,
    Ploc,
    Lbvh,
    Obvhs,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum VolumesArg {
    Auto,
    Aabb,
    PcaUnbounded,
    PcaBounded,
    Quaternion,
    Combined,
    Dop,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum TrianglesArg {
    Watertight,
    MollerTrumbore,
    BaldwinWeber,
}

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

/// Calls `$run::<K>($args…)` with the kernel that `$triangles` names.
macro_rules! with_kernel {
    ($triangles:expr, $run:ident($($args:expr),*)) => {
        match $triangles {
            $crate::options::TrianglesArg::Watertight => $run::<canted_trace::Watertight>($($args),*),
            $crate::options::TrianglesArg::MollerTrumbore => $run::<canted_trace::MollerTrumbore>($($args),*),
            $crate::options::TrianglesArg::BaldwinWeber => $run::<canted_trace::BaldwinWeber>($($args),*),
        }
    };
}
pub(crate) use with_kernel;

/// The name by which the command line knows a strategy.
pub(crate) fn strategy_name(strategy: Strategy) -> &'static str {
    match strategy {
        Strategy::Aabb => "aabb",
        Strategy::PcaUnbounded => "pca-unbounded",
        Strategy::PcaBounded => "pca-bounded",
        Strategy::Quaternion => "quaternion",
        Strategy::Combined => "combined",
        Strategy::Dop => "dop",
    }
}

/// `N` finite numbers separated by commas.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != N {
        return Err(format!("{N} numbers separated by commas are needed, not {}", parts.len()));
    }
    let mut numbers = [0.0; N];
    for (number, part) in numbers.iter_mut().zip(parts) {
        *number = match part.trim().parse::<f32>() {
            Ok(x) if x.is_finite() => x,
            _ => return Err(format!("'{part}' is not a finite number")),
        };
    }
    Ok(numbers)
}

/// A finite number.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    text.trim().parse::<f32>().ok().filter(|x| x.is_finite()).ok_or_else(|| format!("'{text}' is not a finite number"))
}

/// A finite number that is not negative.
pub(crate) fn factor(text: &str) -> Result<f32, String> {
    number(text).ok().filter(|&x| x >= 0.0).ok_or_else(|| format!("'{text}' is not a finite number from 0 on"))
}

/// Three finite numbers separated by commas.
pub(crate) fn triple(text: &str) -> Result<[f32; 3], String> {
    numbers::<3>(text)
}

/// Six finite numbers separated by commas.
pub(crate) fn sextuple(text: &str) -> Result<[f32; 6], String> {
    numbers::<6>(text)
}

/// Pixels that one picture may have: more would not fit in the memory of ordinary machines.
const MAX_PIXELS: u64 = 1 << 26;

/// Width and height as `WxH`.
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("a size is WIDTHxHEIGHT, as 1280x720")?;
    let side = |text: &str| match text.trim().parse::<u32>() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("'{text}' is not a number of pixels")),
    };
    let size = [side(width)?, side(height)?];
    if u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS {
        return Err(format!("{} x {} pixels are more than {MAX_PIXELS}", size[0], size[1]));
    }
    Ok(size)
}

/// Degrees between 0 and 180, ends excluded.
pub(crate) fn fov(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(degrees) if degrees > 0.0 && degrees < 180.0 => Ok(degrees),
        _ => Err(format!("'{text}' is not an angle between 0 and 180 degrees")),
    }
}

/// A finite length, zero included.
pub(crate) fn lens_radius(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(radius) if radius >= 0.0 && radius.is_finite() => Ok(radius),
        _ => Err(format!("'{text}' is not a length of zero or more")),
    }
}

/// A length above zero; infinity is one.
pub(crate) fn radius(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(radius) if radius > 0.0 => Ok(radius),
        _ => Err(format!("'{text}' is not a length above zero")),
    }
}

/// Sizes the pool of threads that everything runs in.
pub(crate) fn use_threads(n_threads: Option<usize>) -> anyhow::Result<()> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(n_threads.unwrap_or(0))
        .build_global()
        .map_err(|error| anyhow::anyhow!("cannot start {} threads: {error}", n_threads.unwrap_or(0)))
}

/// A number of threads from 1 to 1024.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if (1..=1024).contains(&n) => Ok(n),
        _ => Err(format!("'{text}' is not a number of threads from 1 to 1024")),
    }
}
