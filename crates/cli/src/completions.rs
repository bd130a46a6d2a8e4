//! `canted completions`: completions of the command line for a shell.

use anyhow::Result;
use clap::Command;
use clap_complete::Shell;

use crate::output;

/// Options of `canted completions`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted completions bash > ~/.local/share/bash-completion/completions/canted\n  \
                        canted completions zsh > ~/.zfunc/_canted")]
pub(crate) struct Args {
    /// Shell.
    shell: Shell,
}

/// Prints the completions.
pub(crate) fn run(args: &Args, mut program: Command) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut program, "canted", &mut text);
    output::bytes_to_stdout(&text)
}
