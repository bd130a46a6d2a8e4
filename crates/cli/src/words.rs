//! The words of the command line: `canted FILE` is short for `canted render FILE`.

use std::{
    ffi::{OsStr, OsString},
    path::{Path, PathBuf},
};

use clap::Command;

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
        let is_help = ["-h", "--help", "-V", "--version"].iter().any(|word| first == OsStr::new(word));
        let file = is_file(first, program).then(|| PathBuf::from(first));
        if file.is_some() || is_option(first) && !is_help {
            words.insert(command, "render".into());
        }
        Self { words, command, file }
    }

    /// All words, starting with the program's name.
    pub(crate) fn all(&self) -> &[OsString] {
        &self.words
    }

    /// The words with `options` inserted after the name of the subcommand, so that later ones override them.
    pub(crate) fn with(&self, options: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
        let (before, after) = self.words.split_at((self.command + 1).min(self.words.len()));
        before.iter().cloned().chain(options).chain(after.iter().cloned()).collect()
    }

    /// The file of `canted FILE`.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }
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
            ("canted stats a.obj", "canted stats a.obj"),
            ("canted help", "canted help"),
            ("canted -v --help", "canted -v --help"),
            ("canted --version", "canted --version"),
            ("canted dance", "canted dance"),
        ] {
            let got: Vec<_> = words(line).all().iter().map(|word| word.to_str().unwrap().to_owned()).collect();
            assert_eq!(got.join(" "), want, "{line}");
        }
    }

    #[test]
    fn options_are_inserted_after_the_subcommand() {
        let got = words("canted -q a.obj --spp 4").with([OsString::from("--seed=1")]);
        assert_eq!(got, ["canted", "-q", "render", "--seed=1", "a.obj", "--spp", "4"]);
        assert_eq!(words("canted").with([]), ["canted"]);
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
