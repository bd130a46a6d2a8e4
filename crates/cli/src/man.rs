//! `canted man`: manual pages, made of the help texts.

use anyhow::{Result, anyhow};
use clap::Command;
use clap_mangen::Man;

use crate::output;

/// Options of `canted man`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted man | man -l -\n  canted man render > canted-render.1")]
pub(crate) struct Args {
    /// Subcommand to describe [default: the program]
    command: Option<String>,
}

/// Prints the page in roff, the format of `man`.
///
/// # Errors
/// There is no such subcommand.
pub(crate) fn run(args: &Args, mut program: Command) -> Result<()> {
    program.build();
    let page = match &args.command {
        None => program,
        Some(name) => {
            let found = program.find_subcommand(name).cloned();
            found.ok_or_else(|| anyhow!("'{name}' is not a subcommand of canted; see `canted --help`"))?
        }
    };
    let mut text = Vec::new();
    Man::new(page).render(&mut text).map_err(|error| anyhow!("cannot write the page: {error}"))?;
    output::bytes_to_stdout(&text)
}
