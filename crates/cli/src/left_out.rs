//! What a scene does without, as `render` and `stats` tell it.

use canted_renderer::LeftOut;
use serde_json::{Value, json};

/// All parts as JSON; rays are counted for heat maps alone.
pub(crate) fn json(parts: &[LeftOut], is_counted: bool) -> Value {
    const COUNTERS: LeftOut = LeftOut { part: "counters", because: "no heat map is asked for" };
    let counters = (!is_counted).then_some(&COUNTERS);
    parts.iter().chain(counters).map(|left| json!({ "part": left.part, "because": left.because })).collect()
}

/// The same in a line.
pub(crate) fn text(parts: &Value) -> String {
    let word = |part: &Value, key: &str| part[key].as_str().unwrap_or_default().to_owned();
    let parts = parts.as_array().into_iter().flatten();
    parts.map(|part| format!("{} ({})", word(part, "part"), word(part, "because"))).collect::<Vec<_>>().join(", ")
}
