//! Names of presets and triangle tests.

use canted::{Preset, TriangleTest};
use pyo3::prelude::*;

use crate::error::invalid;

/// Values of `preset`.
pub(crate) const PRESETS: [(&str, Preset); 4] = [
    ("dynamic", Preset::Dynamic),
    ("fast", Preset::Fast),
    ("balanced", Preset::Balanced),
    ("quality", Preset::Quality),
];

/// The value of `triangle_test`.
pub(crate) fn triangle_test(name: &str) -> PyResult<TriangleTest> {
    name.parse().map_err(|_| unknown("triangle_test", name, &TriangleTest::ALL.map(TriangleTest::name)))
}

/// The value of `preset`.
pub(crate) fn preset(name: &str) -> PyResult<(&'static str, Preset)> {
    let known = PRESETS.into_iter().find(|(known, _)| *known == name);
    known.ok_or_else(|| unknown("preset", name, &PRESETS.map(|(name, _)| name)))
}

fn unknown(argument: &str, value: &str, known: &[&str]) -> PyErr {
    let (last, others) = known.split_last().unwrap_or((&"", &[]));
    invalid(format!("{argument} is '{value}'; use {} or {last}", others.join(", ")))
}
