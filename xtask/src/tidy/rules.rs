//! One function per rule: checks one file and adds its findings.

use std::path::Path;

use super::Finding;
use crate::{figures, tables, workspace};

/// Above this many lines a file should be split …
const LONG_LINES: usize = 300;
/// … and above this many it must be.
const MAX_LINES: usize = 400;

/// A source file is short.
pub(super) fn length(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    match text.lines().count() {
        0..=LONG_LINES => {}
        n @ ..=MAX_LINES => findings.push(Finding::warning(path, format!("{n} lines; {LONG_LINES} are enough"))),
        n => findings.push(Finding::error(path, format!("{n} lines; at most {MAX_LINES} are allowed"))),
    }
}

/// Every file has a name that can be packaged and that every file system accepts.
pub(super) fn name(path: &Path, findings: &mut Vec<Finding>) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-/\\".contains(c);
    if let Some(c) = path.to_string_lossy().chars().find(|&c| !is_plain(c)) {
        findings.push(Finding::error(path, format!("the name contains {c:?}")));
    }
}

/// Marks of unfinished work, in halves so that this file has none.
const UNFINISHED: [&str; 5] = [
    concat!("#[ig", "nore"),
    concat!("to", "do!("),
    concat!("unimple", "mented!("),
    concat!("d", "bg!("),
    concat!("TO", "DO"),
];

/// No test is ignored and nothing is unfinished.
pub(super) fn unfinished(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    for (i, line) in text.lines().enumerate() {
        for mark in UNFINISHED.into_iter().filter(|mark| line.contains(mark)) {
            findings.push(Finding::error(path, format!("line {}: {mark}", i + 1)));
        }
    }
}

/// Folders of one machine, in halves so that this file names none.
const MACHINE_FOLDERS: [&str; 4] =
    [concat!("/ho", "me/"), concat!("/wo", "rk/"), concat!("/tm", "p/"), concat!("/ro", "ot/")];

/// No text names an absolute path of one machine.
pub(super) fn machine_paths(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    for (i, line) in text.lines().enumerate() {
        for folder in MACHINE_FOLDERS.into_iter().filter(|folder| names_folder(line, folder)) {
            findings.push(Finding::error(path, format!("line {}: {folder} is a path of one machine", i + 1)));
        }
    }
}

/// Whether `folder` starts a path in `line`, and is not part of a longer path or an address.
fn names_folder(line: &str, folder: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || "._-}~".contains(c);
    line.match_indices(folder).any(|(at, _)| !line[..at].ends_with(is_part))
}

/// The only files with unsafe code, and the root of their crate.
const UNSAFE_ROOT: &str = "crates/wide/src/lib.rs";
const UNSAFE_FILES: [&str; 3] =
    ["crates/wide/src/simd/avx2.rs", "crates/wide/src/simd/avx512.rs", "crates/wide/src/simd/neon.rs"];

/// Every crate forbids unsafe code; the crate with SIMD denies it except in the named files.
pub(super) fn forbids_unsafe(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    let wanted = if path == Path::new(UNSAFE_ROOT) { "deny" } else { "forbid" };
    if !text.lines().any(|line| line == format!("#![{wanted}(unsafe_code)]")) {
        findings.push(Finding::error(path, format!("does not {wanted} unsafe code")));
    }
}

/// Only the named files allow unsafe code; benches call foreign libraries.
pub(super) fn allows_no_unsafe(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    if !path.starts_with("crates") || UNSAFE_FILES.iter().any(|file| path == Path::new(file)) {
        return;
    }
    for (i, line) in text.lines().enumerate() {
        let allows = |word: &&str| line.trim_start().starts_with(word) && line.contains("unsafe_code");
        // In halves, so that this file allows nothing.
        if [concat!("#![ex", "pect("), concat!("#![al", "low("), concat!("#[ex", "pect("), concat!("#[al", "low(")]
            .iter()
            .any(allows)
        {
            findings.push(Finding::error(path, format!("line {}: unsafe code is not allowed here", i + 1)));
        }
    }
}

/// Repeated versions of our packages and of the compiler equal those of the workspace manifest.
pub(super) fn versions(path: &Path, text: &str, manifest: &str, findings: &mut Vec<Finding>) {
    let own = workspace::value(manifest, "workspace.package", "version").unwrap_or_default();
    let rust = workspace::value(manifest, "workspace.package", "rust-version").unwrap_or_default();
    for (i, line) in text.lines().enumerate() {
        let repeated = version_of_ours(line).map(|found| (found, own));
        let compiler = version_after(line, "Rust ").map(|found| (found, rust));
        for (found, right) in repeated.into_iter().chain(compiler) {
            if found != right {
                findings.push(Finding::error(path, format!("line {}: version {found} is not {right}", i + 1)));
            }
        }
    }
}

/// Measured tables are up to date, and README.md and `docs` have no other figures. `docs/mended.md` is exempt: it quotes
/// figures of earlier commits.
pub(super) fn figures(path: &Path, text: &str, results: &str, findings: &mut Vec<Finding>) {
    findings.extend(tables::flaw(path, text, results).map(|message| Finding::error(path, message)));
    if path == Path::new("README.md") || path.starts_with("docs") && path != Path::new("docs/mended.md") {
        for (line, message) in figures::figures(text) {
            findings.push(Finding::error(path, format!("line {line}: {message}")));
        }
    }
}

/// The version in a line `canted… = "VERSION"` or `canted… = { …, version = "VERSION" … }`.
fn version_of_ours(line: &str) -> Option<&str> {
    let (_, value) = line.trim().strip_prefix("canted")?.split_once('=')?;
    let (_, version) = value.split_once("version =").unwrap_or(("", value));
    let version = version.trim_start().strip_prefix('"')?;
    version.split_once('"').map(|(version, _)| version)
}

/// The version that follows `word`, as in `Rust 1.89`; a full stop that ends the sentence is not part of it.
fn version_after<'a>(line: &'a str, word: &str) -> Option<&'a str> {
    let (_, rest) = line.split_once(word)?;
    let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
    let version = rest[..end].trim_end_matches('.');
    version.contains('.').then_some(version)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(rule: impl Fn(&Path, &str, &mut Vec<Finding>), text: &str) -> Vec<(bool, String)> {
        let mut findings = vec![];
        rule(Path::new("file.rs"), text, &mut findings);
        findings.into_iter().map(|finding| (finding.is_error, finding.message)).collect()
    }

    #[test]
    fn lengths_at_both_limits() {
        assert_eq!(found(length, &"x\n".repeat(300)), []);
        assert_eq!(found(length, &"x\n".repeat(301)), [(false, "301 lines; 300 are enough".to_owned())]);
        assert_eq!(found(length, &"x\n".repeat(400)), [(false, "400 lines; 300 are enough".to_owned())]);
        assert_eq!(found(length, &"x\n".repeat(401)), [(true, "401 lines; at most 400 are allowed".to_owned())]);
    }

    #[test]
    fn names_are_plain() {
        let n_found = |path: &str| {
            let mut findings = vec![];
            name(Path::new(path), &mut findings);
            findings.len()
        };
        for plain in ["README.md", "crates/obb/src/lib.rs", ".ci/run", "a-b_c/x.tar.gz"] {
            assert_eq!(n_found(plain), 0, "{plain}");
        }
        for odd in ["shaders/*.rs", "a b.rs", "what?.rs", "c:x.rs", "größe.rs"] {
            assert_eq!(n_found(odd), 1, "{odd}");
        }
    }

    #[test]
    fn every_mark_of_unfinished_work_is_found() {
        for mark in UNFINISHED {
            assert_eq!(found(unfinished, &format!("fn f() {{\n    {mark} \n}}")), [(true, format!("line 2: {mark}"))]);
        }
        assert_eq!(found(unfinished, "fn ignored() { method(todo) }"), []);
    }

    #[test]
    fn machine_paths_are_found_and_other_paths_are_not() {
        for folder in MACHINE_FOLDERS {
            for text in
                [format!("{folder}me"), format!("cd {folder}x"), format!("\"{folder}x\""), format!("({folder})")]
            {
                assert_eq!(found(machine_paths, &text).len(), 1, "{text}");
            }
            for text in [format!("https://example.org{folder}x"), format!("target{folder}x"), format!("..{folder}x")] {
                assert_eq!(found(machine_paths, &text), [], "{text}");
            }
        }
    }

    #[test]
    fn crates_must_forbid_unsafe_code() {
        assert_eq!(found(forbids_unsafe, "//! A crate.\n#![forbid(unsafe_code)]\n"), []);
        assert_eq!(found(forbids_unsafe, "// #![forbid(unsafe_code)]\n").len(), 1);
        assert_eq!(found(forbids_unsafe, "#![deny(unsafe_code)]\n").len(), 1, "only the SIMD crate may deny it");
        let simd_root = |text: &str| {
            let mut findings = vec![];
            forbids_unsafe(Path::new(UNSAFE_ROOT), text, &mut findings);
            findings.len()
        };
        assert_eq!([simd_root("#![deny(unsafe_code)]\n"), simd_root("//! Lanes.\n")], [0, 1]);
    }

    #[test]
    fn unsafe_code_is_allowed_in_named_files_only() {
        let n_found = |file: &str, text: &str| {
            let mut findings = vec![];
            allows_no_unsafe(Path::new(file), text, &mut findings);
            findings.len()
        };
        for line in
            [concat!("#![al", "low(unsafe_code)]"), concat!("    #[ex", "pect(unsafe_code, reason = \"fast\")]")]
        {
            assert_eq!(n_found("crates/wide/src/walk.rs", line), 1, "{line}");
            for file in UNSAFE_FILES.into_iter().chain(["benches/peers/foreign.rs"]) {
                assert_eq!(n_found(file, line), 0, "{file}: {line}");
            }
        }
        let harmless = "#![forbid(unsafe_code)]\n// #![expect(unsafe_code)]\n";
        assert_eq!(n_found("crates/obb/src/lib.rs", harmless), 0);
    }

    #[test]
    fn the_named_files_exist() {
        for file in UNSAFE_FILES.into_iter().chain([UNSAFE_ROOT]) {
            assert!(workspace::root().join(file).is_file(), "{file}");
        }
    }

    #[test]
    fn outdated_versions_are_found() {
        let manifest = "[workspace.package]\nversion = \"0.2.0\"\nrust-version = \"1.89\"\n";
        let rule = |path: &Path, text: &str, findings: &mut Vec<Finding>| versions(path, text, manifest, findings);
        let right = "canted-obb = \"0.2.0\"\ncanted-lbvh = { path = \"x\", version = \"0.2.0\" }\nRust 1.89 or newer.\n\
                     Rust 1.89.\ncanted.workspace = true\ncanted renders = pictures, in Rust and WGSL\n";
        assert_eq!(found(rule, right), []);
        for wrong in ["canted-obb = \"0.1.0\"", "canted = { version = \"0.1\", features = [] }", "needs Rust 1.88."] {
            assert_eq!(found(rule, wrong).len(), 1, "{wrong}");
        }
    }
}
