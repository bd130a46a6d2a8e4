//! `cargo xtask tidy`: rules that formatters and lints do not cover, one function each: it checks one file and adds its findings.

use std::{fs, path::Path};

use anyhow::Result;

use crate::{
    circles,
    command::{self, say},
    results,
};

/// Prints all findings. Returns whether there is none.
pub(crate) fn run() -> Result<bool> {
    let findings = findings()?;
    findings.iter().for_each(|finding| say(&format!("error: {finding}")));
    Ok(findings.is_empty())
}

/// What is wrong in any text file of the workspace: path, and message with line and value.
fn findings() -> Result<Vec<String>> {
    let mut findings = vec![];
    findings.extend(results::flaw()?.map(|message| format!("{}: {message}", results::PAGE)));
    let mut sources = vec![];
    for path in command::files()? {
        let mut rules = vec![name(&path)];
        // Files that are not UTF-8 are pictures or models.
        if let Ok(text) = fs::read_to_string(command::root().join(&path)) {
            if is_crate_root(&path) {
                rules.push(forbids_unsafe(&path, &text));
            }
            if path.extension().is_some_and(|extension| extension == "rs") {
                rules.extend([length(&text), unfinished(&text), allows_no_unsafe(&path, &text)]);
                sources.push((path.clone(), text));
            }
        }
        findings.extend(rules.concat().iter().map(|message| format!("{}: {message}", path.display())));
    }
    findings.extend(circles::findings(&sources));
    Ok(findings)
}

/// `src/lib.rs` and `src/main.rs` of every package.
fn is_crate_root(path: &Path) -> bool {
    path.ends_with("src/lib.rs") || path.ends_with("src/main.rs")
}

/// The most lines of a source file.
const MAX_LINES: usize = 800;

/// A source file is one sitting.
fn length(text: &str) -> Vec<String> {
    let n = text.lines().count();
    Vec::from_iter((n > MAX_LINES).then(|| format!("{n} lines; at most {MAX_LINES} are allowed")))
}

/// Every file has a name that can be packaged and that every file system accepts.
fn name(path: &Path) -> Vec<String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-/\\".contains(c);
    let odd = path.to_string_lossy().chars().find(|&c| !is_plain(c));
    Vec::from_iter(odd.map(|c| format!("the name contains {c:?}")))
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
fn unfinished(text: &str) -> Vec<String> {
    let marks = |(line, i): (&str, usize)| {
        UNFINISHED.into_iter().filter(|mark| line.contains(mark)).map(|mark| format!("line {i}: {mark}")).collect()
    };
    text.lines().zip(1..).flat_map::<Vec<String>, _>(marks).collect()
}

/// The only files with unsafe code, and the roots of their crates.
const UNSAFE_ROOTS: [&str; 3] = ["crates/wide/src/lib.rs", "crates/gpu/src/lib.rs", "benches/kernels/src/main.rs"];
const UNSAFE_FILES: [&str; 7] = [
    "benches/kernels/src/driver.rs",
    "crates/gpu/src/trusted.rs",
    "crates/wide/src/node/mapped.rs",
    "crates/wide/src/node/pod.rs",
    "crates/wide/src/simd/avx2.rs",
    "crates/wide/src/simd/avx512.rs",
    "crates/wide/src/simd/neon.rs",
];

/// Every crate forbids unsafe code; those with SIMD, with Vulkan and with kernels without checks deny it except in the named files.
fn forbids_unsafe(path: &Path, text: &str) -> Vec<String> {
    let wanted = if UNSAFE_ROOTS.iter().any(|root| path == Path::new(root)) { "deny" } else { "forbid" };
    let is_there = text.lines().any(|line| line == format!("#![{wanted}(unsafe_code)]"));
    Vec::from_iter((!is_there).then(|| format!("does not {wanted} unsafe code")))
}

/// Only the named files allow unsafe code; benches call foreign libraries.
fn allows_no_unsafe(path: &Path, text: &str) -> Vec<String> {
    if !(path.starts_with("crates") || path.starts_with("benches/kernels"))
        || UNSAFE_FILES.iter().any(|file| path == Path::new(file))
    {
        return vec![];
    }
    // In halves, so that this file allows nothing.
    let attributes =
        [concat!("#![ex", "pect("), concat!("#![al", "low("), concat!("#[ex", "pect("), concat!("#[al", "low(")];
    let allows =
        |line: &str| line.contains("unsafe_code") && attributes.iter().any(|word| line.trim_start().starts_with(word));
    let lines = text.lines().zip(1..).filter(|(line, _)| allows(line));
    lines.map(|(_, i)| format!("line {i}: unsafe code is not allowed here")).collect()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn this_workspace_is_tidy() {
        assert_eq!(findings().unwrap(), [""; 0]);
    }

    #[test]
    fn crate_roots_of_this_workspace_are_found() {
        let roots: Vec<PathBuf> = command::files().unwrap().into_iter().filter(|path| is_crate_root(path)).collect();
        for root in ["xtask/src/main.rs", "crates/obb/src/lib.rs", "fixtures/src/lib.rs"] {
            assert!(roots.contains(&PathBuf::from(root)), "{root} is not among {roots:?}");
        }
        for file in UNSAFE_FILES.into_iter().chain(UNSAFE_ROOTS) {
            assert!(command::root().join(file).is_file(), "{file}");
        }
    }

    #[test]
    fn lengths_and_names_at_the_limit() {
        assert_eq!(length(&"x\n".repeat(800)), [""; 0]);
        assert_eq!(length(&"x\n".repeat(801)), ["801 lines; at most 800 are allowed"]);
        for plain in ["README.md", "crates/obb/src/lib.rs", ".ci/run", "a-b_c/x.tar.gz"] {
            assert_eq!(name(Path::new(plain)), [""; 0], "{plain}");
        }
        for odd in ["shaders/*.rs", "a b.rs", "what?.rs", "c:x.rs", "größe.rs"] {
            assert_eq!(name(Path::new(odd)).len(), 1, "{odd}");
        }
    }

    #[test]
    fn every_mark_of_unfinished_work_is_found() {
        for mark in UNFINISHED {
            assert_eq!(unfinished(&format!("fn f() {{\n    {mark} \n}}")), [format!("line 2: {mark}")]);
        }
        assert_eq!(unfinished("fn ignored() { method(todo) }"), [""; 0]);
    }

    #[test]
    fn crates_must_forbid_unsafe_code() {
        let n_found = |root: &str, text: &str| forbids_unsafe(Path::new(root), text).len();
        assert_eq!(n_found("file.rs", "//! A crate.\n#![forbid(unsafe_code)]\n"), 0);
        assert_eq!(n_found("file.rs", "// #![forbid(unsafe_code)]\n"), 1);
        assert_eq!(n_found("file.rs", "#![deny(unsafe_code)]\n"), 1, "only the SIMD crate may deny it");
        assert_eq!(
            [n_found(UNSAFE_ROOTS[0], "#![deny(unsafe_code)]\n"), n_found(UNSAFE_ROOTS[0], "//! Lanes.\n")],
            [0, 1]
        );
    }

    #[test]
    fn unsafe_code_is_allowed_in_named_files_only() {
        let n_found = |file: &str, text: &str| allows_no_unsafe(Path::new(file), text).len();
        for line in
            [concat!("#![al", "low(unsafe_code)]"), concat!("    #[ex", "pect(unsafe_code, reason = \"fast\")]")]
        {
            assert_eq!(n_found("crates/wide/src/walk.rs", line), 1, "{line}");
            for file in UNSAFE_FILES.into_iter().chain(["benches/peers/foreign.rs"]) {
                assert_eq!(n_found(file, line), 0, "{file}: {line}");
            }
        }
        assert_eq!(n_found("crates/obb/src/lib.rs", "#![forbid(unsafe_code)]\n// #![expect(unsafe_code)]\n"), 0);
    }
}
