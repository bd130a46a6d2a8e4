//! `canted-bench`: measures ours beside the peers in one interleaved run and prints Markdown.
//!
//! `cargo xtask bench` runs it and writes `benches/RESULTS.md`.

#![forbid(unsafe_code)]

mod build;
mod interleave;
mod models;
mod picture;
mod trace;

use std::io::Write;

use anyhow::{Result, anyhow};

fn main() -> Result<()> {
    let mut rounds = 5;
    let mut sections = vec![];
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--rounds" => {
                let value = args.next().unwrap_or_default();
                rounds = value.parse().map_err(|_| anyhow!("--rounds '{value}' is not a number"))?;
            }
            "build" | "trace" | "picture" => sections.push(arg),
            _ => return Err(anyhow!("'{arg}' is neither build, trace, picture nor --rounds N")),
        }
    }
    let mut out = String::new();
    let wanted = |name: &str| sections.is_empty() || sections.iter().any(|section| section == name);
    if wanted("build") {
        build::section(&mut out, rounds)?;
    }
    if wanted("trace") {
        trace::section(&mut out, rounds)?;
    }
    if wanted("picture") {
        picture::section(&mut out)?;
    }
    std::io::stdout().write_all(out.as_bytes())?;
    Ok(())
}
