//! The command line: `canted FILE` is short for `canted render FILE`, and errors suggest near misses alone.

use std::{
    ffi::{OsStr, OsString},
    path::{Path, PathBuf},
};

use canted_scene::closest_match;
use clap::{
    ArgMatches, Command, Error,
    error::{ContextKind, ContextValue, ErrorKind},
};

use crate::{options, render};

/// The words of the command line, with the name of the subcommand.
pub(crate) struct Words {
    words: Vec<OsString>,
    /// The position of the subcommand's name; the number of words if there is none.
    command: usize,
    /// The file of `canted FILE`.
    file: Option<PathBuf>,
}

impl Words {
    /// The words of this process.
    pub(crate) fn of_process(program: &Command) -> Self {
        Self::new(std::env::args_os().collect(), program)
    }

    fn new(mut words: Vec<OsString>, program: &Command) -> Self {
        // The options before the subcommand are `-q` and `-v`, which have no value.
        let is_option = |word: &OsString| word.as_encoded_bytes().starts_with(b"-");
        let own = |word: &OsString| [&b"-q"[..], b"-v", b"--quiet", b"--verbose"].contains(&word.as_encoded_bytes());
        let command = words.iter().skip(1).position(|word| !own(word)).map_or(words.len(), |i| i + 1);
        let Some(first) = words.get(command) else { return Self { words, command, file: None } };
        if first == "merge" {
            return Self { words, command, file: None };
        }
        let is_help = ["-h", "--help", "-V", "--version"].iter().any(|word| first == OsStr::new(word));
        let file = is_file(first, program).then(|| PathBuf::from(first));
        if file.is_some() || is_option(first) && !is_help {
            words.insert(command, "render".into());
        }
        // The value of `--denoise` may be missing. Then the next word is not taken for it.
        for i in command..words.len() {
            let has_value = words.get(i + 1).is_some_and(|next| next == "on" || next == "off");
            if words[i] == "--denoise" && !has_value {
                words[i] = "--denoise=on".into();
            }
        }
        Self { words, command, file }
    }

    /// Parses the words. Ends the process where they ask for help or are invalid.
    pub(crate) fn parse(&self, program: Command) -> ArgMatches {
        // `-1` is a value and not an option, so that the option it belongs to reports it.
        let allow_negative = |arg: clap::Arg| {
            let takes_values = arg.get_action().takes_values();
            arg.allow_negative_numbers(takes_values)
        };
        let program = program.mut_subcommands(|command| command.mut_args(allow_negative));
        let matches = program.try_get_matches_from(&self.words);
        matches.unwrap_or_else(|error| with_near_misses(self.for_scene(error)).exit())
    }

    /// The error of an option that `canted render` has and `canted scene` has not.
    fn for_scene(&self, error: Error) -> Error {
        let is_scene = self.words.get(self.command).is_some_and(|word| word == "scene");
        let option = text_of(&error, ContextKind::InvalidArg).filter(|_| error.kind() == ErrorKind::UnknownArgument);
        let of_render =
            |option: &String| options::names::<render::Args>().iter().any(|name| *option == options::flag(name));
        match option.filter(|_| is_scene).filter(of_render) {
            None => error,
            Some(option) => {
                let message = format!("{option} is not a setting of a scene; use it with `canted render`\n");
                Error::raw(ErrorKind::UnknownArgument, message)
            }
        }
    }

    /// The file of `canted FILE`.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }
}

/// A word of an error.
fn text_of(error: &Error, kind: ContextKind) -> Option<String> {
    match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    }
}

/// An error without suggestions that are other words and no misspellings.
fn with_near_misses(mut error: Error) -> Error {
    for (invalid, suggested) in [
        (ContextKind::InvalidSubcommand, ContextKind::SuggestedSubcommand),
        (ContextKind::InvalidArg, ContextKind::SuggestedArg),
        (ContextKind::InvalidValue, ContextKind::SuggestedValue),
    ] {
        let word = text_of(&error, invalid).unwrap_or_default();
        let is_near =
            |near: &String| closest_match(word.trim_start_matches('-'), [near.trim_start_matches('-')]).is_some();
        match error.remove(suggested) {
            Some(ContextValue::String(near)) if is_near(&near) => {
                error.insert(suggested, ContextValue::String(near));
            }
            Some(ContextValue::Strings(mut near)) => {
                near.retain(is_near);
                if !near.is_empty() {
                    error.insert(suggested, ContextValue::Strings(near));
                }
            }
            // The usage of an unknown option is that of the suggested one.
            Some(_) if suggested == ContextKind::SuggestedArg => {
                error.remove(ContextKind::Usage);
            }
            _ => {}
        }
    }
    error
}

/// Whether the first word is a file and not a subcommand: it exists, or has a folder or an extension.
fn is_file(word: &OsStr, program: &Command) -> bool {
    if word.as_encoded_bytes().starts_with(b"-") || word == "help" || program.find_subcommand(word).is_some() {
        return false;
    }
    let path = Path::new(word);
    path.extension().is_some() || path.components().count() > 1 || path.exists()
}

/// The picture of `canted FILE`: in the current folder, with the name of the file without its extensions.
pub(crate) fn picture_of(file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or(OsStr::new("canted"));
    let stem = Path::new(name).file_stem().unwrap_or(name);
    // `bunny.ply.gz` is a picture of a bunny.
    let is_compressed = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    let stem = if is_compressed { Path::new(stem).file_stem().unwrap_or(stem) } else { stem };
    let mut picture = stem.to_owned();
    picture.push(".png");
    picture.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Words {
        let program = Command::new("canted").subcommand(Command::new("render")).subcommand(Command::new("stats"));
        Words::new(line.split_whitespace().map(OsString::from).collect(), &program)
    }

    #[test]
    fn a_file_is_rendered() {
        for (line, want) in [
            ("canted", "canted"),
            ("canted a.obj", "canted render a.obj"),
            ("canted -q models/a --spp 4", "canted -q render models/a --spp 4"),
            ("canted --spp 4 a.obj", "canted render --spp 4 a.obj"),
            ("canted --denoise a.obj", "canted render --denoise=on a.obj"),
            ("canted a.obj --denoise off", "canted render a.obj --denoise off"),
            ("canted merge a.exr --denoise", "canted merge a.exr --denoise"),
            ("canted stats a.obj", "canted stats a.obj"),
            ("canted help", "canted help"),
            ("canted -v --help", "canted -v --help"),
            ("canted --version", "canted --version"),
            ("canted dance", "canted dance"),
        ] {
            let got: Vec<_> = words(line).words.iter().map(|word| word.to_str().unwrap().to_owned()).collect();
            assert_eq!(got.join(" "), want, "{line}");
        }
    }

    #[test]
    fn suggestions_are_near_misses() {
        let program = || {
            let render = Command::new("render").arg(clap::Arg::new("format").long("format"));
            ["scene", "tree"]
                .into_iter()
                .fold(Command::new("canted").subcommand(render), |program, name| program.subcommand(Command::new(name)))
        };
        for (line, wanted, unwanted) in [
            ("canted rendre", "'render'", &["'scene'", "'tree'"][..]),
            ("canted render --formt x", "'--format'", &[]),
            ("canted render --frobnicate", "--frobnicate", &["--format"]),
        ] {
            let error = program().try_get_matches_from(line.split(' ')).unwrap_err();
            let text = with_near_misses(error).to_string();
            assert!(text.contains(wanted) && unwanted.iter().all(|other| !text.contains(other)), "{text}");
        }
    }

    #[test]
    fn a_picture_has_the_name_of_its_file() {
        for (file, want) in [
            ("models/helmet.glb", "helmet.png"),
            ("a.b.obj", "a.b.png"),
            ("bunny.ply.gz", "bunny.png"),
            ("scene", "scene.png"),
            ("..", "canted.png"),
        ] {
            assert_eq!(picture_of(Path::new(file)), Path::new(want), "{file}");
        }
    }
}
