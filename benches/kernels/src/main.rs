//! What Mesa's RADV makes of the kernels, each in the variants of typical scenes; `cargo xtask kernels` runs it for each family of devices.
//!
//! RADV compiles for a device that is not there if `RADV_FORCE_FAMILY` names its family. `--quick` skips the exact kernels for instances, which are
//! the largest. Prints a JSON list of [`Row`]s, or `{"missing": REASON}`
//! where there is no RADV. Numbers are those of the compiled machine code, so they depend on the version of Mesa.
#![deny(unsafe_code)]

mod driver;

use std::{
    process::ExitCode,
    sync::atomic::{AtomicUsize, Ordering},
    thread,
};

use canted_shaders::{BindingKind, Entry, Shader, ShaderName, Variant, choice, kernels, variants, wgsl};
use serde::Serialize;

use driver::{Compiled, Driver};

/// A kernel, in one variant, on one family.
#[derive(Serialize)]
struct Row {
    kernel: String,
    variant: String,
    family: String,
    #[serde(flatten)]
    compiled: Compiled,
    driver: String,
}

/// Why nothing was measured.
#[derive(Serialize)]
struct Missing {
    missing: String,
}

fn main() -> ExitCode {
    let family = std::env::var("RADV_FORCE_FAMILY").unwrap_or_default();
    let (text, code) = match Driver::open() {
        Err(missing) => (serde_json::to_string(&Missing { missing }), ExitCode::SUCCESS),
        Ok(driver) => match rows(&driver, &family) {
            Ok(rows) => (serde_json::to_string(&rows), ExitCode::SUCCESS),
            Err(message) => (Ok(message), ExitCode::FAILURE),
        },
    };
    let mut out: Box<dyn std::io::Write> =
        if code == ExitCode::SUCCESS { Box::new(std::io::stdout()) } else { Box::new(std::io::stderr()) };
    let written = text.map_err(std::io::Error::other).and_then(|text| writeln!(out, "{text}"));
    if written.is_err() { ExitCode::FAILURE } else { code }
}

/// All kernels, compiled on all threads of the processor.
fn rows(driver: &Driver, family: &str) -> Result<Vec<Row>, String> {
    let is_quick = std::env::args().any(|arg| arg == "--quick");
    let mut jobs = vec![];
    for kernel in kernels().filter(|kernel| !kernel.as_str().starts_with("check/")) {
        let variants = variants(kernel).map_err(|error| error.to_string())?;
        // Counting is for measurements.
        let is_wanted = |chosen: &Variant| !(counts(chosen) || is_quick && is_large(kernel, chosen));
        jobs.extend(variants.into_iter().filter(is_wanted).map(|chosen| (kernel, chosen)));
    }
    let next = AtomicUsize::new(0);
    let work = || {
        let mut found = vec![];
        while let Some((i, (kernel, chosen))) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, jobs.get(i)?)))
        {
            if let Some(row) = row(driver, family, *kernel, chosen)? {
                found.push((i, row));
            }
        }
        Ok::<_, String>(found)
    };
    let n_threads = thread::available_parallelism().map_or(1, usize::from);
    let parts: Result<Vec<_>, String> = thread::scope(|scope| {
        let threads: Vec<_> = (0..n_threads).map(|_| scope.spawn(work)).collect();
        threads.into_iter().map(|thread| thread.join().map_err(|_| "a thread panicked".to_owned())?).collect()
    });
    let mut all: Vec<(usize, Row)> = parts?.into_iter().flatten().collect();
    all.sort_by_key(|(i, _)| *i);
    Ok(all.into_iter().map(|(_, row)| row).collect())
}

/// `None` for a raster pass, which is no compute kernel, and for rays that the driver traces.
fn row(driver: &Driver, family: &str, kernel: ShaderName, chosen: &Variant) -> Result<Option<Row>, String> {
    let in_kernel = |error: &dyn std::fmt::Display| format!("kernel '{kernel}', {}: {error}", name(chosen));
    let shader = Shader::new(kernel, chosen).map_err(|error| in_kernel(&error))?;
    let by_driver =
        |entry: &&Entry| entry.bindings.iter().any(|bound| bound.kind == BindingKind::AccelerationStructure);
    let Some(entry) = shader.entry("main").filter(|entry| !by_driver(entry)) else { return Ok(None) };
    let words = shader.spirv().map_err(|error| in_kernel(&error))?;
    let compiled = driver.compile(&words, entry).map_err(|error| in_kernel(&error))?;
    Ok(Some(Row {
        kernel: kernel.to_string(),
        variant: name(chosen),
        family: family.to_owned(),
        compiled,
        driver: driver.version.clone(),
    }))
}

fn counts(chosen: &Variant) -> bool {
    chosen.has(choice::Count::Tests)
}

/// Whether a kernel is an exact one for instances: transforms in emulated double precision make them ten times as long as others.
fn is_large(kernel: ShaderName, chosen: &Variant) -> bool {
    let is_exact = [wgsl::trace::CLOSEST, wgsl::trace::OCCLUDED].contains(&kernel);
    is_exact && (chosen.has(choice::Level::Instances) || chosen.has(choice::Level::Moving))
}

/// The choices of a variant: `slot=choice` for each slot, in the order of names.
fn name(chosen: &Variant) -> String {
    let mut words: Vec<String> =
        chosen.parts().map(|(slot, part)| format!("{slot}={}", part.rsplit('/').next().unwrap_or(part))).collect();
    words.sort();
    words.join(" ")
}
