//! The program `canted`: renders pictures, compares bounding volumes and traces batches of rays.
//!
//! [`main`] is the program. [`picture()`] renders as `canted render` does, with the same options, into memory: for bindings to other
//! languages.
//!
//! Each subcommand is one file. Exit codes: 0 success, 1 a comparison above its limit, 2 invalid input or options,
//! 130 interrupted. Modules depend on each other in one direction:
//! `settings -> {render, ...} -> {load, light, device} -> {options, output}`.
#![forbid(unsafe_code)]

mod cast;
mod compare;
mod device;
mod devices;
mod interrupt;
mod light;
mod load;
mod memory;
mod merge;
#[cfg(not(feature = "gpu"))]
mod no_gpu;
mod not_needed;
mod options;
mod output;
mod picture;
mod render;
mod scene;
mod settings;
mod stats;
mod tree;

use std::process::ExitCode;

use anyhow::Result;
use canted_renderer::RenderError;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

pub use picture::{Picture, Source, picture};

/// Ray tracing with oriented bounding boxes.
///
/// Without a subcommand, renders the built-in scene to canted.png.
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
    /// Write a scene file that contains every setting of a picture.
    Scene(Box<scene::Args>),
    /// Compare bounding-volume strategies.
    Stats(stats::Args),
    /// Trace rays from a file.
    Cast(cast::Args),
    /// Write Morton codes and the topology of the radix tree, for verification.
    Tree(tree::Args),
    /// Compare two pictures.
    Compare(compare::Args),
    /// List compute devices.
    Devices(devices::Args),
    /// Merge sample ranges of one picture.
    Merge(merge::Args),
}

fn run() -> Result<ExitCode> {
    let matches = settings::command_line(&Cli::command())?;
    match Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()).command {
        None => render::run(&options::defaults())?,
        Some(Command::Render(args)) => render::run(&args)?,
        Some(Command::Scene(args)) => scene::run(&args, &matches)?,
        Some(Command::Stats(args)) => stats::run(&args)?,
        Some(Command::Cast(args)) => cast::run(&args)?,
        Some(Command::Tree(args)) => tree::run(&args)?,
        Some(Command::Compare(args)) => return compare::run(&args),
        Some(Command::Devices(args)) => devices::run(&args)?,
        Some(Command::Merge(args)) => merge::run(&args)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the program with the arguments of this process. Installs handlers of signals.
#[must_use]
pub fn main() -> ExitCode {
    interrupt::install_handlers();
    run().unwrap_or_else(|error| {
        if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) {
            return ExitCode::from(interrupt::EXIT_CODE);
        }
        output::to_stderr(&format!("error: {error}"));
        ExitCode::from(2)
    })
}
