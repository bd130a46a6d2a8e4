//! `canted-bench`: compares ours with the peers in one interleaved run and prints Markdown.
//!
//! `cargo xtask bench` runs it and writes `benches/RESULTS.md`; `cargo xtask report` runs it to write the report.

#![forbid(unsafe_code)]

mod bias;
mod build;
mod clock;
mod costs;
mod device;
mod extremes;
mod interleave;
mod kinds;
mod load;
mod models;
mod motion;
mod noise;
mod options;
mod picture;
mod report;
mod textures;
mod trace;
mod watertight;
mod wide;

use std::io::Write;

use anyhow::Result;

use crate::options::Options;

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1).peekable();
    if args.next_if(|arg| arg == report::REPORT).is_some() {
        return report::run(args);
    }
    if args.next_if(|word| word == extremes::EXTREMES).is_some() {
        return extremes::run(args);
    }
    if args.next_if(|word| word == watertight::WATERTIGHT).is_some() {
        return watertight::run(args);
    }
    let options = Options::read(args)?;
    if options.is_trial() {
        return wide::trial(&options);
    }
    if options.is_peak() {
        return load::print_peak(&options);
    }
    let mut out = String::new();
    if let Some(choice) = &options.device {
        device::section(&mut out, choice, &options)?;
    }
    if options.wants("load") {
        load::section(&mut out, options.rounds)?;
    }
    if options.wants("build") {
        build::section(&mut out, options.rounds)?;
    }
    if options.wants("motion") {
        motion::section(&mut out, &options)?;
    }
    if options.wants("trace") {
        trace::section(&mut out, options.rounds)?;
    }
    if options.wants("picture") {
        picture::section(&mut out)?;
    }
    if options.wants("textures") {
        textures::section(&mut out, options.rounds)?;
    }
    if options.wants("bias") {
        bias::section(&mut out)?;
    }
    if options.wants("noise") {
        noise::section(&mut out)?;
    }
    if options.wants("wide") {
        wide::section(&mut out, &options)?;
    }
    if options.wants("growth") {
        wide::growing(&mut out, &options)?;
    }
    if options.wants("kinds") {
        kinds::section(&mut out, &options)?;
    }
    if options.wants("costs") {
        costs::section(&mut out, &options)?;
    }
    std::io::stdout().write_all(options.titled(&out).as_bytes())?;
    Ok(())
}
