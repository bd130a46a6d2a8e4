//! What a scene does without, as `render` and `stats` tell it.

use canted_renderer::UnusedFeature;
use serde_json::{Value, json};

/// All parts as JSON; rays are counted for heat maps alone.
pub(crate) fn json(parts: &[UnusedFeature], is_counted: bool) -> Value {
    const COUNTERS: UnusedFeature = UnusedFeature { feature: "counters", reason: "no heat map is asked for" };
    let counters = (!is_counted).then_some(&COUNTERS);
    parts.iter().chain(counters).map(|left| json!({ "part": left.feature, "because": left.reason })).collect()
}

/// The same in a line.
pub(crate) fn text(parts: &Value) -> String {
    let word = |part: &Value, key: &str| part[key].as_str().unwrap_or_default().to_owned();
    let parts = parts.as_array().into_iter().flatten();
    parts.map(|part| format!("{} ({})", word(part, "part"), word(part, "because"))).collect::<Vec<_>>().join(", ")
}
