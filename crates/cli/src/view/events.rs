//! What a person does to a session.

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
