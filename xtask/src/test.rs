//! `cargo xtask test`: runs and counts all tests of the workspace, then those of the Python package and of the example in a browser.

use anyhow::Result;

use crate::{
    browser,
    command::{self, say},
    count::Count,
    driver, python, workspace,
};

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
    let has_driver = driver::ensure();
    let mut count = Count::default();
    let mut cargo = command::cargo(&["test", "--workspace", "--no-fail-fast", "--", "--show-output"]);
    driver::quieten(&mut cargo);
    let is_well = command::for_each_line(&mut cargo, |line| {
        count.take(line).iter().for_each(|line| say(line));
    })?;
    count.rest().iter().for_each(|line| say(line));
    if has_driver && count.without_device > 0 {
        // With a driver that opens no device, all GPU tests would pass without testing anything.
        let n = count.without_device;
        say(&format!("{n} GPU tests found no device although a driver is installed: counted as one failure"));
        count.failed += 1;
        python::test(&mut count)?;
        browser::test(&mut count)?;
        return Ok((count, false));
    }
    if !is_well && count.failed == 0 {
        // A program that does not compile, or is killed by a signal, names no test.
        count.failed = 1;
        say("cargo test failed outside of any test: counted as one failure");
    }
    let is_well = python::test(&mut count)? && is_well;
    let is_well = browser::test(&mut count)? && is_well;
    Ok((count, is_well))
}
