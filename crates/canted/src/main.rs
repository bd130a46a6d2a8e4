//! The program `canted`: pictures, statistics and batch queries through leaning boxes.
//!
//! One file a subcommand. Exit codes: 0 done, 1 the answer is no, 2 bad input or options, 130 interrupted.
#![forbid(unsafe_code)]

mod cast;
mod compare;
mod interrupt;
mod light;
mod load;
mod memory;
mod merge;
mod options;
mod output;
mod render;
mod stats;
mod tree;

use std::process::ExitCode;

use canted_renderer::RenderError;
use clap::{Parser, Subcommand};

/// Ray tracing with oriented bounding boxes: boxes that lean with the geometry.
///
/// Without a subcommand it renders the built-in scene into canted.png.
#[derive(Parser)]
#[command(name = "canted", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Render a picture.
    Render(Box<render::Args>),
    /// What each volume strategy costs and buys.
    Stats(stats::Args),
    /// Answer a file of rays.
    Cast(cast::Args),
    /// Write Morton codes and tree topology, for checking.
    Tree(tree::Args),
    /// Compare two pictures.
    Compare(compare::Args),
    /// Merge parts of the samples of a picture, made apart, into one.
    Merge(merge::Args),
}

/// How a run that was not an error ended.
pub(crate) enum Outcome {
    /// What was asked for was done.
    Done,
    /// The answer to the question is no.
    No,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        None => render::run(&render::Args::built_in()),
        Some(Command::Render(args)) => render::run(&args),
        Some(Command::Stats(args)) => stats::run(&args),
        Some(Command::Cast(args)) => cast::run(&args),
        Some(Command::Tree(args)) => tree::run(&args),
        Some(Command::Compare(args)) => compare::run(&args),
        Some(Command::Merge(args)) => merge::run(&args),
    };
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::No) => ExitCode::from(1),
        Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => ExitCode::from(130),
        Err(error) => {
            output::to_stderr(&format!("error: {error}"));
            ExitCode::from(2)
        }
    }
}
