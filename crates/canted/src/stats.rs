//! `canted stats`: what each volume strategy costs and buys, in the layout of the dissertation's tables 3 to 5.

mod measure;
mod tables;

use std::path::PathBuf;

use anyhow::{Result, anyhow};

use crate::{Outcome, load, options, output};

/// Options of `canted stats`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF or GLB; the built-in one without it.
    scene: Option<PathBuf>,
    /// Number of threads; all processors without it.
    #[arg(long, value_parser = options::threads, value_name = "N")]
    threads: Option<usize>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Builds the scene with every strategy, in one level and in two, and prints the tables.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    options::use_threads(args.threads)?;
    let scene = load::scene(args.scene.as_deref())?;
    let name = load::name(args.scene.as_deref());
    let measured = measure::measure(&scene).map_err(|error| anyhow!("{name}: {error}"))?;
    let text = if args.json { tables::json(&name, &scene, &measured) } else { tables::text(&name, &scene, &measured) };
    output::to_stdout(&text);
    Ok(Outcome::Done)
}
