//! Options that several subcommands share.

mod numbers;

use canted_lbvh::Strategy;
use canted_renderer::{Accel, Builder, Levels, StructureConfig};
use canted_scene::Scene;
use canted_wide::Preset;
use clap::ValueEnum;

use crate::output;
pub(crate) use numbers::{factor, fov, lens_radius, number, numbers, radius, sextuple, size, threads, triple};

/// The options of a command as they are where nothing is said.
pub(crate) fn defaults<A: clap::Args>() -> A {
    let command = A::augment_args(clap::Command::new("canted").no_binary_name(true));
    A::from_arg_matches(&command.get_matches_from([""; 0])).unwrap_or_else(|error| error.exit())
}

/// How rays find triangles.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct StructureArgs {
    /// Levels of trees: `auto` takes two where meshes are repeated so often that one level would waste memory.
    #[arg(long, value_enum, default_value_t = LevelsArg::Auto, value_name = "LEVELS")]
    pub(crate) levels: LevelsArg,
    /// How much is spent on the build of wide trees: `fast`, `balanced`, or `quality` for the fastest rays. Volumes by name make
    /// binary ones, which have no presets.
    #[arg(long, value_enum, default_value_t = PresetArg::Balanced, value_name = "PRESET")]
    pub(crate) preset: PresetArg,
    /// Builder of the binary trees, of which wide ones are made: `auto` is the preset's, and `ploc` with volumes by name; `ploc`
    /// joins neighbours by area, `lbvh` is the radix tree as it is, `sah` splits from the root down, `obvhs` is the peer's.
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
    /// What is asked of the structure of a scene. That one level cannot be had is told.
    pub(crate) fn config(&self, scene: &Scene) -> StructureConfig {
        if matches!(self.levels, LevelsArg::One) && scene.has_motion() {
            output::to_stderr("warning: --levels one makes two levels here: instances move");
        }
        let builder = match self.builder {
            BuilderArg::Auto => None,
            BuilderArg::Sah => Some(Builder::Sah),
            BuilderArg::Ploc => Some(Builder::Ploc),
            BuilderArg::Lbvh => Some(Builder::Lbvh),
            BuilderArg::Obvhs => Some(Builder::Obvhs),
        };
        let strategy = match self.volumes {
            VolumesArg::Auto => None,
            VolumesArg::Aabb => Some(Strategy::Aabb),
            VolumesArg::PcaUnbounded => Some(Strategy::PcaUnbounded),
            VolumesArg::PcaBounded => Some(Strategy::PcaBounded),
            VolumesArg::Quaternion => Some(Strategy::Quaternion),
            VolumesArg::Combined => Some(Strategy::Combined),
            VolumesArg::Dop => Some(Strategy::Dop),
        };
        StructureConfig {
            levels: match self.levels {
                LevelsArg::Auto => Levels::Auto,
                LevelsArg::One => Levels::One,
                LevelsArg::Two => Levels::Two,
            },
            accel: match strategy {
                None => Accel::Wide { preset: self.preset.preset(), builder },
                Some(strategy) => Accel::Binary { strategy, builder },
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

/// Sizes the pool of threads that everything runs in.
pub(crate) fn use_threads(n_threads: Option<usize>) -> anyhow::Result<()> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(n_threads.unwrap_or(0))
        .build_global()
        .map_err(|error| anyhow::anyhow!("cannot start {} threads: {error}", n_threads.unwrap_or(0)))
}
