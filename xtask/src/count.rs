//! Counts tests from the output of `cargo test -- --show-output`.
//!
//! A test that misses a prerequisite passes as far as Cargo knows, and prints `skipped …`. Cargo shows output of passing tests
//! after the results of their program. So results of passing tests are held back until their program ends, and such tests
//! are shown as ignored.

use std::{fmt, mem};

/// Parts of error messages on machines without a GPU.
const WITHOUT_DEVICE: [&str; 2] = ["no adapter", "provides no device"];

/// Counts over all test programs of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    /// Tests that passed.
    pub(crate) passed: usize,
    /// Tests that failed.
    pub(crate) failed: usize,
    /// Tests that were ignored, or that miss a prerequisite.
    pub(crate) skipped: usize,
    /// Those of them that found no GPU.
    pub(crate) without_device: usize,
    /// Result lines of passing tests of the current program.
    held: Vec<String>,
    /// Whether the current line is output of a passing test.
    within_successes: bool,
    /// The passing test whose output is read.
    test: String,
    /// Passing tests of the current program that were skipped, with the reason.
    skips: Vec<(String, String)>,
}

impl Count {
    /// Reads the next line. Returns the lines to show now.
    ///
    /// Output of passing tests is hidden, except why they were skipped.
    pub(crate) fn take(&mut self, line: &str) -> Vec<String> {
        if let Some(result) = line.strip_prefix("test result: ") {
            return self.program(result);
        }
        match line {
            "successes:" => self.within_successes = true,
            "failures:" => self.within_successes = false,
            _ if self.within_successes => self.output(line),
            _ if passed(line).is_some() => {
                self.held.push(line.to_owned());
                return vec![];
            }
            // The previous program ended without a result.
            _ if line.starts_with("running ") => {
                return mem::take(&mut self.held).into_iter().chain([line.to_owned()]).collect();
            }
            _ => {}
        }
        if self.within_successes { vec![] } else { vec![line.to_owned()] }
    }

    /// Lines left to show where the last program ended without a result.
    pub(crate) fn rest(&mut self) -> Vec<String> {
        mem::take(&mut self.held)
    }

    /// A line that a passing test printed, or the heading of its output.
    fn output(&mut self, line: &str) {
        if let Some(test) = line.strip_prefix("---- ").and_then(|line| line.strip_suffix(" stdout ----")) {
            test.clone_into(&mut self.test);
        } else if let Some(reason) = canted_fixtures::skipped(line) {
            match self.skips.last_mut() {
                // A test that misses two devices reports the same reason twice.
                Some((test, reasons)) if *test == self.test && reasons.contains(reason) => {}
                Some((test, reasons)) if *test == self.test => *reasons = format!("{reasons}; {reason}"),
                _ => self.skips.push((self.test.clone(), reason.to_owned())),
            }
        }
    }

    /// Reads the last line of a test program: `ok. 3 passed; 0 failed; 1 ignored; …`. Returns its results.
    fn program(&mut self, result: &str) -> Vec<String> {
        let skips = mem::take(&mut self.skips);
        let (verdict, totals) = result.split_once(". ").unwrap_or_default();
        let (mut counts, mut totals) = ([0_usize; 3], totals.to_owned());
        for (count, name) in counts.iter_mut().zip(["passed", "failed", "ignored"]) {
            let number = totals.split("; ").find_map(|part| part.strip_suffix(name)?.trim().parse().ok());
            *count = number.unwrap_or(0);
        }
        let [passing, failed, ignored] = counts;
        let [passed_now, ignored_now] = [passing.saturating_sub(skips.len()), ignored + skips.len()];
        totals = totals.replacen(&format!("{passing} passed"), &format!("{passed_now} passed"), 1);
        totals = totals.replacen(&format!("{ignored} ignored"), &format!("{ignored_now} ignored"), 1);
        self.passed += passed_now;
        self.failed += failed;
        self.skipped += ignored_now;
        let lacks_device = |reason: &str| WITHOUT_DEVICE.iter().any(|words| reason.contains(words));
        self.without_device += skips.iter().filter(|(_, reason)| lacks_device(reason)).count();
        (self.within_successes, self.test) = (false, String::new());
        let shown = |line: String| match skips.iter().find(|(test, _)| passed(&line) == Some(test)) {
            Some((test, reason)) => format!("test {test} ... ignored, {reason}"),
            None => line,
        };
        let held = mem::take(&mut self.held).into_iter().map(shown);
        held.chain([String::new(), format!("test result: {verdict}. {totals}")]).collect()
    }
}

/// The test that a line reports as passed.
fn passed(line: &str) -> Option<&str> {
    line.strip_prefix("test ")?.strip_suffix(" ... ok")
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(output: &str) -> (Count, Vec<String>) {
        let mut count = Count::default();
        let mut shown: Vec<String> = output.lines().flat_map(|line| count.take(line)).collect();
        shown.extend(count.rest());
        (count, shown)
    }

    const TWO_PROGRAMS: &str = "\
running 4 tests
test a ... ok
test b ... ok
test c ... FAILED
test d ... ignored, no adapter

successes:

---- a stdout ----
a number

---- b stdout ----
skipped b: there is no folder models
skipped b: there is no folder models
skipped b of skies: there is no folder skies

successes:
    a
    b

failures:

---- c stdout ----
c is wrong
skipped c: not said where it counts

failures:
    c

test result: FAILED. 2 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s
running 1 test
test e ... ok

successes:

successes:
    e

test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s";

    #[test]
    fn programs_are_summed_and_skipped_tests_do_not_count_as_passed() {
        assert_eq!(count(TWO_PROGRAMS).0.to_string(), "2 passed, 1 failed, 2 skipped");
    }

    #[test]
    fn failures_and_skips_are_shown_and_output_of_passing_tests_is_not() {
        let (_, shown) = count(TWO_PROGRAMS);
        let shown: Vec<&str> = shown.iter().map(|line| &line[..]).filter(|line| !line.is_empty()).collect();
        let want = [
            "running 4 tests",
            "test c ... FAILED",
            "test d ... ignored, no adapter",
            "failures:",
            "---- c stdout ----",
            "c is wrong",
            "skipped c: not said where it counts",
            "failures:",
            "    c",
            "test a ... ok",
            "test b ... ignored, there is no folder models; there is no folder skies",
            "test result: FAILED. 1 passed; 1 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.00s",
            "running 1 test",
            "test e ... ok",
            "test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s",
        ];
        assert_eq!(shown, want);
    }

    /// A program killed by a signal prints no result.
    #[test]
    fn results_of_a_killed_program_are_shown() {
        let (count, shown) = count("running 2 tests\ntest a ... ok\nrunning 1 test\ntest b ... ok");
        assert_eq!(shown, ["running 2 tests", "test a ... ok", "running 1 test", "test b ... ok"]);
        assert_eq!(count.to_string(), "0 passed, 0 failed, 0 skipped");
    }

    #[test]
    fn tests_without_a_device_are_counted_separately() {
        let of = |reason: &str| {
            let said = format!("test x ... ok\nsuccesses:\n---- x stdout ----\nskipped x: {reason}");
            let (count, shown) = count(&format!("{said}\ntest result: ok. 1 passed; 0 failed; 0 ignored; 0 measured"));
            assert_eq!(shown[0], format!("test x ... ignored, {reason}"));
            (count.skipped, count.without_device)
        };
        assert_eq!(of("no adapter for device 'gpu': none found"), (1, 1));
        assert_eq!(of("adapter 'llvmpipe' provides no device: out of memory"), (1, 1));
        assert_eq!(of("there is no folder models"), (1, 0));
    }

    #[test]
    fn output_without_tests_counts_zero() {
        assert_eq!(count("error: could not compile").0.to_string(), "0 passed, 0 failed, 0 skipped");
    }
}
