//! `--device`: the same pictures as the CPU's, and what is refused.
//!
//! Not covered: hardware beside a software driver, which no test machine has.

mod choice;
mod needs;
mod pictures;

use canted_fixtures::or_skip;

use crate::support::Folder;

/// The best adapter's name; `None` with the sentence of a skipped test.
pub(crate) fn adapter(test: &str) -> Option<String> {
    let found = Folder::new().run("devices --json").done().json();
    let name = found["adapters"][0]["name"].as_str().map(str::to_owned);
    or_skip(test, name.ok_or("no adapter for device 'gpu'"))
}
