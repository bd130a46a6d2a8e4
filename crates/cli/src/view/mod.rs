//! `canted view`: a scene to look at, in a window or by recorded events.
//!
//! ```text
//! window | events of a file -> session (options, camera) -> job -> passes (coarse, refined) -> frame
//! ```

mod events;
mod frame;
mod motion;
mod options;
mod passes;
mod scene;
mod session;
#[cfg(feature = "view")]
mod window;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::Format;
use serde_json::{Value, json};

use crate::{
    options::{self as shared, Given},
    output,
    settings::PictureArgs,
};
use events::{Event, Timed};
use frame::Seen;
use options::{Options, ScreenArgs, SessionArgs};
use session::{Effect, Session};

/// Options of `canted view`: those of `canted render` that determine a picture on the screen, and its own.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(flatten)]
    picture: PictureArgs<ViewArgs>,
    #[command(flatten)]
    replay: ReplayArgs,
}

/// How the session runs.
#[derive(clap::Args, Clone)]
struct ViewArgs {
    #[command(flatten)]
    screen: Given<ScreenArgs>,
    /// Number of CPU threads [default: all]
    #[arg(long, help_heading = "Run", value_parser = shared::threads, value_name = "N")]
    threads: Option<usize>,
    /// Print the report as JSON.
    #[arg(long, help_heading = "Run")]
    json: bool,
}

/// A session without a window.
#[derive(clap::Args)]
#[command(next_help_heading = "Replay", next_display_order = 120)]
struct ReplayArgs {
    /// Apply the events of a file, without a window; the format is in docs/view.md
    #[arg(long, value_name = "EVENTS.toml", requires = "frames")]
    replay: Option<PathBuf>,
    /// Folder for a picture after each event: event_001.png, ...
    #[arg(long, value_name = "DIR", requires = "replay")]
    frames: Option<PathBuf>,
}

const EXAMPLES: &str = "Examples:\n  canted view helmet.glb --size 960x540\n  canted view --replay events.toml --frames pictures\n\n\
    Drag to orbit, with the right button to pan; scroll to zoom; w a s d q e to fly; home for the first view.\n\
    Keys: h heat map, i integrator, v channel, x structure, b boxes, p screenshot, c copy as command.";

/// Opens the window, or replays events.
pub(crate) fn run(args: Args) -> Result<()> {
    let PictureArgs { source, own, options, camera, light, structure } = args.picture;
    let ViewArgs { screen, threads, json } = own;
    let options = Options::new(SessionArgs { source, own: screen, options, camera, light, structure })?;
    shared::use_threads(threads)?;
    match (args.replay.replay, args.replay.frames) {
        (Some(events), Some(folder)) => replay(options, &events, &folder, json),
        _ => open(options),
    }
}

#[cfg(feature = "view")]
fn open(options: Options) -> Result<()> {
    window::run(options)
}

#[cfg(not(feature = "view"))]
fn open(_: Options) -> Result<()> {
    Err(anyhow!(
        "this build has no window; use `cargo run --release --features view -- view`, or --replay EVENTS.toml --frames DIR"
    ))
}

/// Applies the events of a file, waits after each until the picture is settled, and writes it to `folder`: event_001.png, ... in the
/// order of their times. Prints a line for each: the file, what a click shows, and the command that renders the picture.
///
/// The clock of the session stands still while a picture is rendered, so `at_s` gives the order and no time is spent waiting.
///
/// # Errors
/// One sentence that names the file and the event.
fn replay(options: Options, events: &Path, folder: &Path, as_json: bool) -> Result<()> {
    let timed = events::read(events)?;
    // A file that cannot be read is reported before what its events contain.
    if let Some(scene) = options.scene() {
        fs::File::open(scene).map_err(|error| anyhow!("{}: cannot read file: {error}", scene.display()))?;
    }
    let named = |number: usize, error: anyhow::Error| anyhow!("{}: event {number}: {error}", events.display());
    // Options that are unknown or invalid are reported before anything is rendered.
    let mut changed = options.clone();
    for Timed { event, number, .. } in &timed {
        if let Event::Set(changes) = event {
            changed.set_all(changes).map_err(|error| named(*number, error))?;
        }
    }
    fs::create_dir_all(folder).map_err(|error| anyhow!("cannot create the folder {}: {error}", folder.display()))?;
    output::probe(&folder.join("event_001.png"))?;
    let mut session = Session::start(options, Box::new(|| {}))?;
    session.ready()?;
    let mut n_screenshots = 0;
    for (i, Timed { at_s, event, number }) in timed.iter().enumerate() {
        session.seen = None;
        let effect = session.apply(event).map_err(|error| named(*number, error))?;
        session.settle().map_err(|error| named(*number, error))?;
        let path = folder.join(format!("event_{:03}.png", i + 1));
        save(&session, &path)?;
        if effect == Effect::Screenshot {
            n_screenshots += 1;
            save(&session, &folder.join(format!("screenshot_{n_screenshots:03}.png")))?;
        }
        report(*number, *at_s, &path, event, &session, as_json)?;
        if effect == Effect::Close {
            break;
        }
    }
    Ok(())
}

/// Writes the picture as `canted render` does.
fn save(session: &Session, path: &Path) -> Result<()> {
    let frame = session.frame.as_ref().ok_or_else(|| anyhow!("there is no picture yet"))?;
    Ok(canted_film::write_picture(path, &frame.picture, None, Format::Png)?)
}

/// What is at the position of a click, on one line.
fn described(seen: Option<&Seen>) -> String {
    let Some(seen) = seen else { return "nothing".to_owned() };
    seen.rows().into_iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
}

fn report(number: usize, at_s: f64, path: &Path, event: &Event, session: &Session, as_json: bool) -> Result<()> {
    let (seen, is_click) = (session.seen.as_ref(), matches!(event, Event::Click(_)));
    let command = session.command();
    if as_json {
        let mut fact =
            json!({ "event": number, "at_s": at_s, "picture": path.display().to_string(), "command": command });
        if is_click {
            fact["hit"] = seen.map_or(Value::Null, |seen| {
                json!({
                    "instance": seen.instance,
                    "primitive": seen.primitive,
                    "t": seen.t,
                    "barycentric": seen.barycentric,
                    "uv": seen.texture,
                    "mesh": seen.mesh,
                    "material": seen.material,
                })
            });
        }
        return output::to_stdout(&fact.to_string());
    }
    if output::is_quiet() {
        return Ok(());
    }
    let hit = if is_click { format!("  {}", described(seen)) } else { String::new() };
    output::to_stdout(&format!("{}  event {number} at {at_s} s{hit}  {command}", path.display()))
}
