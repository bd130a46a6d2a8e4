//! Reads the WGSL files and writes their texts, a constant for the name of each, and an enum for each slot, so that a wrong name does not compile.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

#[path = "src/sections.rs"]
mod sections;

use sections::{CHOICE, CONST, SLOT, USE, sections};

/// Where the WGSL files are.
const PLACES: [&str; 6] = ["build", "check.wgsl", "render", "shared", "shared.wgsl", "trace.wgsl"];

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let mut paths = vec![];
    for place in PLACES {
        println!("cargo:rerun-if-changed={place}");
        add_files(&root.join(place), &mut paths);
    }
    println!("cargo:rerun-if-changed=src/sections.rs");
    paths.sort();
    let files: Vec<(String, String)> = paths
        .iter()
        .map(|path| {
            let name = path.strip_prefix(&root).expect("below the root").with_extension("");
            let name = name.to_str().expect("names are ASCII").replace('\\', "/");
            (name, fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
        })
        .collect();
    let names = Names::of(&files);
    names.check(&files);
    let mut text = String::new();
    write_files(&mut text, &files);
    write_slots(&mut text, &names);
    write_names(&mut text, &names);
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it")).join("files.rs");
    fs::write(&out, text).unwrap_or_else(|error| panic!("{}: {error}", out.display()));
}

fn add_files(place: &Path, paths: &mut Vec<PathBuf>) {
    if !place.is_dir() {
        if place.extension().is_some_and(|extension| extension == "wgsl") {
            paths.push(place.to_owned());
        }
        return;
    }
    for entry in fs::read_dir(place).unwrap_or_else(|error| panic!("{}: {error}", place.display())) {
        add_files(&entry.expect("a readable folder").path(), paths);
    }
}

/// What the files declare.
#[derive(Default)]
struct Names {
    /// Files and parts that are no choices, and whether they are kernels.
    files: BTreeMap<String, bool>,
    /// The choices of each slot, in the order of the files: the last word and the whole name of each.
    slots: BTreeMap<String, Vec<(String, String)>>,
    numbers: BTreeSet<String>,
    overrides: BTreeSet<String>,
}

impl Names {
    fn of(files: &[(String, String)]) -> Self {
        let mut names = Self::default();
        for (file, text) in files {
            let choices: BTreeSet<&str> = text.lines().filter_map(|line| line.strip_prefix(CHOICE)).collect();
            for (part, section) in sections(text) {
                if choices.contains(part) {
                    let whole = format!("{file}/{part}");
                    let mut words = whole.rsplit('/');
                    let (Some(choice), Some(slot)) = (words.next(), words.next()) else { continue };
                    let slot = names.slots.entry(slot.to_owned()).or_default();
                    let other = slot.iter().find(|(known, _)| known == choice);
                    assert!(other.is_none(), "{whole} and {other:?} have the same name in their slot");
                    slot.push((choice.to_owned(), whole.clone()));
                } else {
                    let name = if part.is_empty() { file.clone() } else { format!("{file}/{part}") };
                    // The head of a file with kernels as parts has none itself.
                    names.files.insert(name, is_kernel(section));
                }
                names.numbers.extend(section.lines().filter_map(|line| line.strip_prefix(CONST)).map(str::to_owned));
                let declared = section.lines().filter_map(|line| line.strip_prefix("override "));
                names.overrides.extend(declared.filter_map(|rest| Some(rest.split_once(':')?.0.to_owned())));
            }
        }
        names
    }

    /// Panics where a file uses what no file declares.
    fn check(&self, files: &[(String, String)]) {
        let choices: BTreeSet<&String> = self.slots.values().flatten().map(|(_, whole)| whole).collect();
        for (file, text) in files {
            for line in text.lines() {
                if let Some(slot) = line.strip_prefix(SLOT) {
                    assert!(self.slots.contains_key(slot.trim()), "{file}: no part fills the slot in '{line}'");
                } else if let Some(part) = line.strip_prefix(USE) {
                    let part = part.trim().to_owned();
                    assert!(
                        self.files.contains_key(&part) || choices.contains(&part),
                        "{file}: '{line}' names nothing"
                    );
                }
            }
        }
    }
}

/// Whether a section has an entry point.
fn is_kernel(section: &str) -> bool {
    section.lines().any(|line| line.starts_with("@compute") || line.starts_with("@vertex"))
}

fn write_files(text: &mut String, files: &[(String, String)]) {
    text.push_str(
        "/// Path of each file without its extension, and its text.\npub const FILES: &[(&str, &str)] = &[\n",
    );
    for (name, _) in files {
        let _ =
            writeln!(text, "    ({name:?}, include_str!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/{name}.wgsl\"))),");
    }
    text.push_str("];\n\n");
}

/// An enum for each slot, and one for the names of numbers and of overrides.
fn write_slots(text: &mut String, names: &Names) {
    text.push_str("pub(crate) const SLOTS: &[(&str, &[&str])] = &[\n");
    for (slot, choices) in &names.slots {
        let parts: Vec<&String> = choices.iter().map(|(_, part)| part).collect();
        let _ = writeln!(text, "    ({slot:?}, &{parts:?}),");
    }
    text.push_str("];\n\n/// An enum for each slot of kernels: the parts that fill it.\npub mod choice {\n");
    for (slot, choices) in &names.slots {
        let kind = camel(slot);
        let _ = writeln!(text, "    /// What fills the slot `{slot}`.");
        let _ = writeln!(text, "    #[derive(Clone, Copy, Debug, PartialEq, Eq)]\n    pub enum {kind} {{");
        for (choice, part) in choices {
            let _ = writeln!(text, "        /// `{part}`\n        {},", camel(choice));
        }
        let _ = writeln!(
            text,
            "    }}\n\n    impl super::Choice for {kind} {{\n        const SLOT: &'static str = {slot:?};\n"
        );
        let _ = writeln!(text, "        fn part(self) -> &'static str {{\n            match self {{");
        for (choice, part) in choices {
            let _ = writeln!(text, "                Self::{} => {part:?},", camel(choice));
        }
        text.push_str("            }\n        }\n    }\n\n");
    }
    text.push_str("}\n\n");
    write_enum(text, "Number", "A constant of a kernel that its host sets.", &names.numbers);
    write_enum(text, "Override", "An `override` of a kernel.", &names.overrides);
}

fn write_enum(text: &mut String, kind: &str, about: &str, names: &BTreeSet<String>) {
    let _ = writeln!(text, "/// {about}\n#[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub enum {kind} {{");
    for name in names {
        let _ = writeln!(text, "    /// `{name}`\n    {},", camel(&name.to_lowercase()));
    }
    let _ = writeln!(
        text,
        "}}\n\nimpl {kind} {{\n    /// All of them, with their names in WGSL.\n    pub(crate) const ALL: &[(Self, &str)] = &["
    );
    for name in names {
        let _ = writeln!(text, "        (Self::{}, {name:?}),", camel(&name.to_lowercase()));
    }
    text.push_str("    ];\n}\n\n");
}

/// A constant for each file and part, in modules named after their folders.
fn write_names(text: &mut String, names: &Names) {
    let kernels: Vec<&String> = names.files.iter().filter(|(_, is_kernel)| **is_kernel).map(|(name, _)| name).collect();
    let _ = writeln!(text, "pub(crate) const KERNELS: &[&str] = &{kernels:?};\n");
    text.push_str("/// Names of kernels and of other files and parts, in modules named after their folders.\npub mod wgsl {\n    use super::ShaderName;\n");
    let all: Vec<(Vec<&str>, &str)> =
        names.files.keys().map(|name| (name.split('/').collect(), name.as_str())).collect();
    write_modules(text, &all, 1);
    text.push_str("}\n");
}

fn write_modules(text: &mut String, names: &[(Vec<&str>, &str)], depth: usize) {
    let indent = "    ".repeat(depth);
    let mut below: BTreeMap<&str, Vec<(Vec<&str>, &str)>> = BTreeMap::new();
    for (words, whole) in names {
        match &words[..] {
            [word] => {
                let _ = writeln!(
                    text,
                    "{indent}/// `{whole}`\n{indent}pub const {}: ShaderName = ShaderName({whole:?});",
                    word.to_uppercase()
                );
            }
            [folder, rest @ ..] => below.entry(folder).or_default().push((rest.to_vec(), whole)),
            [] => {}
        }
    }
    for (folder, names) in below {
        let _ = writeln!(
            text,
            "\n{indent}/// What is in `{folder}`.\n{indent}pub mod {folder} {{\n{indent}    use super::ShaderName;"
        );
        write_modules(text, &names, depth + 1);
        let _ = writeln!(text, "{indent}}}");
    }
}

/// `node_kinds` as `NodeKinds`.
fn camel(name: &str) -> String {
    let word = |word: &str| {
        let mut letters = word.chars();
        letters.next().map(|first| first.to_ascii_uppercase()).into_iter().chain(letters).collect::<String>()
    };
    name.split('_').map(word).collect()
}
