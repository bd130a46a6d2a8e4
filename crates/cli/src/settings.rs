//! Settings of scene files: the options of `canted render` that make the picture, by the names that they have there.
//!
//! There is no list of them: an option is a setting unless it is one of the few below. The command line's own options
//! stand behind those of the file, so they have the last word; what neither says is as ever.

use std::{
    ffi::OsString,
    num::{IntErrorKind, ParseIntError},
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_scene::{Setting, closest_match};
use clap::{
    ArgMatches, Args as _, Command, CommandFactory,
    error::{ContextKind, ContextValue},
    parser::ValueSource,
};

use crate::{Cli, load, output, render};

/// Options about the run: what is read, written, kept and told.
const OF_THE_RUN: [&str; 11] = [
    "scene",
    "output",
    "samples",
    "aovs",
    "checkpoint",
    "checkpoint_every",
    "heatmap",
    "heatmap_scale",
    "device",
    "threads",
    "json",
];

/// Options that a scene file says in other tables.
const ELSEWHERE: [(&str, &str); 13] = [
    ("eye", "[camera]"),
    ("target", "[camera]"),
    ("up", "[camera]"),
    ("fov", "[camera]"),
    ("aperture", "[camera]"),
    ("focus", "[camera]"),
    ("env", "[environment]"),
    ("env_turn", "[environment]"),
    ("env_scale", "[environment]"),
    ("sun", "[[lights]]"),
    ("point", "[[lights]]"),
    ("sphere", "[[lights]]"),
    ("time", "[[assets]]"),
];

/// `canted render`, to be asked for its options.
fn render_command() -> Command {
    render::Args::augment_args(Command::new("render")).disable_help_flag(true)
}

/// The options that are settings.
fn known(command: &Command) -> impl Iterator<Item = &clap::Arg> {
    let is_setting = |id: &str| !OF_THE_RUN.contains(&id) && ELSEWHERE.iter().all(|&(other, _)| other != id);
    command.get_arguments().filter(move |arg| is_setting(arg.get_id().as_str()))
}

/// Refuses settings that are unknown, or whose value the option does not take.
pub(crate) fn check(settings: &[Setting], path: &Path) -> Result<()> {
    let command = render_command();
    for setting in settings {
        check_one(setting, &command).map_err(|why| anyhow!("{}: line {}: {why}", path.display(), setting.line))?;
    }
    Ok(())
}

fn check_one(Setting { key, value, .. }: &Setting, command: &Command) -> Result<(), String> {
    if let Some((_, table)) = ELSEWHERE.iter().find(|(other, _)| other == key) {
        return Err(format!("`{key}` is no key of [settings]; it is said in {table}"));
    }
    let names: Vec<&str> = known(command).map(|arg| arg.get_id().as_str()).collect();
    if !names.contains(&&key[..]) {
        let near = closest_match(key, names).unwrap_or_default();
        return Err(format!("[settings] has no key `{}`; the nearest is `{near}`", key.escape_debug()));
    }
    let Some(value) = value else { return Ok(()) };
    let refused = command.clone().try_get_matches_from(["render".into(), option(key, value)]).err();
    refused.map_or(Ok(()), |error| Err(format!("`{key}` of [settings] is {value:?}{}", reason(&error, value))))
}

/// A setting as an option.
fn option(key: &str, value: &str) -> OsString {
    format!("--{}={value}", key.replace('_', "-")).into()
}

/// Why an option does not take a value, on one line.
fn reason(error: &clap::Error, value: &str) -> String {
    if let Some(ContextValue::Strings(words)) = error.get(ContextKind::ValidValue) {
        let near = closest_match(value, words.iter().map(|word| &word[..])).unwrap_or_default();
        return format!(", not one of {}; the nearest is {near}", words.join(", "));
    }
    let source = std::error::Error::source(error);
    let kind = source.and_then(|source| source.downcast_ref::<ParseIntError>()).map(ParseIntError::kind);
    if matches!(kind, Some(IntErrorKind::InvalidDigit | IntErrorKind::Empty)) {
        return ", which is no whole number".to_owned();
    }
    let source = source.map(ToString::to_string).unwrap_or_default();
    format!(": {}", source.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// The program's command line, in which `-1` is a value, so that the option whose it is can refuse it by name.
fn command() -> Command {
    let negative = |arg: clap::Arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    };
    Cli::command().mut_subcommands(|command| command.mut_args(negative))
}

/// The command line, behind the settings of the scene file that it names.
///
/// # Errors
/// The scene file cannot be read, or is wrong.
pub(crate) fn command_line() -> Result<ArgMatches> {
    let own = command().get_matches();
    let Some((name @ ("render" | "scene" | "cast"), options)) = own.subcommand() else { return Ok(own) };
    let makes_pictures = name != "cast";
    let path = options.get_one::<PathBuf>("scene").filter(|path| makes_pictures && load::is_scene_file(path));
    let settings = path.map(|path| load::scene_file(path)).transpose()?.map_or_else(Vec::new, |file| file.settings);
    if makes_pictures {
        tell_of_light(options);
    }
    tell_of_preset(options, &settings);
    if settings.is_empty() {
        return Ok(own);
    }
    let mut words: Vec<OsString> = std::env::args_os().collect();
    let rest = words.split_off(words.len().min(2));
    words.extend(
        settings
            .iter()
            .filter(|setting| counts(setting, &settings, options))
            .filter_map(|setting| Some(option(&setting.key, setting.value.as_deref()?))),
    );
    words.extend(rest);
    let command = command().mut_subcommand(name, |command| command.args_override_self(true));
    Ok(command.get_matches_from(words))
}

/// Whether the command line itself says it.
fn is_given(options: &ArgMatches, id: &str) -> bool {
    options.value_source(id) == Some(ValueSource::CommandLine)
}

/// Options that say which light is gathered and how, of which a heat map shows nothing: its rays pass the middle of the lens.
const OF_LIGHT: [&str; 16] = [
    "spp",
    "sampler",
    "seed",
    "filter",
    "lod",
    "integrator",
    "bounces",
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

/// Tells, once, of what the command line says and a heat map has no use for. Settings of a scene file are for other pictures too.
fn tell_of_light(options: &ArgMatches) {
    let idle = OF_LIGHT.into_iter().filter(|id| is_given(options, id));
    let idle: Vec<String> = idle.map(|id| format!("--{}", id.replace('_', "-"))).collect();
    if is_given(options, "heatmap") && !idle.is_empty() {
        let idle = idle.join(", ");
        output::to_stderr(&format!("warning: --heatmap shows tests of camera rays, to which {idle} does nothing"));
    }
}

/// Tells of a preset, which is of wide trees, that stands beside volumes of binary ones: a file's settings may be for both.
fn tell_of_preset(options: &ArgMatches, settings: &[Setting]) {
    let volumes = said("volumes", options, settings).unwrap_or("auto");
    if is_given(options, "preset") && volumes != "auto" {
        output::to_stderr(&format!("warning: --volumes {volumes} makes a binary tree, to which --preset does nothing"));
    }
}

/// Whether a setting has a say beside options of the command line that leave it none.
///
/// `--samples` says which samples are taken, and so how many, where their number does not decide what they are.
fn counts(setting: &Setting, all: &[Setting], options: &ArgMatches) -> bool {
    let is_given = |id: &str| is_given(options, id);
    match &setting.key[..] {
        "noise" => !is_given("samples") && !is_given("heatmap"),
        "spp" if is_given("samples") => said("sampler", options, all) == Some("stratified"),
        "ao_radius" if is_given("integrator") => said("integrator", options, all) == Some("hybrid"),
        _ => true,
    }
}

/// The value of an option on the command line, else that of the file.
fn said<'a>(id: &str, options: &'a ArgMatches, settings: &'a [Setting]) -> Option<&'a str> {
    if is_given(options, id) {
        return options.get_raw(id)?.next()?.to_str();
    }
    settings.iter().find(|setting| setting.key == id)?.value.as_deref()
}

/// All settings as `options` and the defaults have them, but those that `resolved` knows better.
pub(crate) fn spelled_out(options: &ArgMatches, resolved: &[(&str, String)]) -> Vec<Setting> {
    let command = render_command();
    let setting = |arg: &clap::Arg| {
        let key = arg.get_id().as_str();
        let said = || {
            let words: Option<Vec<&str>> = options.get_raw(key)?.map(|word| word.to_str()).collect();
            Some(words?.join(","))
        };
        let value = resolved.iter().find(|(name, _)| *name == key).map(|(_, value)| value.clone()).or_else(said);
        let help = arg.get_help().map(|help| help.to_string().replace('\n', " ")).unwrap_or_default();
        Setting { key: key.to_owned(), value, comment: help, line: 0 }
    };
    known(&command).map(setting).collect()
}

/// The option about a run that the command line names, if any but scene and output.
pub(crate) fn about_the_run(options: &ArgMatches) -> Option<String> {
    OF_THE_RUN[2..].iter().copied().find(|id| is_given(options, id)).map(|id| format!("--{}", id.replace('_', "-")))
}

/// Hides the options about a run from the help of a command.
pub(crate) fn hide_the_run(arg: clap::Arg) -> clap::Arg {
    let is_hidden = OF_THE_RUN[2..].contains(&arg.get_id().as_str());
    arg.hide(is_hidden)
}
