//! The pipeline parts that a scene does not need, as `render` and `stats` report them.

use canted_renderer::UnusedFeature;
use serde_json::{Value, json};

/// The parts as JSON. Test counters are a part too: only heat maps count tests.
pub(crate) fn json(parts: &[UnusedFeature], has_counters: bool) -> Value {
    const COUNTERS: UnusedFeature = UnusedFeature { feature: "counters", reason: "no heat map was requested" };
    let counters = (!has_counters).then_some(&COUNTERS);
    parts.iter().chain(counters).map(|unused| json!({ "part": unused.feature, "reason": unused.reason })).collect()
}

/// The parts of [`json`] in one line.
pub(crate) fn text(parts: &Value) -> String {
    let word = |part: &Value, key: &str| part[key].as_str().unwrap_or_default().to_owned();
    let parts = parts.as_array().into_iter().flatten();
    parts.map(|part| format!("{} ({})", word(part, "part"), word(part, "reason"))).collect::<Vec<_>>().join(", ")
}
