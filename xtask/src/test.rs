//! `cargo xtask test`: runs and counts all tests of the workspace, then those of the Python package and of the example in a browser.

use std::fmt;

use anyhow::Result;

use crate::{
    browser,
    command::{self, say},
    driver, python, workspace,
};

/// Numbers of tests.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    pub(crate) passed: usize,
    pub(crate) failed: usize,
    /// Tests that were ignored.
    pub(crate) skipped: usize,
}

impl Count {
    /// Adds the numbers of a line like `test result: ok. 3 passed; 0 failed; 1 ignored; ...`; other lines have none.
    fn add(&mut self, line: &str) {
        let Some((_, totals)) = line.strip_prefix("test result: ").and_then(|result| result.split_once(". ")) else {
            return;
        };
        for part in totals.split("; ") {
            let Some((n, kind)) = part.split_once(' ') else { continue };
            let n = n.parse().unwrap_or(0);
            match kind {
                "passed" => self.passed += n,
                "failed" => self.failed += n,
                "ignored" => self.skipped += n,
                _ => {}
            }
        }
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

/// Runs all tests and prints their count last. Returns whether none failed.
pub(crate) fn run() -> Result<bool> {
    let (count, is_well) = count()?;
    say(&count.to_string());
    Ok(is_well)
}

/// Runs all tests of all packages, also after a failure. Returns their count and whether all passed.
pub(crate) fn count() -> Result<(Count, bool)> {
    let models = workspace::models();
    if !models.is_dir() {
        say(&format!("skipped tests of real models: no folder {} (set CANTED_SCENES)", models.display()));
    }
    let mut cargo = command::cargo(&["test", "--workspace", "--no-fail-fast"]);
    if driver::ensure() {
        // With a driver that opens no device, tests of devices would be ignored one and all.
        cargo.env("CANTED_REQUIRE_DEVICE", "1");
    }
    driver::quieten(&mut cargo);
    let mut count = Count::default();
    let is_well = command::for_each_line(&mut cargo, |line| {
        count.add(line);
        say(line);
    })?;
    if !is_well && count.failed == 0 {
        // A program that does not compile, or is killed by a signal, names no test.
        count.failed = 1;
        say("cargo test failed outside of any test: counted as one failure");
    }
    let is_well = python::test(&mut count)? && is_well;
    let is_well = browser::test(&mut count)? && is_well;
    Ok((count, is_well))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_programs_are_summed() {
        let mut count = Count::default();
        for line in [
            "running 4 tests",
            "test a ... ok",
            "test result: FAILED. 2 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s",
            "test result: ok. 30 passed; 0 failed; 5 ignored; 0 measured; 0 filtered out; finished in 1.2s",
            "error: could not compile",
        ] {
            count.add(line);
        }
        assert_eq!(count.to_string(), "32 passed, 1 failed, 6 skipped");
    }
}
