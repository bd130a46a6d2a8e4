//! Options: what their values are, as text and as types; structs of options, which are set, merged and written by the names of their
//! fields; the options of the acceleration structure.
//!
//! An option is a field of a struct that derives `clap::Args`, `Serialize` and `Deserialize`. Its type, an `Option` of a [`Value`], says how
//! its text is read and written: on the command line, in scene files, in commands that `canted view` prints.

use std::fmt::{self, Debug};

use anyhow::{Result, anyhow, bail};
use canted_film::{Aov, Filter, ToneMap};
use canted_lbvh::Strategy;
use canted_renderer::{
    BoxLevel, Builder, BvhKind, Cull, FirstHit, Hemisphere, Integrator, Levels, Lod, Measure, Pattern, SampleSums,
    SceneBvhConfig, UpdatePolicy,
};
use canted_scene::{Scene, suggestion};
use canted_trace::TriangleTest;
use canted_wide::Preset;
use clap::{
    ArgAction, ArgMatches, Args, Command, FromArgMatches, Id,
    builder::{PossibleValuesParser, TypedValueParser, ValueParser, ValueParserFactory},
    parser::ValueSource,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::DeserializeOwned, de::Error as _};
use serde_json::json;

use crate::output;

/// The value of an option, in the form `F`.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Value<F: Form>(pub(crate) F::Value);

impl<F: Form> Debug for Value<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The form of an option: which values it has, and their text.
pub(crate) trait Form: Clone + Debug + PartialEq + Send + Sync + 'static {
    /// A value.
    type Value: Text + Clone + Debug + PartialEq + Send + Sync + 'static;

    /// The names of all values, if they have names.
    fn names() -> Vec<&'static str> {
        Vec::new()
    }

    /// The value of a text.
    fn parse(text: &str) -> Result<Self::Value, String>;
}

/// A value as it stands on the command line and in scene files.
pub(crate) trait Text {
    /// The text.
    fn text(&self) -> String;
}

impl<F: Form> ValueParserFactory for Value<F> {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        let parse = |text: &str| F::parse(text).map(Self);
        match F::names() {
            names if names.is_empty() => ValueParser::new(parse),
            names => ValueParser::new(PossibleValuesParser::new(names).try_map(move |name| parse(&name))),
        }
    }
}

impl<F: Form> Serialize for Value<F> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0.text())
    }
}

impl<'de, F: Form> Deserialize<'de> for Value<F> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        F::parse(&String::deserialize(deserializer)?).map(Self).map_err(D::Error::custom)
    }
}

/// A type whose values have names.
pub(crate) trait Named: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// All of them.
    fn all() -> Vec<Self>;

    /// The name of this value.
    fn name(self) -> &'static str;
}

impl<T: Named> Text for T {
    fn text(&self) -> String {
        self.name().to_owned()
    }
}

impl<T: Named> Form for T {
    type Value = T;

    fn names() -> Vec<&'static str> {
        T::all().into_iter().map(T::name).collect()
    }

    fn parse(text: &str) -> Result<T, String> {
        T::all().into_iter().find(|value| value.name() == text).ok_or_else(|| {
            let names = <T as Form>::names();
            format!("expected one of {}{}", names.join(", "), suggestion(text, names.iter().copied()))
        })
    }
}

/// Types that list and name their values themselves.
macro_rules! named {
    ($($name:ident)*) => {
        $(impl Named for $name {
            fn all() -> Vec<Self> {
                <$name>::ALL.to_vec()
            }

            fn name(self) -> &'static str {
                <$name>::name(self)
            }
        })*
    };
}

named! {
    Aov Builder BvhKind Cull Filter FirstHit Hemisphere Integrator Levels Lod Measure Pattern Preset SampleSums Strategy ToneMap TriangleTest UpdatePolicy
}

impl Named for bool {
    fn all() -> Vec<Self> {
        vec![true, false]
    }

    fn name(self) -> &'static str {
        if self { "on" } else { "off" }
    }
}

/// A value, or `auto` where something else chooses it.
impl<T: Named> Named for Option<T> {
    fn all() -> Vec<Self> {
        std::iter::once(None).chain(T::all().into_iter().map(Some)).collect()
    }

    fn name(self) -> &'static str {
        self.map_or("auto", T::name)
    }
}

/// A parser of one value by its name.
pub(crate) fn one_of<T: Copy + Send + Sync>(names: &'static [(&'static str, T)]) -> impl TypedValueParser<Value = T> {
    let value = |name: String| names.iter().find(|(known, _)| *known == name).map(|&(_, value)| value);
    PossibleValuesParser::new(names.iter().map(|(name, _)| *name))
        .try_map(move |name| value(name).ok_or("unknown name"))
}

/// A parser of the values of a type by their names.
pub(crate) fn named<T: Named>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(<T as Form>::names()).try_map(|name| <T as Form>::parse(&name))
}

/// Forms of numbers.
macro_rules! numbers {
    ($($name:ident: $expected:literal, $is_valid:expr;)*) => {
        $(#[doc = concat!("`", $expected, "`.")]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub(crate) enum $name {}

        impl Form for $name {
            type Value = f32;

            fn parse(text: &str) -> Result<f32, String> {
                let is_valid: fn(&f32) -> bool = $is_valid;
                text.trim().parse().ok().filter(is_valid).ok_or_else(|| format!("'{text}' is not {}", $expected))
            }
        })*
    };
}

numbers! {
    Finite: "a finite number", |x| x.is_finite();
    NotNegative: "a finite number of at least 0", |x| *x >= 0.0 && x.is_finite();
    Positive: "a finite number greater than zero", |x| *x > 0.0 && x.is_finite();
    Length: "a length greater than zero", |x| *x > 0.0;
    Fov: "an angle between 0 and 180 degrees", |x| *x > 0.0 && *x < 180.0;
}

impl Text for f32 {
    fn text(&self) -> String {
        self.to_string()
    }
}

/// `N` finite numbers separated by commas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Numbers<const N: usize> {}

impl<const N: usize> Form for Numbers<N> {
    type Value = [f32; N];

    fn parse(text: &str) -> Result<[f32; N], String> {
        let parts: Vec<&str> = text.split(',').collect();
        if parts.len() != N {
            return Err(format!("expected {N} numbers separated by commas, found {}", parts.len()));
        }
        let mut numbers = [0.0; N];
        for (number, part) in numbers.iter_mut().zip(parts) {
            *number = Finite::parse(part)?;
        }
        Ok(numbers)
    }
}

impl<const N: usize> Text for [f32; N] {
    fn text(&self) -> String {
        self.map(|x| x.to_string()).join(",")
    }
}

/// A whole number from `FIRST` to `LAST`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Whole<const FIRST: u32, const LAST: u32> {}

impl<const FIRST: u32, const LAST: u32> Form for Whole<FIRST, LAST> {
    type Value = u32;

    fn parse(text: &str) -> Result<u32, String> {
        use std::num::IntErrorKind::{Empty, InvalidDigit};
        let n: i64 = text.parse().map_err(|error: std::num::ParseIntError| match error.kind() {
            InvalidDigit | Empty => "expected a whole number".to_owned(),
            _ => error.to_string(),
        })?;
        let n = u32::try_from(n).ok().filter(|n| (FIRST..=LAST).contains(n));
        n.ok_or_else(|| format!("{text} is not in {FIRST}..={LAST}"))
    }
}

impl Text for u32 {
    fn text(&self) -> String {
        self.to_string()
    }
}

/// Width and height in pixels, as `WxH`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Size {}

impl Form for Size {
    type Value = [u32; 2];

    fn parse(text: &str) -> Result<[u32; 2], String> {
        /// More would not fit in the memory of ordinary machines.
        const MAX_PIXELS: u64 = 1 << 26;
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
}

impl Text for [u32; 2] {
    fn text(&self) -> String {
        format!("{}x{}", self[0], self[1])
    }
}

impl Form for BoxLevel {
    type Value = Self;

    fn parse(text: &str) -> Result<Self, String> {
        text.parse()
    }
}

impl Text for BoxLevel {
    fn text(&self) -> String {
        self.to_string()
    }
}

/// A number of bytes, with K, M, G or T for powers of 1024.
pub(crate) enum Bytes {}

impl Bytes {
    pub(crate) fn parse(text: &str) -> Result<u64, String> {
        let trimmed = text.trim().trim_end_matches(['b', 'B']).trim_end_matches('i');
        let (digits, shift) = match trimmed.char_indices().last() {
            Some((at, unit)) if !unit.is_ascii_digit() => {
                let power = ['k', 'm', 'g', 't'].iter().position(|known| unit.to_ascii_lowercase() == *known);
                (&trimmed[..at], power.map(|power| 10 * (power + 1)))
            }
            _ => (trimmed, Some(0)),
        };
        let number = digits.trim().parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
        let bytes = number.zip(shift).map(|(number, shift)| number * (1_u64 << shift) as f64);
        let bytes = bytes.filter(|bytes| *bytes < (1_u64 << 60) as f64 && *bytes >= 1.0);
        bytes.map(|bytes| bytes as u64).ok_or_else(|| format!("'{text}' is not a number of bytes, such as 500M or 2G"))
    }
}

/// A number of threads from 1 to 1024.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    let n = text.parse().ok().filter(|n| (1..=1024).contains(n));
    n.ok_or_else(|| format!("'{text}' is not a number of threads from 1 to 1024"))
}

/// The options of a struct that are set: their texts by name.
fn table<A: Serialize>(options: &A) -> serde_json::Map<String, serde_json::Value> {
    let mut table = match json!(options) {
        serde_json::Value::Object(table) => table,
        other => unreachable!("options are a table, not {other}"),
    };
    table.retain(|_, value| !value.is_null() && *value != json!([]));
    table
}

fn from_table<A: DeserializeOwned>(table: serde_json::Map<String, serde_json::Value>) -> Result<A, serde_json::Error> {
    serde_json::from_value(serde_json::Value::Object(table))
}

/// Options, and others for those that are not set.
pub(crate) fn or<A: Serialize + DeserializeOwned>(options: &A, others: &A) -> A {
    let mut all = table(others);
    all.extend(table(options));
    from_table(all).expect("every option reads what it writes")
}

/// Options after changes by name, with `_` or `-` between words; an empty text unsets an option.
///
/// # Errors
/// One sentence: an unknown option, or an invalid value.
pub(crate) fn changed<A: Args + Serialize + DeserializeOwned>(options: &A, changes: &[(String, String)]) -> Result<A> {
    let command = A::augment_args(Command::new("canted"));
    let known: Vec<&str> = command.get_opts().map(|arg| arg.get_id().as_str()).collect();
    let mut table = table(options);
    for (name, text) in changes {
        let id = known_name(name, &known)?;
        table.remove(&id);
        if text.is_empty() {
            continue;
        }
        let is_repeatable =
            command.get_opts().any(|arg| *arg.get_id() == id && matches!(arg.get_action(), ArgAction::Append));
        table.insert(id.clone(), if is_repeatable { json!([text]) } else { json!(text) });
        from_table::<A>(table.clone())
            .map_err(|error| anyhow!("invalid value '{text}' for '{}': {error}", flag(&id)))?;
    }
    Ok(from_table(table)?)
}

/// The name of an option with `_` between words, if it is among those that are known.
pub(crate) fn known_name(name: &str, known: &[&str]) -> Result<String> {
    let id = name.replace('-', "_");
    if known.contains(&&id[..]) {
        return Ok(id);
    }
    Err(anyhow!("unknown option '{}'{}", name.escape_debug(), suggestion(&id, known.iter().copied())))
}

/// The names and texts of the options of a struct that are set, in the order of its fields.
pub(crate) fn given<A: Args + Serialize>(options: &A) -> Vec<(String, String)> {
    let table = table(options);
    let texts = |name: &String| match table.get(name) {
        None => Vec::new(),
        Some(serde_json::Value::Array(all)) => all.clone(),
        Some(text) => vec![text.clone()],
    };
    let text = |value: serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let of = |name: String| texts(&name).into_iter().map(move |value| (name.clone(), text(value)));
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
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
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

/// Options of the acceleration structure.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = "Acceleration structure", next_display_order = 110)]
#[serde(default)]
pub(crate) struct StructureOptions {
    /// BVH levels. `auto` uses two levels where one would copy many triangles or is predicted to cost rays much more, else one.
    #[arg(long, default_value = "auto", value_name = "LEVELS")]
    levels: Option<Value<Levels>>,
    /// Acceleration structure: eight-wide BVH, binary BVH, bounding interval hierarchy or kd-tree [default: wide, or bvh2 with --volumes
    /// NAME].
    #[arg(long, value_name = "STRUCTURE")]
    pub(crate) accel: Option<Value<BvhKind>>,
    /// Build effort of the wide BVH. `quality` builds slowest and traces fastest.
    #[arg(long, default_value = "balanced", value_name = "PRESET")]
    preset: Option<Value<Preset>>,
    /// Builder of the binary tree that becomes the BVH. `auto` is the builder of the preset; with --volumes it is `ploc` on the CPU and `lbvh` on
    /// a GPU. `sbvh` is `sah` with spatial splits, `hlbvh` is `lbvh` below a top by `sah`, `midpoint` and `median` split the longest axis. A GPU builds its BVHs itself with --volumes, `lbvh` and `ploc`; else the CPU does.
    #[arg(long, default_value = "auto", value_name = "BUILDER")]
    builder: Option<Value<Option<Builder>>>,
    /// Bounding volumes. `auto` builds a wide BVH of axis-aligned and oriented nodes, or with --accel bvh2 axis-aligned boxes; the others
    /// build a binary BVH.
    #[arg(long, default_value = "auto", value_name = "VOLUMES")]
    pub(crate) volumes: Option<Value<Option<Strategy>>>,
    /// Builds the wide BVH of axis-aligned nodes alone: without oriented nodes, and without a frame of the mesh.
    #[arg(long, num_args = 0..=1, require_equals = true, default_value = "off", default_missing_value = "on",
        value_name = "on|off")]
    aligned: Option<Value<bool>>,
    /// Ray-triangle intersection test.
    #[arg(long, default_value = "watertight", value_name = "TEST")]
    triangles: Option<Value<TriangleTest>>,
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
    /// Settings of a file without those that options replace: a structure on the command line replaces that of the file.
    pub(crate) fn without_replaced(mut self, given: &Self) -> Self {
        if let Some(Value(accel)) = given.accel {
            self.volumes = self.volumes.filter(|_| accel == BvhKind::Bvh2);
            self.builder = self.builder.filter(|_| accel.has_builders());
        }
        if given.volumes.is_some() {
            self.accel = self.accel.filter(|accel| accel.0 == BvhKind::Bvh2);
        }
        self
    }

    /// The structure to trace, and the bounding volumes that are given.
    pub(crate) fn kind(&self) -> (BvhKind, Option<Strategy>) {
        let volumes = self.volumes.and_then(|volumes| volumes.0);
        let usual = if volumes.is_some() { BvhKind::Bvh2 } else { BvhKind::Wide };
        (self.accel.map_or(usual, |accel| accel.0), volumes)
    }

    /// Sets the structure to trace, and its bounding volumes.
    pub(crate) fn set_kind(&mut self, (kind, volumes): (BvhKind, Option<Strategy>)) {
        (self.accel, self.volumes) = (Some(Value(kind)), volumes.map(|volumes| Value(Some(volumes))));
    }

    /// Warns about a preset among the options of the command line, which is for wide BVHs, together with another structure.
    pub(crate) fn warn_ignored_preset(&self, given: &Self) {
        match self.kind() {
            _ if given.preset.is_none() => {}
            (kind, _) if given.accel.is_some() && kind != BvhKind::Wide => {
                output::warn(&format!("--preset has no effect on --accel {}", kind.name()));
            }
            (_, Some(volumes)) => {
                output::warn(&format!("--preset has no effect on the binary BVH of --volumes {}", volumes.name()))
            }
            _ => {}
        }
    }

    /// The structure that they describe.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub(crate) fn resolve(&self) -> Result<Structure> {
        // Without `..`, so that a new option cannot be forgotten.
        let Self { levels, accel: _, preset, builder, volumes: _, aligned, triangles } = *self;
        let ((kind, volumes), builder) = (self.kind(), builder.and_then(|builder| builder.0));
        if let Some(strategy) = volumes.filter(|_| kind != BvhKind::Bvh2) {
            bail!("--volumes {} requires --accel bvh2, not {}", strategy.name(), kind.name());
        }
        if let Some(builder) = builder.filter(|_| !kind.has_builders()) {
            bail!("--builder {} requires --accel wide or bvh2, not {}", builder.name(), kind.name());
        }
        let default = SceneBvhConfig::default();
        let config = SceneBvhConfig {
            levels: levels.map_or(default.levels, |levels| levels.0),
            kind,
            preset: preset.map_or(default.preset, |preset| preset.0),
            builder,
            volumes: volumes.unwrap_or(default.volumes),
            aligned: aligned.is_some_and(|aligned| aligned.0),
            triangles: triangles.map_or(default.triangles, |triangles| triangles.0),
            on_device: default.on_device,
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
            Some(format!("--builder {} with a binary BVH", builder.name()))
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

/// Sets the number of threads of the global pool; `None` for all processors.
pub(crate) fn use_threads(n_threads: Option<usize>) -> anyhow::Result<()> {
    let n = n_threads.unwrap_or(0);
    rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build_global()
        .map_err(|error| anyhow::anyhow!("cannot start {n} threads: {error}"))
}
