//! Options that several subcommands share.

mod numbers;

use anyhow::{Result, bail};
use canted_lbvh::Strategy;
use canted_renderer::{Accel, Builder, Levels, StructureConfig};
use canted_scene::Scene;
use canted_wide::Preset;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::output;
pub(crate) use numbers::{factor, fov, noise, number, numbers, radius, size, threads};

/// The values of an option by name.
pub(crate) type Names<T> = [(&'static str, T)];

/// A parser of one value by its name.
pub(crate) fn one_of<T>(names: &'static Names<T>) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync,
{
    let value = |name: String| names.iter().find(|(known, _)| *known == name).map(|&(_, value)| value);
    PossibleValuesParser::new(names.iter().map(|(name, _)| *name))
        .try_map(move |name| value(name).ok_or("unknown name"))
}

/// The name of a value.
pub(crate) fn name_of<T: PartialEq>(names: &'static Names<T>, value: &T) -> &'static str {
    names.iter().find(|(_, known)| known == value).map_or("unknown", |(name, _)| name)
}

/// The options of a command with their default values.
pub(crate) fn defaults<A: clap::Args>() -> A {
    let command = A::augment_args(clap::Command::new("canted").no_binary_name(true));
    A::from_arg_matches(&command.get_matches_from([""; 0])).unwrap_or_else(|error| error.exit())
}

/// Bounding volumes of a binary BVH; `None` for a wide BVH. An alias, because clap treats `Option` as a missing option.
type Volumes = Option<Strategy>;

/// A builder; `None` for the one that the structure chooses. An alias as [`Volumes`].
type BuilderChoice = Option<Builder>;

/// The acceleration structure.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Acceleration structure")]
pub(crate) struct StructureArgs {
    /// BVH levels. `auto` uses two levels where instancing saves memory, else one.
    #[arg(long, default_value = "auto", value_parser = one_of(&LEVELS), value_name = "LEVELS")]
    levels: Levels,
    /// Acceleration structure: eight-wide BVH, binary BVH, bounding interval hierarchy or kd-tree [default: wide, or bvh2 with --volumes
    /// NAME].
    #[arg(long, value_parser = one_of(&ACCELS), value_name = "STRUCTURE")]
    accel: Option<AccelKind>,
    /// Build effort of the wide BVH. `quality` builds slowest and traces fastest.
    #[arg(long, default_value = "balanced", value_parser = one_of(&PRESETS), value_name = "PRESET")]
    preset: Preset,
    /// Builder of the binary tree that becomes the BVH. `auto` is the builder of the preset; with --volumes it is `ploc` on the CPU and `lbvh` on
    /// a GPU. `sbvh` is `sah` with spatial splits. A GPU builds its BVHs itself with --volumes, `lbvh` and `ploc`; else the CPU does.
    #[arg(long, default_value = "auto", value_parser = one_of(BUILDERS), value_name = "BUILDER")]
    builder: BuilderChoice,
    /// Bounding volumes. `auto` builds a wide BVH of axis-aligned and oriented nodes, or with --accel bvh2 axis-aligned boxes; the others
    /// build a binary BVH.
    #[arg(long, default_value = "auto", value_parser = one_of(&VOLUMES), value_name = "VOLUMES")]
    volumes: Volumes,
    /// Ray-triangle intersection test.
    #[arg(long, default_value = "watertight", value_parser = one_of(&TRIANGLE_TESTS), value_name = "TEST")]
    pub(crate) triangles: TriangleTest,
}

/// Value of --accel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum AccelKind {
    Wide,
    Bvh2,
    Bih,
    KdTree,
}

const ACCELS: [(&str, AccelKind); 4] =
    [("wide", AccelKind::Wide), ("bvh2", AccelKind::Bvh2), ("bih", AccelKind::Bih), ("kdtree", AccelKind::KdTree)];

const LEVELS: [(&str, Levels); 3] = [("auto", Levels::Auto), ("one", Levels::One), ("two", Levels::Two)];

pub(crate) const PRESETS: [(&str, Preset); 4] = [
    ("dynamic", Preset::Dynamic),
    ("fast", Preset::Fast),
    ("balanced", Preset::Balanced),
    ("quality", Preset::Quality),
];

const BUILDERS: &Names<Option<Builder>> = &[
    ("auto", None),
    ("sah", Some(Builder::Sah)),
    ("sbvh", Some(Builder::Sbvh)),
    ("ploc", Some(Builder::Ploc)),
    ("lbvh", Some(Builder::Lbvh)),
    #[cfg(feature = "baseline")]
    ("obvhs", Some(Builder::Obvhs)),
];

const VOLUMES: [(&str, Volumes); 7] = [
    ("auto", None),
    ("aabb", Some(Strategy::Aabb)),
    ("pca-unbounded", Some(Strategy::PcaUnbounded)),
    ("pca-bounded", Some(Strategy::PcaBounded)),
    ("quaternion", Some(Strategy::Quaternion)),
    ("combined", Some(Strategy::Combined)),
    ("dop", Some(Strategy::Dop)),
];

/// The name of a strategy on the command line.
pub(crate) fn strategy_name(strategy: Strategy) -> &'static str {
    name_of(&VOLUMES, &Some(strategy))
}

impl StructureArgs {
    /// The first option that GPUs do not support, with its value.
    #[cfg(feature = "gpu")]
    pub(crate) fn unsupported_on_gpu(&self) -> Option<String> {
        if self.triangles != TriangleTest::Watertight {
            return Some(format!("--triangles {}", name_of(&TRIANGLE_TESTS, &self.triangles)));
        }
        let accel = self.accel.filter(|accel| matches!(accel, AccelKind::Bih | AccelKind::KdTree));
        if let Some(accel) = accel {
            return Some(format!("--accel {}", name_of(&ACCELS, &accel)));
        }
        // The device builds binary BVHs itself, over a radix tree.
        let is_other = self.is_binary() && !matches!(self.builder, None | Some(Builder::Lbvh));
        is_other.then(|| format!("--builder {} with a binary BVH", name_of(BUILDERS, &self.builder)))
    }

    /// The BVHs that a GPU builds itself; `None` where it takes those of the CPU.
    #[cfg(feature = "gpu")]
    pub(crate) fn built_on_gpu(&self) -> Option<canted_gpu::DeviceBvh> {
        use canted_gpu::build::{BuildConfig, Topology, WideConfig};
        if self.is_binary() {
            let strategy = self.volumes.unwrap_or(Strategy::Aabb);
            return Some(BuildConfig { strategy, ..BuildConfig::default() }.into());
        }
        // The quickest build, and the one whose rays gain from oriented nodes: `benches/TRIED.md`.
        let (topology, strategy) = match self.builder? {
            Builder::Lbvh => (Topology::Radix, Strategy::Aabb),
            Builder::Ploc => (Topology::Ploc, Strategy::Combined),
            _ => return None,
        };
        Some(WideConfig { topology, strategy, ..WideConfig::default() }.into())
    }

    #[cfg(feature = "gpu")]
    fn is_binary(&self) -> bool {
        self.volumes.is_some() || self.accel == Some(AccelKind::Bvh2)
    }

    /// The structure to build for a scene. Warns if it cannot have one level.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub(crate) fn config(&self, scene: &Scene) -> Result<StructureConfig> {
        if self.levels == Levels::One && scene.has_motion() {
            output::warn("--levels one is ignored: moving instances require two levels");
        }
        self.config_quietly()
    }

    /// [`Self::config`] without the warning.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub(crate) fn config_quietly(&self) -> Result<StructureConfig> {
        Ok(StructureConfig { levels: self.levels, accel: self.structure()? })
    }

    fn structure(&self) -> Result<Accel> {
        let &Self { accel, preset, builder, volumes, .. } = self;
        let default = if volumes.is_some() { AccelKind::Bvh2 } else { AccelKind::Wide };
        let kind = accel.unwrap_or(default);
        let name = name_of(&ACCELS, &kind);
        if let Some(strategy) = volumes.filter(|_| kind != AccelKind::Bvh2) {
            bail!("--volumes {} requires --accel bvh2, not {name}", strategy_name(strategy));
        }
        if let Some(builder) = builder.filter(|_| matches!(kind, AccelKind::Bih | AccelKind::KdTree)) {
            bail!("--builder {} requires --accel wide or bvh2, not {name}", name_of(BUILDERS, &Some(builder)));
        }
        Ok(match kind {
            AccelKind::Wide => Accel::Wide { preset, builder },
            AccelKind::Bvh2 => Accel::Binary { strategy: volumes.unwrap_or(Strategy::Aabb), builder },
            AccelKind::Bih => Accel::Bih,
            AccelKind::KdTree => Accel::KdTree,
        })
    }
}

/// A ray-triangle test; [`with_kernel`] makes it a type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TriangleTest {
    Watertight,
    MollerTrumbore,
    BaldwinWeber,
}

pub(crate) const TRIANGLE_TESTS: [(&str, TriangleTest); 3] = [
    ("watertight", TriangleTest::Watertight),
    ("moller-trumbore", TriangleTest::MollerTrumbore),
    ("baldwin-weber", TriangleTest::BaldwinWeber),
];

/// Calls `$run::<K>($args…)` with the kernel of a [`TriangleTest`].
macro_rules! with_kernel {
    ($triangles:expr, $run:ident($($args:expr),*)) => {
        match $triangles {
            $crate::options::TriangleTest::Watertight => $run::<canted_trace::Watertight>($($args),*),
            $crate::options::TriangleTest::MollerTrumbore => $run::<canted_trace::MollerTrumbore>($($args),*),
            $crate::options::TriangleTest::BaldwinWeber => $run::<canted_trace::BaldwinWeber>($($args),*),
        }
    };
}
pub(crate) use with_kernel;

/// Sets the number of threads of the global pool; `None` for all processors.
pub(crate) fn use_threads(n_threads: Option<usize>) -> anyhow::Result<()> {
    let n = n_threads.unwrap_or(0);
    rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build_global()
        .map_err(|error| anyhow::anyhow!("cannot start {n} threads: {error}"))
}
