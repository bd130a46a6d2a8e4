//! Names of presets and triangle tests.

use canted::{Preset, TriangleTest};
use pyo3::prelude::*;

use crate::error::invalid;

/// The value of `triangle_test`.
pub(crate) fn triangle_test(name: &str) -> PyResult<TriangleTest> {
    name.parse().map_err(|_| unknown("triangle_test", name, &TriangleTest::ALL.map(TriangleTest::name)))
}

/// The value of `preset`.
pub(crate) fn preset(name: &str) -> PyResult<Preset> {
    let known = Preset::ALL.into_iter().find(|preset| preset.name() == name);
    known.ok_or_else(|| unknown("preset", name, &Preset::ALL.map(Preset::name)))
}

fn unknown(argument: &str, value: &str, known: &[&str]) -> PyErr {
    let (last, others) = known.split_last().unwrap_or((&"", &[]));
    invalid(format!("{argument} is '{value}'; use {} or {last}", others.join(", ")))
}
