//! `--replay`: a session without a window, whose pictures are files.

use std::{fs, path::Path};

use anyhow::{Result, anyhow};
use canted_film::Format;
use serde_json::{Value, json};

use super::{
    events::Event,
    frame::Seen,
    options::Options,
    script::{self, Timed},
    session::{Effect, Session},
};
use crate::output;

/// Applies the events of a file, waits after each until the picture is settled, and writes it to `folder`: event_001.png, ... in the
/// order of their times. Prints a line for each: the file, what a click shows, and the command that renders the picture.
///
/// The clock of the session stands still while a picture is rendered, so `at_s` gives the order and no time is spent waiting.
///
/// # Errors
/// One sentence that names the file and the event.
pub(super) fn run(options: Options, events: &Path, folder: &Path, as_json: bool) -> Result<()> {
    let timed = script::read(events)?;
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
    Ok(canted_film::write_picture(path, &frame.picture, Format::Png)?)
}

/// The first name of a screenshot in a folder that no file has.
#[cfg(feature = "view")]
pub(super) fn new_screenshot(folder: &Path) -> std::path::PathBuf {
    let name = |i: u32| folder.join(format!("canted_{i:03}.png"));
    (1..).map(name).find(|path| !path.exists()).unwrap_or_else(|| name(0))
}

/// What is at the position of a click: names and values.
pub(super) fn rows(seen: &Seen) -> Vec<(&'static str, String)> {
    let Seen { instance, primitive, t, barycentric: [u, v], texture, mesh, material } = seen;
    let mut rows = vec![
        ("instance", instance.to_string()),
        ("primitive", primitive.to_string()),
        ("t", t.to_string()),
        ("barycentric", format!("{u} {v}")),
    ];
    rows.extend(texture.map(|[u, v]| ("uv", format!("{u} {v}"))));
    rows.extend([("mesh", format!("{mesh:?}")), ("material", format!("{material:?}"))]);
    rows
}

/// What is at the position of a click, on one line.
fn described(seen: Option<&Seen>) -> String {
    let Some(seen) = seen else { return "nothing".to_owned() };
    rows(seen).into_iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
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
