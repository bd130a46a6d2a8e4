//! Settings of scene files: the options of `canted render` that determine the picture, under their long names.
//!
//! Every option is a setting except the few listed here, so a new option needs no further code. Settings are inserted
//! before the options of the command line, which therefore override them.

use std::{
    ffi::OsString,
    num::{IntErrorKind, ParseIntError},
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::Format;
use canted_scene::{Setting, suggestion};
use clap::{
    ArgMatches, Args as _, Command,
    error::{ContextKind, ContextValue},
    parser::ValueSource,
};

use crate::{load, output, render, words::Words};

/// Options about a run: its files, devices and reports.
const RUN_OPTIONS: [&str; 24] = [
    "scene",
    "output",
    "crop",
    "preview",
    "denoise",
    "seconds",
    "format",
    "samples",
    "aovs",
    "checkpoint",
    "checkpoint_every",
    "heatmap",
    "heatmap_scale",
    "boxes",
    "device",
    "sums",
    "threads",
    "json",
    "frames",
    "fps",
    "shutter",
    "turntable",
    "resume",
    "update",
];

/// Options that have their own table in a scene file.
const OPTIONS_WITH_TABLE: [(&str, &str); 17] = [
    ("eye", "[camera]"),
    ("target", "[camera]"),
    ("up", "[camera]"),
    ("fov", "[camera]"),
    ("ortho", "[camera]"),
    ("camera", "[camera]"),
    ("aperture", "[camera]"),
    ("focus", "[camera]"),
    ("env", "[environment]"),
    ("env_turn", "[environment]"),
    ("env_scale", "[environment]"),
    ("sun", "[[lights]]"),
    ("point", "[[lights]]"),
    ("sphere", "[[lights]]"),
    ("time", "[[assets]]"),
    ("animation", "[[assets]]"),
    ("variant", "[[assets]]"),
];

/// Options without effect on a heat map, which shows camera rays through the center of the lens.
const IGNORED_BY_HEATMAP: [&str; 19] = [
    "spp",
    "sampler",
    "seed",
    "filter",
    "lod",
    "integrator",
    "bounces",
    "energy_compensation",
    "first_hit",
    "sums",
    "ao_radius",
    "env",
    "env_turn",
    "env_scale",
    "sun",
    "point",
    "sphere",
    "aperture",
    "focus",
];

pub(crate) fn render_command() -> Command {
    render::Args::augment_args(Command::new("render")).disable_help_flag(true)
}

/// The options that are settings.
fn setting_options(command: &Command) -> impl Iterator<Item = &clap::Arg> {
    let is_setting = |id: &str| !RUN_OPTIONS.contains(&id) && OPTIONS_WITH_TABLE.iter().all(|&(other, _)| other != id);
    command.get_arguments().filter(move |arg| is_setting(arg.get_id().as_str()))
}

/// Rejects settings that are unknown or have an invalid value.
pub(crate) fn check(settings: &[Setting], path: &Path) -> Result<()> {
    let command = render_command();
    for setting in settings {
        check_one(setting, &command).map_err(|error| anyhow!("{}: line {}: {error}", path.display(), setting.line))?;
    }
    Ok(())
}

fn check_one(Setting { key, value, .. }: &Setting, command: &Command) -> Result<(), String> {
    if let Some((_, table)) = OPTIONS_WITH_TABLE.iter().find(|(other, _)| other == key) {
        return Err(format!("'{key}' is not a key of [settings]; set it in {table}"));
    }
    let names: Vec<&str> = setting_options(command).map(|arg| arg.get_id().as_str()).collect();
    if !names.contains(&&key[..]) {
        return Err(format!("unknown key '{}' in [settings]{}", key.escape_debug(), suggestion(key, names)));
    }
    let Some(value) = value else { return Ok(()) };
    let parsed = command.clone().try_get_matches_from(["render".into(), option(key, value)]);
    let invalid = |error| format!("invalid value {value:?} for '{key}' in [settings]{}", reason(&error, value));
    parsed.map(drop).map_err(invalid)
}

/// A setting as an option.
pub(crate) fn option(key: &str, value: &str) -> OsString {
    format!("{}={value}", flag(key)).into()
}

/// The name of an option on the command line.
fn flag(id: &str) -> String {
    format!("--{}", id.replace('_', "-"))
}

/// The reason of a parser's error, on one line.
fn reason(error: &clap::Error, value: &str) -> String {
    if let Some(ContextValue::Strings(words)) = error.get(ContextKind::ValidValue) {
        let near = suggestion(value, words.iter().map(|word| &word[..]));
        return format!(": expected one of {}{near}", words.join(", "));
    }
    let source = std::error::Error::source(error);
    let kind = source.and_then(|source| source.downcast_ref::<ParseIntError>()).map(ParseIntError::kind);
    if matches!(kind, Some(IntErrorKind::InvalidDigit | IntErrorKind::Empty)) {
        return ": expected a whole number".to_owned();
    }
    let source = source.map(ToString::to_string).unwrap_or_default();
    format!(": {}", source.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// The arguments of the program, after the settings of the scene file that they name.
///
/// # Errors
/// The scene file is unreadable, or has invalid content.
pub(crate) fn command_line(program: &Command, words: &Words) -> Result<ArgMatches> {
    // `-1` is a value and not an option, so that the option it belongs to reports it.
    let allow_negative = |arg: clap::Arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    };
    let program = program.clone().mut_subcommands(|command| command.mut_args(allow_negative));
    let own = program.clone().get_matches_from(words.all());
    let Some((name, options)) = own.subcommand() else { return Ok(own) };
    let path = options.try_get_one::<PathBuf>("scene").ok().flatten().filter(|path| load::is_scene_file(path));
    let mut settings = Vec::new();
    if let Some(path) = path {
        settings = load::scene_file(path)?.settings;
        check(&settings, path)?;
    }
    match name {
        "render" | "scene" => warn_ignored_by_heatmap(options),
        "cast" => settings.clear(),
        _ => return Ok(own),
    }
    warn_ignored_preset(options, &settings);
    if settings.is_empty() {
        return Ok(own);
    }
    let words = words.with(as_options(&settings, options));
    Ok(program.mut_subcommand(name, |command| command.args_override_self(true)).get_matches_from(words))
}

/// The settings that apply together with the options of the command line, as options.
pub(crate) fn as_options(settings: &[Setting], options: &ArgMatches) -> Vec<OsString> {
    let applying = settings.iter().filter(|setting| applies(setting, settings, options));
    applying.filter_map(|setting| Some(option(&setting.key, setting.value.as_deref()?))).collect()
}

/// The options that a picture in memory can have: those that determine it, and its additional channels.
pub(crate) fn is_of_picture(id: &str) -> bool {
    // A film is linear: exposure and tone curve belong to the formats of files.
    id == "aovs" || !RUN_OPTIONS.contains(&id) && !["exposure", "tone_map"].contains(&id)
}

/// Whether an option is on the command line.
pub(crate) fn is_given(options: &ArgMatches, id: &str) -> bool {
    options.value_source(id) == Some(ValueSource::CommandLine)
}

/// Warns once about options that a heat map ignores. Settings of a scene file may be for other pictures.
fn warn_ignored_by_heatmap(options: &ArgMatches) {
    let ignored: Vec<String> = IGNORED_BY_HEATMAP.into_iter().filter(|id| is_given(options, id)).map(flag).collect();
    if is_given(options, "heatmap") && !ignored.is_empty() {
        output::warn(&format!("--heatmap ignores {}", ignored.join(", ")));
    }
}

/// Warns about a preset, which is for wide BVHs, together with another structure.
fn warn_ignored_preset(options: &ArgMatches, settings: &[Setting]) {
    if !is_given(options, "preset") {
        return;
    }
    let volumes = value_of("volumes", options, settings).unwrap_or("auto");
    let accel = value_of("accel", options, settings).unwrap_or("wide");
    if is_given(options, "accel") && accel != "wide" {
        output::warn(&format!("--preset has no effect on --accel {accel}"));
    } else if volumes != "auto" {
        output::warn(&format!("--preset has no effect on the binary BVH of --volumes {volumes}"));
    }
}

/// Whether a setting applies together with the options of the command line, or would contradict them.
fn applies(setting: &Setting, all: &[Setting], options: &ArgMatches) -> bool {
    let is_given = |id: &str| is_given(options, id);
    match &setting.key[..] {
        // Formats that are linear have neither.
        "exposure" | "tone_map" => !is_linear(options),
        "noise" => !is_given("samples") && !is_given("heatmap"),
        // `--samples` determines the number of samples, except for patterns that depend on the total.
        "spp" if is_given("samples") => value_of("sampler", options, all) == Some("stratified"),
        "ao_radius" if is_given("integrator") => value_of("integrator", options, all) == Some("hybrid"),
        // A structure on the command line replaces that of the file.
        "volumes" if is_given("accel") => value_of("accel", options, all) == Some("bvh2"),
        "builder" if is_given("accel") => matches!(value_of("accel", options, all), Some("wide" | "bvh2")),
        "accel" if is_given("volumes") => setting.value.as_deref() == Some("bvh2"),
        _ => true,
    }
}

/// Whether the picture is written in a linear format.
fn is_linear(options: &ArgMatches) -> bool {
    let of_name = || Format::of_path(options.get_one::<PathBuf>("output")?);
    options.get_one::<Format>("format").copied().or_else(of_name).is_some_and(Format::is_linear)
}

/// The value of an option on the command line, else in the file.
fn value_of<'a>(id: &str, options: &'a ArgMatches, settings: &'a [Setting]) -> Option<&'a str> {
    if is_given(options, id) {
        return options.get_raw(id)?.next()?.to_str();
    }
    settings.iter().find(|setting| setting.key == id)?.value.as_deref()
}

/// All settings with the values of `options`, or with those in `resolved`.
pub(crate) fn all(options: &ArgMatches, resolved: &[(&str, String)]) -> Vec<Setting> {
    let command = render_command();
    let setting = |arg: &clap::Arg| {
        let key = arg.get_id().as_str();
        let given = || {
            let words: Option<Vec<&str>> = options.get_raw(key)?.map(|word| word.to_str()).collect();
            Some(words?.join(","))
        };
        let value = resolved.iter().find(|(name, _)| *name == key).map(|(_, value)| value.clone()).or_else(given);
        let help = arg.get_help().map(|help| help.to_string().replace('\n', " ")).unwrap_or_default();
        Setting { key: key.to_owned(), value, comment: help, line: 0 }
    };
    setting_options(&command).map(setting).collect()
}

/// The first option about a run on the command line, other than scene and output.
pub(crate) fn run_option(options: &ArgMatches) -> Option<String> {
    RUN_OPTIONS[2..].iter().copied().find(|id| is_given(options, id)).map(flag)
}

/// Hides an option about a run from the help.
pub(crate) fn hide_run_option(arg: clap::Arg) -> clap::Arg {
    let is_hidden = RUN_OPTIONS[2..].contains(&arg.get_id().as_str());
    arg.hide(is_hidden)
}
