//! `cargo xtask test`: every test of the workspace, counted.

use anyhow::Result;

use crate::{
    command::{self, say},
    count::Count,
    driver, workspace,
};

/// Runs all tests; the last line of the output is their count. Whether none failed.
pub(crate) fn run() -> Result<bool> {
    let (count, is_well) = count()?;
    say(&count.to_string());
    Ok(is_well)
}

/// Runs all tests, of every package to the end even where one fails; their count, and whether all is well.
pub(crate) fn count() -> Result<(Count, bool)> {
    let models = workspace::models();
    if !models.is_dir() {
        say(&format!("skipped tests of real models: there is no folder {} (set CANTED_SCENES)", models.display()));
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
        // A driver that is there and opens no device would let all tests of the GPU pass by doing nothing.
        let n = count.without_device;
        say(&format!("{n} tests of the GPU found no device though a driver is installed: counted as one failure"));
        count.failed += 1;
        return Ok((count, false));
    }
    if !is_well && count.failed == 0 {
        // A program that does not compile or that a signal ends names no test.
        count.failed = 1;
        say("cargo test failed outside of any test: counted as one");
    }
    Ok((count, is_well))
}
