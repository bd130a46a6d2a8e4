//! Names of presets, triangle tests, instructions and kinds of inside.

use canted::build::SimdPath;
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

/// Instructions that this machine has.
pub(crate) fn simd(name: &str) -> PyResult<SimdPath> {
    let available: Vec<_> = SimdPath::ALL.into_iter().filter(|path| path.is_available()).collect();
    let names: Vec<_> = available.iter().map(|path| path.name()).collect();
    available.into_iter().find(|path| path.name() == name).ok_or_else(|| unknown("simd", name, &names))
}

/// What is inside of a mesh.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Inside {
    /// What has an odd number of surfaces above it.
    Parity,
    /// What the surface winds around.
    Winding,
}

/// The value of `mode`.
pub(crate) fn inside(name: Option<&str>) -> PyResult<Option<Inside>> {
    match name {
        None => Ok(None),
        Some("parity") => Ok(Some(Inside::Parity)),
        Some("winding") => Ok(Some(Inside::Winding)),
        Some(name) => Err(unknown("mode", name, &["winding", "parity"])),
    }
}

fn unknown(argument: &str, value: &str, known: &[&str]) -> PyErr {
    let (last, others) = known.split_last().unwrap_or((&"", &[]));
    invalid(format!("{argument} is '{value}'; use {} or {last}", others.join(", ")))
}
