//! Counts of tests, from what `cargo test -- --show-output` prints.

use std::fmt;

/// Tests of all test programs of a run, and what of their output is worth showing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    /// Tests that ran and held.
    pub(crate) passed: usize,
    /// Tests that ran and did not hold.
    pub(crate) failed: usize,
    /// Tests that were ignored, or said that they lacked something.
    pub(crate) skipped: usize,
    /// Of those, tests that found no GPU.
    pub(crate) without_adapter: usize,
    /// Within what passing tests of the current program printed.
    within_successes: bool,
    /// Whether the current passing test has said that it was skipped.
    is_skipped: bool,
    /// Tests of the current program that ended as passed and said that they were skipped.
    said: usize,
}

impl Count {
    /// Takes the next line in; whether people should see it.
    ///
    /// Of what passing tests print only the lines are shown that tell of a skipped test.
    pub(crate) fn take(&mut self, line: &str) -> bool {
        if let Some(result) = line.strip_prefix("test result: ") {
            self.add(result);
            return true;
        }
        match line {
            "successes:" => self.within_successes = true,
            "failures:" => self.within_successes = false,
            _ if !self.within_successes => return true,
            _ if line.starts_with("---- ") && line.ends_with(" ----") => self.is_skipped = false,
            _ if tells_of_skipping(line) => {
                self.said += usize::from(!self.is_skipped);
                self.without_adapter += usize::from(!self.is_skipped && line.contains("no adapter"));
                self.is_skipped = true;
                return true;
            }
            _ => {}
        }
        !self.within_successes
    }

    /// Adds the totals of one test program: `ok. 3 passed; 0 failed; 1 ignored; …`.
    fn add(&mut self, result: &str) {
        let totals = result.split_once(". ").map_or("", |(_, totals)| totals);
        let total = |name: &str| -> usize {
            let number = totals.split("; ").find_map(|part| part.strip_suffix(name)?.trim().parse().ok());
            number.unwrap_or(0)
        };
        self.passed += total("passed").saturating_sub(self.said);
        self.failed += total("failed");
        self.skipped += total("ignored") + self.said;
        (self.within_successes, self.is_skipped, self.said) = (false, false, 0);
    }
}

/// The sentence of a test that lacked something: `skipped NAME: …`, or `NAME: skipped, …`.
fn tells_of_skipping(line: &str) -> bool {
    line.starts_with("skipped ") || line.contains(": skipped")
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(output: &str) -> (String, Vec<&str>) {
        let mut count = Count::default();
        let shown = output.lines().filter(|line| count.take(line)).collect();
        (count.to_string(), shown)
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
b: skipped, there is no folder models
b: skipped, there is no folder skies

successes:
    a
    b

failures:

---- c stdout ----
c is wrong; e: skipped

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
    fn programs_are_summed_and_a_test_that_skipped_has_not_passed() {
        assert_eq!(count(TWO_PROGRAMS).0, "2 passed, 1 failed, 2 skipped");
    }

    #[test]
    fn failures_and_skips_are_shown_and_the_chatter_of_passing_tests_is_not() {
        let (_, shown) = count(TWO_PROGRAMS);
        assert!(!shown.contains(&"a number"));
        assert!(shown.contains(&"b: skipped, there is no folder models"));
        assert!(shown.contains(&"c is wrong; e: skipped"));
        assert_eq!(shown.iter().filter(|line| line.starts_with("test result")).count(), 2);
    }

    #[test]
    fn tests_that_found_no_adapter_are_counted_apart() {
        let mut count = Count::default();
        for line in
            ["successes:", "---- x stdout ----", "skipped x: no adapter for device 'gpu': this machine shows none"]
        {
            count.take(line);
        }
        assert_eq!(count.without_adapter, 1);
    }

    #[test]
    fn no_program_is_no_test() {
        assert_eq!(count("error: could not compile").0, "0 passed, 0 failed, 0 skipped");
    }
}
