//! The program `canted`: pictures, statistics and batch queries through leaning boxes.
//!
//! One file a subcommand. Exit codes: 0 done, 1 the answer is no, 2 bad input or options, 130 interrupted.
#![forbid(unsafe_code)]

mod cast;
mod compare;
mod device;
mod devices;
mod interrupt;
mod left_out;
mod light;
mod load;
mod memory;
mod merge;
mod options;
mod output;
mod render;
mod scene;
mod settings;
mod stats;
mod tree;

use std::process::ExitCode;

use anyhow::Result;
use canted_renderer::RenderError;
use clap::{ArgMatches, FromArgMatches, Parser, Subcommand};

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
    /// Write a scene, and all that its picture is made by, as a file to change.
    Scene(Box<scene::Args>),
    /// What each volume strategy costs and buys.
    Stats(stats::Args),
    /// Answer a file of rays.
    Cast(cast::Args),
    /// Write Morton codes and tree topology, for checking.
    Tree(tree::Args),
    /// Compare two pictures.
    Compare(compare::Args),
    /// List what pictures and rays can be computed on.
    Devices(devices::Args),
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

/// Does what the command line asks for.
fn run(matches: &ArgMatches) -> Result<Outcome> {
    let cli = Cli::from_arg_matches(matches).unwrap_or_else(|error| error.exit());
    match cli.command {
        None => render::run(&options::defaults()),
        Some(Command::Render(args)) => render::run(&args),
        Some(Command::Scene(args)) => scene::run(&args, matches),
        Some(Command::Stats(args)) => stats::run(&args),
        Some(Command::Cast(args)) => cast::run(&args),
        Some(Command::Tree(args)) => tree::run(&args),
        Some(Command::Compare(args)) => compare::run(&args),
        Some(Command::Devices(args)) => devices::run(&args),
        Some(Command::Merge(args)) => merge::run(&args),
    }
}

fn main() -> ExitCode {
    interrupt::ends_the_process();
    match settings::command_line().and_then(|matches| run(&matches)) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::No) => ExitCode::from(1),
        Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => ExitCode::from(interrupt::CODE),
        Err(error) => {
            output::to_stderr(&format!("error: {error}"));
            ExitCode::from(2)
        }
    }
}
