//! `cargo xtask tidy`: rules that formatters and lints do not cover, one function each: it checks one file and adds its findings.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Result;

use crate::{command::say, results, workspace};

/// A violated rule.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Finding {
    /// The file, relative to the root.
    path: PathBuf,
    /// What is wrong, with line and value.
    message: String,
}

impl Finding {
    fn new(path: &Path, message: String) -> Self {
        Self { path: path.to_owned(), message }
    }
}

/// Prints all findings. Returns whether there is none.
pub(crate) fn run() -> Result<bool> {
    let findings = findings()?;
    for Finding { path, message } in &findings {
        say(&format!("error: {}: {message}", path.display()));
    }
    Ok(findings.is_empty())
}

/// Checks every text file of the workspace.
fn findings() -> Result<Vec<Finding>> {
    let root = workspace::root();
    let mut findings = vec![];
    findings.extend(results::flaw()?.map(|message| Finding::new(Path::new(results::PAGE), message)));
    for path in workspace::files()? {
        name(&path, &mut findings);
        // Files that are not UTF-8 are pictures or models.
        let Ok(text) = fs::read_to_string(root.join(&path)) else { continue };
        if path.extension().is_some_and(|extension| extension == "rs") {
            length(&path, &text, &mut findings);
            unfinished(&path, &text, &mut findings);
            allows_no_unsafe(&path, &text, &mut findings);
        }
        if is_crate_root(&path) {
            forbids_unsafe(&path, &text, &mut findings);
        }
    }
    Ok(findings)
}

/// `src/lib.rs` and `src/main.rs` of every package.
fn is_crate_root(path: &Path) -> bool {
    path.ends_with("src/lib.rs") || path.ends_with("src/main.rs")
}

/// The most lines of a source file.
const MAX_LINES: usize = 800;

/// A source file is one sitting.
fn length(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    let n = text.lines().count();
    if n > MAX_LINES {
        findings.push(Finding::new(path, format!("{n} lines; at most {MAX_LINES} are allowed")));
    }
}

/// Every file has a name that can be packaged and that every file system accepts.
fn name(path: &Path, findings: &mut Vec<Finding>) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-/\\".contains(c);
    if let Some(c) = path.to_string_lossy().chars().find(|&c| !is_plain(c)) {
        findings.push(Finding::new(path, format!("the name contains {c:?}")));
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
fn unfinished(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    for (i, line) in text.lines().enumerate() {
        for mark in UNFINISHED.into_iter().filter(|mark| line.contains(mark)) {
            findings.push(Finding::new(path, format!("line {}: {mark}", i + 1)));
        }
    }
}

/// The only files with unsafe code, and the root of their crate.
const UNSAFE_ROOT: &str = "crates/wide/src/lib.rs";
const UNSAFE_FILES: [&str; 4] = [
    "crates/wide/src/node/pod.rs",
    "crates/wide/src/simd/avx2.rs",
    "crates/wide/src/simd/avx512.rs",
    "crates/wide/src/simd/neon.rs",
];

/// Every crate forbids unsafe code; the crate with SIMD denies it except in the named files.
fn forbids_unsafe(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    let wanted = if path == Path::new(UNSAFE_ROOT) { "deny" } else { "forbid" };
    if !text.lines().any(|line| line == format!("#![{wanted}(unsafe_code)]")) {
        findings.push(Finding::new(path, format!("does not {wanted} unsafe code")));
    }
}

/// Only the named files allow unsafe code; benches call foreign libraries.
fn allows_no_unsafe(path: &Path, text: &str, findings: &mut Vec<Finding>) {
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
            findings.push(Finding::new(path, format!("line {}: unsafe code is not allowed here", i + 1)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_workspace_is_tidy() {
        assert_eq!(findings().unwrap(), []);
    }

    #[test]
    fn crate_roots_of_this_workspace_are_found() {
        let files = workspace::files().unwrap();
        let roots: Vec<&PathBuf> = files.iter().filter(|path| is_crate_root(path)).collect();
        for root in ["xtask/src/main.rs", "crates/obb/src/lib.rs", "fixtures/src/lib.rs"] {
            assert!(roots.contains(&&PathBuf::from(root)), "{root} is not among {roots:?}");
        }
    }

    fn found(rule: impl Fn(&Path, &str, &mut Vec<Finding>), text: &str) -> Vec<String> {
        let mut findings = vec![];
        rule(Path::new("file.rs"), text, &mut findings);
        findings.into_iter().map(|finding| finding.message).collect()
    }

    #[test]
    fn lengths_at_the_limit() {
        assert_eq!(found(length, &"x\n".repeat(800)), [""; 0]);
        assert_eq!(found(length, &"x\n".repeat(801)), ["801 lines; at most 800 are allowed"]);
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
            assert_eq!(found(unfinished, &format!("fn f() {{\n    {mark} \n}}")), [format!("line 2: {mark}")]);
        }
        assert_eq!(found(unfinished, "fn ignored() { method(todo) }"), [""; 0]);
    }

    #[test]
    fn crates_must_forbid_unsafe_code() {
        assert_eq!(found(forbids_unsafe, "//! A crate.\n#![forbid(unsafe_code)]\n"), [""; 0]);
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
}
