//! What a person does to a session, and events from a TOML file, for `--replay`.

use std::{fs, path::Path};

use anyhow::{Result, anyhow};
use toml::{Table, Value};

use crate::options::{Form as _, Size};

/// A button of the mouse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Button {
    /// Orbits.
    Left,
    /// Pans.
    Right,
}

/// An input event. Positions are in pixels of the picture from its top left corner, x to the right and y down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Event {
    /// The pointer moved while a button was down.
    Drag {
        from: [f64; 2],
        to: [f64; 2],
        button: Button,
    },
    /// The wheel turned by this many notches; positive moves towards the scene.
    Scroll(f64),
    Key(Key),
    /// Shows what is at a position.
    Click([f64; 2]),
    /// The new size of the picture in pixels.
    Resize([u32; 2]),
    /// Sets options by name.
    Set(Vec<(String, String)>),
    Close,
}

/// A key with a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Key {
    /// Moves eye and target by the signs along right, up and forward.
    Fly([i8; 3]),
    /// Orbits by the signs: to the right, up.
    Orbit([i8; 2]),
    /// Zooms in (1) or out (-1).
    Zoom(i8),
    /// Returns to the first view.
    Home,
    NextHeatmap,
    NextIntegrator,
    NextChannel,
    NextStructure,
    NextBoxes,
    Screenshot,
    Copy,
    Close,
}

/// Keys by name; those of a single character are also what a keyboard types.
pub(crate) const KEYS: [(&str, Key); 23] = [
    ("w", Key::Fly([0, 0, 1])),
    ("s", Key::Fly([0, 0, -1])),
    ("a", Key::Fly([-1, 0, 0])),
    ("d", Key::Fly([1, 0, 0])),
    ("q", Key::Fly([0, -1, 0])),
    ("e", Key::Fly([0, 1, 0])),
    ("left", Key::Orbit([-1, 0])),
    ("right", Key::Orbit([1, 0])),
    ("up", Key::Orbit([0, 1])),
    ("down", Key::Orbit([0, -1])),
    ("plus", Key::Zoom(1)),
    ("+", Key::Zoom(1)),
    ("minus", Key::Zoom(-1)),
    ("-", Key::Zoom(-1)),
    ("home", Key::Home),
    ("h", Key::NextHeatmap),
    ("i", Key::NextIntegrator),
    ("v", Key::NextChannel),
    ("x", Key::NextStructure),
    ("b", Key::NextBoxes),
    ("p", Key::Screenshot),
    ("c", Key::Copy),
    ("escape", Key::Close),
];

impl Key {
    /// The key of this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        KEYS.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|&(_, key)| key)
    }
}

/// An event at a time of the session in seconds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Timed {
    pub(super) at_s: f64,
    pub(super) event: Event,
    /// Its place in the file, from 1.
    pub(super) number: usize,
}

/// The keys of an event besides `at_s` and `button`: each is an action.
const ACTIONS: [&str; 7] = ["drag", "scroll", "key", "click", "resize", "set", "close"];

/// Reads events in the order of their times; events at one time keep the order of the file.
///
/// # Errors
/// One sentence with file, event and value.
pub(super) fn read(path: &Path) -> Result<Vec<Timed>> {
    let text = fs::read_to_string(path).map_err(|error| anyhow!("cannot read {}: {error}", path.display()))?;
    parse(&text).map_err(|reason| anyhow!("{}: {reason}", path.display()))
}

fn parse(text: &str) -> Result<Vec<Timed>, String> {
    let document: Table = toml::from_str(text).map_err(|error: toml::de::Error| {
        let line = 1 + error.span().map_or(0, |span| text[..span.start.min(text.len())].matches('\n').count());
        format!("line {line}: {}", error.message().split_whitespace().collect::<Vec<_>>().join(" "))
    })?;
    if let Some(key) = document.keys().find(|key| *key != "event") {
        return Err(format!("unknown key '{}'; the file is an array [[event]]", key.escape_debug()));
    }
    const NO_TABLES: &str = "'event' is not an array of tables; write [[event]]";
    let all = document.get("event").ok_or("no [[event]] in the file")?.as_array().ok_or(NO_TABLES)?;
    let tables = all.iter().map(Value::as_table).collect::<Option<Vec<&Table>>>().ok_or(NO_TABLES)?;
    let mut events = Vec::new();
    for (i, table) in tables.into_iter().enumerate() {
        let (at_s, event) = one(table).map_err(|reason| format!("event {}: {reason}", i + 1))?;
        events.push(Timed { at_s, event, number: i + 1 });
    }
    events.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    let close = events.iter().position(|timed| timed.event == Event::Close);
    if let Some(after) = close.and_then(|at| events.get(at + 1)) {
        return Err(format!("event {}: it comes after the close", after.number));
    }
    Ok(events)
}

/// One event and its time.
fn one(table: &Table) -> Result<(f64, Event), String> {
    let is_known = |key: &str| ["at_s", "button"].contains(&key) || ACTIONS.contains(&key);
    if let Some((key, _)) = table.iter().find(|(key, _)| !is_known(key)) {
        return Err(format!("unknown key '{}'; use at_s and one of {}", key.escape_debug(), ACTIONS.join(", ")));
    }
    let at_s = table.get("at_s").ok_or("at_s is missing: the time in seconds")?;
    let at_s = number(at_s).filter(|&at_s| at_s >= 0.0).ok_or_else(|| invalid("at_s", at_s, "a time of at least 0"))?;
    let actions: Vec<&str> = ACTIONS.into_iter().filter(|action| table.contains_key(*action)).collect();
    let [action] = actions[..] else {
        return Err(match actions[..] {
            [] => format!("no action; use one of {}", ACTIONS.join(", ")),
            _ => format!("{} actions, {}; an event has one", actions.len(), actions.join(" and ")),
        });
    };
    let button = match table.get("button") {
        None => Button::Left,
        Some(_) if action != "drag" => return Err("button requires drag".to_owned()),
        Some(item) => match item.as_str() {
            Some("left") => Button::Left,
            Some("right" | "middle") => Button::Right,
            _ => return Err(invalid("button", item, "\"left\", \"middle\" or \"right\"")),
        },
    };
    let item = table.get(action).ok_or("no action")?;
    let event = match action {
        "drag" => {
            let [x0, y0, x1, y1] = numbers(item).ok_or_else(|| invalid(action, item, "[x0, y0, x1, y1]"))?;
            Event::Drag { from: [x0, y0], to: [x1, y1], button }
        }
        "scroll" => Event::Scroll(number(item).ok_or_else(|| invalid(action, item, "a number of notches"))?),
        "key" => Event::Key(item.as_str().and_then(Key::named).ok_or_else(|| {
            let names: Vec<&str> = KEYS.iter().map(|&(name, _)| name).collect();
            invalid(action, item, &format!("one of {}", names.join(", ")))
        })?),
        "click" => Event::Click(numbers(item).ok_or_else(|| invalid(action, item, "[x, y]"))?),
        "resize" => Event::Resize(size(item).map_err(|reason| format!("resize = {}: {reason}", shown(item)))?),
        "set" => Event::Set(changes(item)?),
        _ => match item.as_bool() {
            Some(true) => Event::Close,
            _ => return Err(invalid(action, item, "true")),
        },
    };
    Ok((at_s, event))
}

/// Width and height, within the limits of `--size`.
fn size(item: &Value) -> Result<[u32; 2], String> {
    let sides = item.as_array().filter(|array| array.len() == 2).ok_or("expected [w, h]")?;
    let sides: Option<Vec<String>> = sides.iter().map(|side| side.as_integer().map(|n| n.to_string())).collect();
    Size::parse(&sides.ok_or("expected two whole numbers")?.join("x"))
}

/// The options of `set` with their values as text.
fn changes(item: &Value) -> Result<Vec<(String, String)>, String> {
    let table = item.as_table().ok_or_else(|| invalid("set", item, "{ option = \"value\" }"))?;
    if table.is_empty() {
        return Err("set = { } sets nothing".to_owned());
    }
    let change = |(key, item): (&String, &Value)| {
        let text = match item {
            Value::String(text) => text.clone(),
            Value::Integer(n) => n.to_string(),
            Value::Float(x) => x.to_string(),
            _ => return Err(format!("set: {key} = {} is not text or a number", shown(item))),
        };
        Ok((key.clone(), text))
    };
    table.iter().map(change).collect()
}

/// A finite number, whole or not.
fn number(value: &Value) -> Option<f64> {
    let number = value.as_float().or_else(|| value.as_integer().map(|n| n as f64))?;
    number.is_finite().then_some(number)
}

fn numbers<const N: usize>(item: &Value) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = item.as_array()?.iter().map(number).collect();
    numbers?.try_into().ok()
}

/// A value as it may stand in the source, on one line.
fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => format!("{text:?}"),
        Value::Integer(n) => n.to_string(),
        Value::Float(x) => x.to_string(),
        Value::Boolean(is_true) => is_true.to_string(),
        Value::Datetime(_) => "a date".to_owned(),
        Value::Array(array) => format!("[{}]", array.iter().map(shown).collect::<Vec<_>>().join(", ")),
        Value::Table(_) => "a table".to_owned(),
    }
}

fn invalid(key: &str, item: &Value, expected: &str) -> String {
    format!("{key} = {} is not {expected}", shown(item))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_sorted_by_time() {
        let text = "[[event]]\nat_s = 2\nclose = true\n[[event]]\nat_s = 0.5\ndrag = [1, 2.5, 3, 4]\nbutton = \"right\"\n\
                    [[event]]\nat_s = 0.5\nset = { spp = 4, tone_map = \"agx\" }\n";
        let events = parse(text).unwrap();
        let drag = Event::Drag { from: [1.0, 2.5], to: [3.0, 4.0], button: Button::Right };
        let set = [("spp", "4"), ("tone_map", "agx")].map(|(a, b)| (a.to_owned(), b.to_owned())).to_vec();
        let wanted = [(0.5, drag, 2), (0.5, Event::Set(set), 3), (2.0, Event::Close, 1)];
        assert_eq!(events, wanted.map(|(at_s, event, number)| Timed { at_s, event, number }));
    }

    #[test]
    fn what_is_no_event_is_named() {
        for (text, want) in [
            ("", "no [[event]] in the file"),
            ("a = 1", "unknown key 'a'"),
            ("event = 3", "'event' is not an array of tables"),
            ("[[event]]\nat_s = ", "line 2: "),
            ("[[event]]\nkey = \"w\"", "event 1: at_s is missing"),
            ("[[event]]\nat_s = 0\nkey = \"w\"\n[[event]]\nat_s = -1\nkey = \"w\"", "event 2: at_s = -1 is not a time"),
            ("[[event]]\nat_s = nan\nkey = \"w\"", "event 1: at_s = NaN is not a time"),
            ("[[event]]\nat_s = 0", "event 1: no action"),
            ("[[event]]\nat_s = 0\nkey = \"w\"\nscroll = 1", "event 1: 2 actions, scroll and key"),
            ("[[event]]\nat_s = 0\nkei = \"w\"", "event 1: unknown key 'kei'"),
            ("[[event]]\nat_s = 0\nkey = \"z\"", "event 1: key = \"z\" is not one of w, s, a"),
            ("[[event]]\nat_s = 0\ndrag = [1, 2, 3]", "event 1: drag = [1, 2, 3] is not [x0, y0, x1, y1]"),
            ("[[event]]\nat_s = 0\nresize = [0, 4]", "event 1: resize = [0, 4]: '0' is not a positive number"),
            ("[[event]]\nat_s = 0\nresize = [99999, 99999]", "exceed the limit"),
            ("[[event]]\nat_s = 0\nclose = false", "event 1: close = false is not true"),
            ("[[event]]\nat_s = 0\nset = { spp = [1] }", "event 1: set: spp = [1]"),
            ("[[event]]\nat_s = 0\nclick = [1, 2]\nbutton = \"left\"", "event 1: button requires drag"),
            (
                "[[event]]\nat_s = 0\nclose = true\n[[event]]\nat_s = 1\nkey = \"w\"",
                "event 2: it comes after the close",
            ),
        ] {
            let reason = parse(text).unwrap_err();
            assert!(reason.contains(want) && !reason.contains('\n'), "{text}: {reason}");
        }
    }
}
