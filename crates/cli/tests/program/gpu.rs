//! `--device`: pictures match those of the CPU, and unsupported requests are rejected.
//!
//! Not covered: machines with both hardware and a software driver.

mod pictures;
mod selection;
mod stats;
mod sums;

use canted_fixtures::or_skip;

use crate::support::Folder;

/// The name of the best adapter. Without one, reports the test as skipped.
pub(crate) fn adapter(test: &str) -> Option<String> {
    let found = Folder::new().run("devices --json").done().json();
    let name = found["adapters"][0]["name"].as_str().map(str::to_owned);
    or_skip(test, name.ok_or("no adapter for device 'gpu'"))
}
