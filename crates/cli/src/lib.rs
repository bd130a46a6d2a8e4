//! The program `canted`: renders pictures, compares bounding volumes and traces batches of rays.
//!
//! [`main`] is the program. [`picture()`] renders as `canted render` does, with the same options, into memory: for bindings to other
//! languages.
//!
//! Each subcommand is one module. Exit codes: 0 success, 1 a comparison above its limit, 2 invalid input or options,
//! 130 interrupted. Modules depend on each other in one direction:
//! `{render, ...} -> settings -> {load, light, camera, device} -> {options, output}`.
#![forbid(unsafe_code)]

mod camera;
mod cast;
mod command_line;
mod compare;
mod device;
mod light;
mod load;
mod merge;
mod options;
mod output;
mod pages;
mod picture;
mod process;
mod render;
mod scene;
mod settings;
mod stats;
mod tiles;
mod tree;
mod view;

use std::process::ExitCode;

use anyhow::Result;
use canted_renderer::RenderError;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use command_line::{Words, picture_of};
pub use picture::{Picture, Source, picture, picture_part};

/// Ray tracing with oriented bounding boxes.
///
/// `canted FILE` renders a file to a picture of the same name in the current folder, `canted` alone the built-in scene to canted.png.
#[derive(Parser)]
#[command(
    name = "canted",
    version,
    override_usage = "canted [FILE] [OPTIONS of render]\n       canted <COMMAND> [OPTIONS]",
    after_help = pages::features()
)]
struct Cli {
    /// Print results and errors only: no warnings, no progress, no report of `render` as text.
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = "Messages", display_order = 1000)]
    quiet: bool,
    /// Print each stage with its time to standard error.
    #[arg(short, long, global = true, help_heading = "Messages", display_order = 1001)]
    verbose: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Render a picture.
    Render(Box<render::Args>),
    /// Look at a scene in a window, or replay events.
    View(Box<view::Args>),
    /// Write a scene file that contains every setting of a picture.
    Scene(Box<scene::Args>),
    /// Compare bounding-volume strategies.
    Stats(stats::Args),
    /// Trace rays from a file.
    Cast(cast::Args),
    /// Write a store of tiles, for scenes larger than memory.
    Tiles(tiles::Args),
    /// Write Morton codes and the topology of the radix tree, for verification.
    Tree(tree::Args),
    /// Compare two pictures.
    Compare(compare::Args),
    /// List compute devices.
    Devices(device::DevicesArgs),
    /// Merge sample ranges of one picture.
    Merge(merge::Args),
    /// Print completions of the command line for a shell.
    Completions(pages::CompletionArgs),
    /// Print a manual page.
    Man(pages::ManArgs),
}

fn run() -> Result<ExitCode> {
    let words = Words::of_process(&Cli::command());
    let matches = words.parse(Cli::command());
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    output::set_verbosity(cli.quiet, cli.verbose);
    match cli.command {
        None => render::run(options::defaults())?,
        Some(Command::Render(mut args)) => {
            if let Some(file) = words.file() {
                args.own.default_output = picture_of(file);
            }
            render::run(*args)?;
        }
        Some(Command::View(args)) => view::run(*args)?,
        Some(Command::Scene(args)) => scene::run(*args)?,
        Some(Command::Stats(args)) => stats::run(&args)?,
        Some(Command::Cast(args)) => cast::run(&args)?,
        Some(Command::Tiles(args)) => tiles::run(&args)?,
        Some(Command::Tree(args)) => tree::run(&args)?,
        Some(Command::Compare(args)) => return compare::run(&args),
        Some(Command::Devices(args)) => device::list(&args)?,
        Some(Command::Merge(args)) => merge::run(&args)?,
        Some(Command::Completions(args)) => pages::completions(&args, Cli::command())?,
        Some(Command::Man(args)) => pages::man(&args, Cli::command())?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the program with the arguments of this process. Installs handlers of signals.
#[must_use]
pub fn main() -> ExitCode {
    process::set_runtime_folder();
    process::install_handlers();
    run().unwrap_or_else(|error| {
        if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) {
            return ExitCode::from(process::EXIT_CODE);
        }
        output::to_stderr(&format!("error: {error}"));
        ExitCode::from(2)
    })
}
