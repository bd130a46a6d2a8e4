//! `canted-bench`: measures ours beside the peers in one interleaved run and prints Markdown.
//!
//! `cargo xtask bench` runs it and writes `benches/RESULTS.md`.

mod build;
mod interleave;
mod models;
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
            "build" | "trace" => sections.push(arg),
            _ => return Err(anyhow!("'{arg}' is neither build, trace nor --rounds N")),
        }
    }
    let mut out = String::new();
    for section in if sections.is_empty() { vec!["build".to_owned(), "trace".to_owned()] } else { sections } {
        match section.as_str() {
            "build" => build::section(&mut out, rounds)?,
            _ => trace::section(&mut out, rounds)?,
        }
    }
    std::io::stdout().write_all(out.as_bytes())?;
    Ok(())
}
