//! `canted man` and `canted completions`, made of the help texts, and what the help says of this build.

use anyhow::{Result, anyhow};
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;

use crate::output;

/// Options of `canted man`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted man | man -l -\n  canted man render > canted-render.1")]
pub(crate) struct ManArgs {
    /// Subcommand to describe [default: the program]
    command: Option<String>,
}

/// Prints the page in roff, the format of `man`.
///
/// # Errors
/// There is no such subcommand.
pub(crate) fn man(args: &ManArgs, mut program: Command) -> Result<()> {
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

/// Options of `canted completions`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted completions bash > ~/.local/share/bash-completion/completions/canted\n  \
                        canted completions zsh > ~/.zfunc/_canted")]
pub(crate) struct CompletionArgs {
    /// Shell.
    shell: Shell,
}

/// Prints the completions.
pub(crate) fn completions(args: &CompletionArgs, mut program: Command) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut program, "canted", &mut text);
    output::bytes_to_stdout(&text)
}

/// Cargo features by name, and whether this build has them.
fn cargo_features() -> Vec<(&'static str, bool)> {
    let own =
        [("gpu", cfg!(feature = "gpu")), ("baseline", cfg!(feature = "baseline")), ("view", cfg!(feature = "view"))];
    own.into_iter().chain(canted_scene::FEATURES.iter().copied()).collect()
}

/// The end of `canted --help`.
pub(crate) fn features() -> String {
    let names = |is_built: bool| {
        let names: Vec<&str> =
            cargo_features().iter().filter(|(_, built)| *built == is_built).map(|(name, _)| *name).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    };
    format!(
        "Examples:\n  canted helmet.glb\n  canted room.obj --integrator path --spp 256 -o room.exr\n\n\
         Features of this build: {}\nNot in this build: {}",
        names(true),
        names(false)
    )
}
