//! `canted-bench`: compares ours with the peers in one interleaved run and prints Markdown.
//!
//! `cargo xtask bench` runs it, and with `--keep` records what it prints; `cargo xtask report` runs it to write the report.

#![forbid(unsafe_code)]

mod blemishes;
mod bodies;
mod changes;
mod claims;
mod curves;
mod device;
mod kinds;
mod models;
mod motion;
mod nodes;
mod options;
mod picture;
mod records;
mod report;
mod tiles;
mod timing;
mod wide;

use std::io::Write;

use anyhow::Result;

use crate::options::Options;

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1).peekable();
    if args.next_if(|arg| arg == report::REPORT).is_some() {
        return report::run(args);
    }
    if args.next_if(|word| word == records::EXTREMES).is_some() {
        return records::extremes(args);
    }
    if args.next_if(|word| word == records::WATERTIGHT).is_some() {
        return records::watertight(args);
    }
    let options = Options::read(args)?;
    if options.is_trial() {
        return wide::trial(&options);
    }
    let mut out = String::new();
    if let Some(choice) = &options.device {
        device::section(choice, &options)?;
    }
    if options.wants("motion") {
        motion::section(&mut out, &options)?;
    }
    if options.wants("picture") {
        picture::section(&mut out)?;
    }
    if options.wants("nodes") {
        nodes::section(&mut out, &options)?;
    }
    if options.wants("wide") {
        wide::section(&mut out, &options)?;
    }
    if options.wants("bodies") {
        bodies::section(&mut out, &options)?;
        changes::section(&mut out, &options)?;
    }
    if options.wants("curves") {
        curves::section(&mut out, &options)?;
    }
    if options.wants("kinds") {
        kinds::section(&mut out, &options)?;
    }
    if options.wants(options::TREES) {
        #[cfg(feature = "peers")]
        kinds::trees::section(&mut out, &options)?;
        #[cfg(not(feature = "peers"))]
        anyhow::bail!("`{}` compares with Embree, which `--peers` adds", options::TREES);
    }
    if options.wants(options::TILES) {
        tiles::section(&mut out, &options)?;
    }
    if options.wants(options::CLAIMS) {
        claims::section(&mut out)?;
    }
    std::io::stdout().write_all(options.titled(&out).as_bytes())?;
    Ok(())
}
