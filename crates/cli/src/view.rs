//! `canted view`: a scene to look at, in a window or by recorded events.
//!
//! ```text
//! window | script -> events -> session -> worker -> passes (coarse, refine) -> stage -> traced -> device
//! ```

mod channel;
mod device;
mod events;
mod frame;
mod motion;
mod options;
mod passes;
mod refine;
mod replay;
mod script;
mod session;
mod stage;
mod traced;
#[cfg(feature = "view")]
mod window;
mod worker;

use std::path::PathBuf;

use anyhow::Result;
use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches};

use crate::{options as shared, settings};
use options::Options;

/// Options of `canted view`: those of `canted render` that determine a picture on the screen, and its own.
pub(crate) struct Args {
    scene: Option<PathBuf>,
    /// Name and value of each option of `canted render`.
    words: Vec<(String, String)>,
    threads: Option<usize>,
    replay: Option<PathBuf>,
    frames: Option<PathBuf>,
    json: bool,
}

const EXAMPLES: &str = "Examples:\n  canted view helmet.glb --size 960x540\n  canted view --replay events.toml --frames pictures\n\n\
    Drag to orbit, with the right button to pan; scroll to zoom; w a s d q e to fly; home for the first view.\n\
    Keys: h heat map, i integrator, v channel, x structure, b boxes, p screenshot, c copy as command.";

const DEVICE: &str = "Compute device: cpu, gpu, auto, or part of an adapter name (see `canted devices`). The CPU renders coarse pictures, \
                      heat maps and what the device does not support";

/// Not derived: the options are some of those of [`crate::render::Args`].
impl clap::Args for Args {
    fn augment_args(command: Command) -> Command {
        let render = settings::render_command();
        let is_ours = |arg: &&Arg| {
            let id = arg.get_id().as_str();
            options::is_option(id) || ["scene", "threads", "json", "time", "animation"].contains(&id)
        };
        let shared = render.get_arguments().filter(is_ours).cloned().map(|arg| match arg.get_id().as_str() {
            "device" => arg.default_value("cpu").help(DEVICE),
            _ => arg,
        });
        let path = |name: &'static str, value: &'static str| {
            Arg::new(name)
                .long(name)
                .value_name(value)
                .value_parser(clap::value_parser!(PathBuf))
                .help_heading("Replay")
        };
        let replay = path("replay", "EVENTS.toml")
            .requires("frames")
            .help("Apply the events of a file, without a window; the format is in docs/view.md");
        let frames =
            path("frames", "DIR").requires("replay").help("Folder for a picture after each event: event_001.png, ...");
        command.args(shared).args([replay, frames]).after_help(EXAMPLES)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Args {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let path = |id: &str| matches.try_get_one::<PathBuf>(id).ok().flatten().cloned();
        let given = settings::render_command();
        let ids = given.get_arguments().filter(|arg| !matches!(arg.get_action(), ArgAction::SetTrue));
        let ids = ids.map(|arg| arg.get_id().as_str()).filter(|id| options::is_option(id) && *id != "scene");
        let mut words = Vec::new();
        for id in ids.filter(|id| settings::is_given(matches, id)) {
            let values = matches.get_raw(id).into_iter().flatten();
            words.extend(values.map(|value| (id.to_owned(), value.to_string_lossy().into_owned())));
        }
        Ok(Self {
            scene: path("scene"),
            words,
            threads: matches.try_get_one::<usize>("threads").ok().flatten().copied(),
            replay: path("replay"),
            frames: path("frames"),
            json: matches.get_flag("json"),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Opens the window, or replays events.
pub(crate) fn run(args: Args) -> Result<()> {
    let Args { scene, words, threads, replay, frames, json } = args;
    let options = Options::new(scene, words)?;
    shared::use_threads(threads)?;
    if let (Some(events), Some(folder)) = (replay, frames) {
        return replay::run(options, &events, &folder, json);
    }
    open(options)
}

#[cfg(feature = "view")]
fn open(options: Options) -> Result<()> {
    window::run(options)
}

#[cfg(not(feature = "view"))]
fn open(_: Options) -> Result<()> {
    Err(anyhow::anyhow!(
        "this build has no window; use `cargo run --release --features view -- view`, or --replay EVENTS.toml --frames DIR"
    ))
}
