//! Values of options, as text and as types, and the options that several subcommands share.

use anyhow::{Result, bail};
use canted_lbvh::Strategy;
use canted_renderer::{Builder, BvhKind, Levels, SceneBvhConfig};
use canted_scene::{Scene, suggestion};
use canted_trace::TriangleTest;
use canted_wide::Preset;
use clap::{
    ArgMatches, Args, Command, FromArgMatches, Id,
    builder::{PossibleValuesParser, TypedValueParser},
    parser::ValueSource,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use crate::output;

/// The values of an option by name.
pub(crate) type Names<T> = [(&'static str, T)];

/// A type whose values have names.
pub(crate) trait Named: Copy + PartialEq + Send + Sync + 'static {
    /// All of them.
    const NAMES: &'static Names<Self>;

    /// The name of this value.
    fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, known)| *known == self).map_or("unknown", |(name, _)| name)
    }
}

/// A parser of one value by its name.
pub(crate) fn one_of<T: Copy + Send + Sync>(names: &'static Names<T>) -> impl TypedValueParser<Value = T> {
    let value = |name: String| names.iter().find(|(known, _)| *known == name).map(|&(_, value)| value);
    PossibleValuesParser::new(names.iter().map(|(name, _)| *name))
        .try_map(move |name| value(name).ok_or("unknown name"))
}

/// A parser of the values of a type by their names.
pub(crate) fn named<T: Named>() -> impl TypedValueParser<Value = T> {
    one_of(T::NAMES)
}

/// A value as it stands on the command line and in scene files.
pub(crate) trait Text {
    /// The text.
    fn text(&self) -> String;
}

impl<T: Named> Text for T {
    fn text(&self) -> String {
        self.name().to_owned()
    }
}

impl Text for u32 {
    fn text(&self) -> String {
        self.to_string()
    }
}

impl Text for f32 {
    fn text(&self) -> String {
        self.to_string()
    }
}

impl Text for String {
    fn text(&self) -> String {
        self.clone()
    }
}

/// A size.
impl Text for [u32; 2] {
    fn text(&self) -> String {
        format!("{}x{}", self[0], self[1])
    }
}

impl<const N: usize> Text for [f32; N] {
    fn text(&self) -> String {
        self.map(|x| x.to_string()).join(",")
    }
}

/// Serializes an option as text.
pub(crate) fn as_text<T: Text, S: Serializer>(value: &Option<T>, serializer: S) -> Result<S::Ok, S::Error> {
    value.as_ref().map(Text::text).serialize(serializer)
}

/// Serializes the values of an option that may be repeated as texts.
pub(crate) fn as_texts<T: Text, S: Serializer>(values: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    let texts: Vec<String> = values.iter().map(Text::text).collect();
    if texts.is_empty() { serializer.serialize_none() } else { texts.serialize(serializer) }
}

/// Deserializes an option from its text.
pub(crate) fn from_text<'de, D, T>(deserializer: D, parse: fn(&str) -> Result<T, String>) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
{
    parse(&String::deserialize(deserializer)?).map(Some).map_err(D::Error::custom)
}

/// Deserializes an option from the name of its value.
pub(crate) fn from_name<'de, D: Deserializer<'de>, T: Named>(deserializer: D) -> Result<Option<T>, D::Error> {
    from_text(deserializer, |text| {
        let found = T::NAMES.iter().find(|(name, _)| *name == text).map(|&(_, value)| value);
        found.ok_or_else(|| {
            let names: Vec<&str> = T::NAMES.iter().map(|(name, _)| *name).collect();
            format!("expected one of {}{}", names.join(", "), suggestion(text, names.iter().copied()))
        })
    })
}

/// The names and texts of the options of a struct that are set, in the order of its fields.
pub(crate) fn given<A: Args + Serialize>(options: &A) -> Vec<(String, String)> {
    let texts = serde_json::to_value(options).unwrap_or_default();
    let of = |name: String| {
        let all = match &texts[&name] {
            serde_json::Value::String(text) => vec![text.clone()],
            serde_json::Value::Array(all) => all.iter().filter_map(|text| Some(text.as_str()?.to_owned())).collect(),
            _ => Vec::new(),
        };
        all.into_iter().map(move |text| (name.clone(), text))
    };
    names::<A>().into_iter().flat_map(of).collect()
}

/// The names of the options of a struct.
pub(crate) fn names<A: Args>() -> Vec<String> {
    let command = A::augment_args(Command::new("canted"));
    command.get_arguments().map(|arg| arg.get_id().to_string()).collect()
}

/// The name of an option on the command line.
pub(crate) fn flag(name: &str) -> String {
    format!("--{}", name.replace('_', "-"))
}

/// The options of a command with their default values.
pub(crate) fn defaults<A: Args>() -> A {
    let command = A::augment_args(Command::new("canted").no_binary_name(true));
    A::from_arg_matches(&command.get_matches_from([""; 0])).unwrap_or_else(|error| error.exit())
}

/// Options of which only those on the command line are set: default values are for the help, so that a scene file can set the others.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub(crate) struct Given<A>(pub(crate) A);

impl<A: Args> Args for Given<A> {
    fn group_id() -> Option<Id> {
        A::group_id()
    }

    fn augment_args(command: Command) -> Command {
        A::augment_args(command)
    }

    fn augment_args_for_update(command: Command) -> Command {
        A::augment_args_for_update(command)
    }
}

impl<A: Args> FromArgMatches for Given<A> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut matches = matches.clone();
        for name in names::<A>() {
            if matches.value_source(&name) == Some(ValueSource::DefaultValue) {
                let _ = matches.try_clear_id(&name);
            }
        }
        A::from_arg_matches(&matches).map(Self)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// `N` finite numbers separated by commas.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != N {
        return Err(format!("expected {N} numbers separated by commas, found {}", parts.len()));
    }
    let mut numbers = [0.0; N];
    for (number, part) in numbers.iter_mut().zip(parts) {
        *number = self::number(part)?;
    }
    Ok(numbers)
}

/// A finite number.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    number_where(text, f32::is_finite).ok_or_else(|| format!("'{text}' is not a finite number"))
}

/// A finite number that is not negative.
pub(crate) fn factor(text: &str) -> Result<f32, String> {
    number_where(text, |x| x >= 0.0 && x.is_finite())
        .ok_or_else(|| format!("'{text}' is not a finite number of at least 0"))
}

/// An angle in degrees, in the open interval (0, 180).
pub(crate) fn fov(text: &str) -> Result<f32, String> {
    number_where(text, |x| x > 0.0 && x < 180.0)
        .ok_or_else(|| format!("'{text}' is not an angle between 0 and 180 degrees"))
}

/// A positive length, possibly infinite.
pub(crate) fn radius(text: &str) -> Result<f32, String> {
    number_where(text, |x| x > 0.0).ok_or_else(|| format!("'{text}' is not a length greater than zero"))
}

/// A positive finite number.
pub(crate) fn noise(text: &str) -> Result<f32, String> {
    number_where(text, |x| x > 0.0 && x.is_finite())
        .ok_or_else(|| format!("'{text}' is not a finite number greater than zero"))
}

fn number_where(text: &str, is_valid: impl Fn(f32) -> bool) -> Option<f32> {
    text.trim().parse().ok().filter(|&x| is_valid(x))
}

/// The largest picture in pixels. More would not fit in the memory of ordinary machines.
const MAX_PIXELS: u64 = 1 << 26;

/// Width and height as `WxH`.
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT, e.g. 1280x720")?;
    let side = |text: &str| match text.trim().parse::<u32>() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("'{text}' is not a positive number of pixels")),
    };
    let size = [side(width)?, side(height)?];
    if u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS {
        return Err(format!("{} x {} pixels exceed the limit of {MAX_PIXELS}", size[0], size[1]));
    }
    Ok(size)
}

/// A whole number in a range.
pub(crate) fn whole(text: &str, range: std::ops::RangeInclusive<u32>) -> Result<u32, String> {
    use std::num::IntErrorKind::{Empty, InvalidDigit};
    let n: i64 = text.parse().map_err(|error: std::num::ParseIntError| match error.kind() {
        InvalidDigit | Empty => "expected a whole number".to_owned(),
        _ => error.to_string(),
    })?;
    let (first, last) = (range.start(), range.end());
    let n = u32::try_from(n).ok().filter(|n| range.contains(n));
    n.ok_or_else(|| format!("{text} is not in {first}..={last}"))
}

/// A number of threads from 1 to 1024.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    let n = text.parse().ok().filter(|n| (1..=1024).contains(n));
    n.ok_or_else(|| format!("'{text}' is not a number of threads from 1 to 1024"))
}

/// Bounding volumes of a binary BVH; `None` for a wide BVH. An alias, because clap treats `Option` as a missing option.
type Volumes = Option<Strategy>;

/// A builder; `None` for the one that the structure chooses. An alias as [`Volumes`].
type BuilderChoice = Option<Builder>;

/// Options of the acceleration structure.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = "Acceleration structure", next_display_order = 110)]
#[serde(default)]
pub(crate) struct StructureOptions {
    /// BVH levels. `auto` uses two levels where instancing saves memory, else one.
    #[arg(long, default_value = "auto", value_parser = named::<Levels>(), value_name = "LEVELS")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    levels: Option<Levels>,
    /// Acceleration structure: eight-wide BVH, binary BVH, bounding interval hierarchy or kd-tree [default: wide, or bvh2 with --volumes
    /// NAME].
    #[arg(long, value_parser = named::<BvhKind>(), value_name = "STRUCTURE")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    pub(crate) accel: Option<BvhKind>,
    /// Build effort of the wide BVH. `quality` builds slowest and traces fastest.
    #[arg(long, default_value = "balanced", value_parser = named::<Preset>(), value_name = "PRESET")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    preset: Option<Preset>,
    /// Builder of the binary tree that becomes the BVH. `auto` is the builder of the preset; with --volumes it is `ploc` on the CPU and `lbvh` on
    /// a GPU. `sbvh` is `sah` with spatial splits. A GPU builds its BVHs itself with --volumes, `lbvh` and `ploc`; else the CPU does.
    #[arg(long, default_value = "auto", value_parser = named::<BuilderChoice>(), value_name = "BUILDER")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    builder: Option<BuilderChoice>,
    /// Bounding volumes. `auto` builds a wide BVH of axis-aligned and oriented nodes, or with --accel bvh2 axis-aligned boxes; the others
    /// build a binary BVH.
    #[arg(long, default_value = "auto", value_parser = named::<Volumes>(), value_name = "VOLUMES")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    pub(crate) volumes: Option<Volumes>,
    /// Builds the wide BVH of axis-aligned nodes alone: without oriented nodes, and without a frame of the mesh.
    #[arg(long, num_args = 0..=1, require_equals = true, default_value = "off", default_missing_value = "on", value_parser = named::<bool>(),
        value_name = "on|off")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    aligned: Option<bool>,
    /// Ray-triangle intersection test.
    #[arg(long, default_value = "watertight", value_parser = named::<TriangleTest>(), value_name = "TEST")]
    #[serde(serialize_with = "as_text", deserialize_with = "from_name")]
    triangles: Option<TriangleTest>,
}

impl Named for BvhKind {
    const NAMES: &'static Names<Self> =
        &[("wide", Self::Wide), ("bvh2", Self::Bvh2), ("bih", Self::Bih), ("kdtree", Self::KdTree)];
}

impl Named for Levels {
    const NAMES: &'static Names<Self> = &[("auto", Self::Auto), ("one", Self::One), ("two", Self::Two)];
}

impl Named for Preset {
    const NAMES: &'static Names<Self> =
        &[("dynamic", Self::Dynamic), ("fast", Self::Fast), ("balanced", Self::Balanced), ("quality", Self::Quality)];
}

impl Named for BuilderChoice {
    const NAMES: &'static Names<Self> = &[
        ("auto", None),
        ("sah", Some(Builder::Sah)),
        ("sbvh", Some(Builder::Sbvh)),
        ("ploc", Some(Builder::Ploc)),
        ("lbvh", Some(Builder::Lbvh)),
        #[cfg(feature = "baseline")]
        ("obvhs", Some(Builder::Obvhs)),
    ];
}

impl Named for Volumes {
    const NAMES: &'static Names<Self> = &[
        ("auto", None),
        ("aabb", Some(Strategy::Aabb)),
        ("pca-unbounded", Some(Strategy::PcaUnbounded)),
        ("pca-bounded", Some(Strategy::PcaBounded)),
        ("quaternion", Some(Strategy::Quaternion)),
        ("combined", Some(Strategy::Combined)),
        ("dop", Some(Strategy::Dop)),
    ];
}

/// The name of a strategy on the command line.
pub(crate) fn strategy_name(strategy: Strategy) -> &'static str {
    Some(strategy).name()
}

/// The acceleration structure of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Structure {
    pub(crate) config: SceneBvhConfig,
    /// The first option that GPUs do not support, with its value.
    #[cfg(feature = "gpu")]
    pub(crate) unsupported_on_gpu: Option<String>,
    /// The BVHs that a GPU builds itself; `None` where it takes those of the CPU.
    #[cfg(feature = "gpu")]
    pub(crate) built_on_gpu: Option<canted_gpu::DeviceBvh>,
}

impl Structure {
    /// The structure to build for a scene. Warns if it cannot have one level.
    pub(crate) fn config_for(&self, scene: &Scene) -> SceneBvhConfig {
        if self.config.levels == Levels::One && scene.has_motion() {
            output::warn("--levels one is ignored: moving instances require two levels");
        }
        self.config
    }
}

impl StructureOptions {
    /// These options, and others for those that are not set.
    pub(crate) fn or(self, other: Self) -> Self {
        let Self { levels, accel, preset, builder, volumes, aligned, triangles } = self;
        Self {
            levels: levels.or(other.levels),
            accel: accel.or(other.accel),
            preset: preset.or(other.preset),
            builder: builder.or(other.builder),
            volumes: volumes.or(other.volumes),
            aligned: aligned.or(other.aligned),
            triangles: triangles.or(other.triangles),
        }
    }

    /// Settings of a file without those that options replace: a structure on the command line replaces that of the file.
    pub(crate) fn without_replaced(mut self, given: &Self) -> Self {
        if let Some(accel) = given.accel {
            self.volumes = self.volumes.filter(|_| accel == BvhKind::Bvh2);
            self.builder = self.builder.filter(|_| matches!(accel, BvhKind::Wide | BvhKind::Bvh2));
        }
        if given.volumes.is_some() {
            self.accel = self.accel.filter(|accel| *accel == BvhKind::Bvh2);
        }
        self
    }

    /// Warns about a preset among the options of the command line, which is for wide BVHs, together with another structure.
    pub(crate) fn warn_ignored_preset(&self, given: &Self) {
        match (self.accel, self.volumes.flatten()) {
            _ if given.preset.is_none() => {}
            (Some(accel), _) if given.accel.is_some() && accel != BvhKind::Wide => {
                output::warn(&format!("--preset has no effect on --accel {}", accel.name()));
            }
            (_, Some(volumes)) => output::warn(&format!(
                "--preset has no effect on the binary BVH of --volumes {}",
                strategy_name(volumes)
            )),
            _ => {}
        }
    }

    /// The structure that they describe.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub(crate) fn resolve(&self) -> Result<Structure> {
        let (builder, volumes) = (self.builder.flatten(), self.volumes.flatten());
        let kind = self.accel.unwrap_or(if volumes.is_some() { BvhKind::Bvh2 } else { BvhKind::Wide });
        if let Some(strategy) = volumes.filter(|_| kind != BvhKind::Bvh2) {
            bail!("--volumes {} requires --accel bvh2, not {}", strategy_name(strategy), kind.name());
        }
        if let Some(builder) = builder.filter(|_| matches!(kind, BvhKind::Bih | BvhKind::KdTree)) {
            bail!("--builder {} requires --accel wide or bvh2, not {}", Some(builder).name(), kind.name());
        }
        let config = SceneBvhConfig {
            levels: self.levels.unwrap_or_default(),
            kind,
            preset: self.preset.unwrap_or(Preset::Balanced),
            builder,
            volumes: volumes.unwrap_or(Strategy::Aabb),
            aligned: self.aligned.unwrap_or_default(),
            triangles: self.triangles.unwrap_or_default(),
        };
        if config.aligned && kind != BvhKind::Wide {
            bail!("--aligned requires --accel wide, not {}", kind.name());
        }
        Ok(Structure {
            config,
            #[cfg(feature = "gpu")]
            unsupported_on_gpu: unsupported_on_gpu(&config),
            #[cfg(feature = "gpu")]
            built_on_gpu: built_on_gpu(&config),
        })
    }
}

#[cfg(feature = "gpu")]
fn unsupported_on_gpu(config: &SceneBvhConfig) -> Option<String> {
    if config.triangles != TriangleTest::Watertight {
        return Some(format!("--triangles {}", config.triangles.name()));
    }
    match (config.kind, config.builder) {
        (BvhKind::Bih | BvhKind::KdTree, _) => Some(format!("--accel {}", config.kind.name())),
        // The device builds binary BVHs itself, over a radix tree.
        (BvhKind::Bvh2, Some(builder)) if builder != Builder::Lbvh => {
            Some(format!("--builder {} with a binary BVH", Some(builder).name()))
        }
        (BvhKind::Wide | BvhKind::Bvh2, _) => None,
    }
}

#[cfg(feature = "gpu")]
fn built_on_gpu(config: &SceneBvhConfig) -> Option<canted_gpu::DeviceBvh> {
    use canted_gpu::build::{BuildConfig, Topology, WideConfig};
    // The quickest build, and the one whose rays gain from oriented nodes: `benches/TRIED.md`.
    let (topology, strategy) = match (config.kind, config.builder) {
        (BvhKind::Bvh2, _) => {
            return Some(BuildConfig { strategy: config.volumes, ..BuildConfig::default() }.into());
        }
        (BvhKind::Wide, Some(Builder::Lbvh)) => (Topology::Radix, Strategy::Aabb),
        (BvhKind::Wide, Some(Builder::Ploc)) if config.aligned => (Topology::Ploc, Strategy::Aabb),
        (BvhKind::Wide, Some(Builder::Ploc)) => (Topology::Ploc, Strategy::Combined),
        _ => return None,
    };
    Some(WideConfig { topology, strategy, ..WideConfig::default() }.into())
}

impl Named for TriangleTest {
    const NAMES: &'static Names<Self> = &[
        ("watertight", Self::Watertight),
        ("moller-trumbore", Self::MollerTrumbore),
        ("baldwin-weber", Self::BaldwinWeber),
    ];
}

/// Sets the number of threads of the global pool; `None` for all processors.
pub(crate) fn use_threads(n_threads: Option<usize>) -> anyhow::Result<()> {
    let n = n_threads.unwrap_or(0);
    rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build_global()
        .map_err(|error| anyhow::anyhow!("cannot start {n} threads: {error}"))
}
