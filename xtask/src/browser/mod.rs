//! The example in a browser: `cargo xtask browser` builds and serves the page, `cargo xtask test` runs it in headless Chromium.
//!
//! The page reports how the device's answers differ from the CPU's. The test judges that, once as it is and once with an instance missing
//! on the device, which the judgment must notice.

mod serve;

use std::{
    fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::Duration,
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::{
    command::{self, cargo, say, succeeds},
    test::Count,
    workspace,
};

/// The compiler's target of browsers.
pub(crate) const TARGET: &str = "wasm32-unknown-unknown";

/// The manifest of the example, which is no member of the workspace.
pub(crate) const MANIFEST: &str = "examples/browser/Cargo.toml";

/// Programs that are Chromium.
const PROGRAMS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// No window, no sandbox (which needs a user that is not root), no network beyond the page, WebGPU on the software adapter.
const FLAGS: [&str; 11] = [
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-webgpu-adapter=swiftshader",
];

/// How long a page may take: it compiles a dozen kernels on a software adapter.
const PATIENCE: Duration = Duration::from_secs(300);

/// Whether the compiler has the target of browsers.
pub(crate) fn has_target() -> Result<bool> {
    let root = command::output("rustc", &["--print", "sysroot"])?;
    Ok(Path::new(root.trim()).join("lib/rustlib").join(TARGET).is_dir())
}

/// Builds the page and serves it until the program is stopped.
pub(crate) fn run() -> Result<bool> {
    if !has_target()? {
        bail!("the target {TARGET} is not installed; rustup target add {TARGET}");
    }
    let Some(page) = build()? else { return Ok(false) };
    let listener = TcpListener::bind("127.0.0.1:8080").context("cannot listen on port 8080")?;
    say(&format!("{} is at http://localhost:8080/ until this program stops", page.display()));
    serve::forever(&listener, &page)
}

/// Runs the page in headless Chromium and prints the count.
pub(crate) fn test_alone() -> Result<bool> {
    let mut count = Count::default();
    let is_well = test(&mut count)?;
    say(&count.to_string());
    Ok(is_well)
}

/// Runs the page in headless Chromium and adds its tests to `count`. Returns whether none failed.
pub(crate) fn test(count: &mut Count) -> Result<bool> {
    let mut skip = |reason: &str| {
        say(&format!("skipped the example in a browser: {reason}"));
        count.skipped += 2;
        Ok(true)
    };
    if !has_target()? {
        return skip(&format!("the target {TARGET} is not installed"));
    }
    let Some(program) = program() else { return skip("Chromium is not found") };
    if !succeeds(&mut cargo(&["fetch", "--manifest-path", MANIFEST]))? {
        return skip("the package registry cannot be reached");
    }
    let Some(page) = build()? else {
        say("the example in a browser does not build: counted as one failure");
        count.failed += 1;
        return Ok(false);
    };
    let mut is_well = true;
    for (test, query, wanted) in [
        ("the_page_traces_as_the_cpu_does", "report", true),
        ("a_missing_instance_is_noticed", "report&without-first", false),
    ] {
        let verdict = visited(program, &page, query).and_then(|report| {
            say(&report.to_string());
            judged(&report)
        });
        if let Some(NoAdapter(reason)) = verdict.as_ref().err().and_then(|error| error.downcast_ref()) {
            say(&format!("skipped browser::{test}: {program} has no WebGPU: {reason}"));
            count.skipped += 1;
        } else if verdict.is_ok() == wanted && (wanted || verdict.as_ref().is_err_and(|error| error.is::<Different>()))
        {
            say(&format!("test browser::{test} ... ok"));
            count.passed += 1;
        } else {
            let reason = verdict.err().map_or_else(|| "nothing differs".to_owned(), |error| format!("{error:#}"));
            say(&format!("test browser::{test} ... FAILED: {reason}"));
            count.failed += 1;
            is_well = false;
        }
    }
    Ok(is_well)
}

/// Builds the page; its folder, or `None` where it does not build.
fn build() -> Result<Option<PathBuf>> {
    let folder = workspace::root().join("target/browser");
    let (target, page) = (folder.join("build"), folder.join("page"));
    let with_target = |args: &[&str]| {
        let mut command = cargo(args);
        command.args(["--manifest-path", MANIFEST, "--target-dir"]).arg(&target);
        command
    };
    if !succeeds(with_target(&["build", "--release", "--package", "browser"]).args(["--target", TARGET]))? {
        return Ok(None);
    }
    let program = target.join(TARGET).join("release/browser.wasm");
    if !succeeds(with_target(&["run", "--release", "--package", "bundle"]).arg("--").arg(program).arg(&page))? {
        return Ok(None);
    }
    fs::copy(workspace::root().join("examples/browser/index.html"), page.join("index.html"))
        .context("cannot copy index.html")?;
    Ok(Some(page))
}

/// The first program that is Chromium.
fn program() -> Option<&'static str> {
    PROGRAMS.into_iter().find(|program| {
        let mut command = Command::new(program);
        command.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    })
}

/// A running browser, which ends with this value.
struct Browser(Child);

impl Drop for Browser {
    fn drop(&mut self) {
        // A browser that has ended by itself cannot be ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Opens the page and returns what it reports.
fn visited(program: &str, page: &Path, query: &str) -> Result<Value> {
    let listener = TcpListener::bind("127.0.0.1:0").context("cannot listen on any port")?;
    let address = format!("http://localhost:{}/?{query}", listener.local_addr()?.port());
    let profile = workspace::root().join("target/browser/profile");
    let mut command = Command::new(program);
    command.args(FLAGS).arg(format!("--user-data-dir={}", profile.display())).arg(address);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut browser = Browser(command.spawn().with_context(|| format!("cannot start {program}"))?);
    let check = || match browser.0.try_wait().with_context(|| format!("cannot wait for {program}"))? {
        Some(status) => bail!("{program} has ended before the page reported: {status}"),
        None => Ok(()),
    };
    let report = serve::until_reported(&listener, page, PATIENCE, check)?;
    drop(browser);
    serde_json::from_str(&report).context("the page reports what is not JSON")
}

/// What makes the device's answers wrong.
#[derive(Debug)]
struct Different(String);

impl std::fmt::Display for Different {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Different {}

/// The browser offers no adapter: it has no WebGPU.
#[derive(Debug)]
struct NoAdapter(String);

impl std::fmt::Display for NoAdapter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NoAdapter {}

/// Checks what the page reports: the device hits what the CPU hits, except for ties.
fn judged(report: &Value) -> Result<()> {
    if let Some(error) = report["error"].as_str() {
        if error.starts_with("no adapter") {
            return Err(NoAdapter(error.to_owned()).into());
        }
        bail!("the page reports: {error}");
    }
    for kind in ["camera", "shadow"] {
        let counts = &report[kind];
        let n = |key: &str| counts[key].as_u64().with_context(|| format!("the page reports no {kind}.{key}"));
        let (rays, hits) = (n("rays")?, n("hits")?);
        if 20 * hits < rays || hits == rays {
            bail!("{hits} of {rays} {kind} rays hit: that tests little");
        }
        // Two triangles whose distances differ by less than a rounding may be taken for each other.
        let faults = [
            ("one_side", n("one_side")?, 0),
            ("triangle", n("triangle")?, rays / 500),
            ("incomplete", n("incomplete")?, 0),
        ];
        for (what, found, most) in faults {
            if found > most {
                return Err(Different(format!("{kind} rays: {what} {found} of {rays}, at most {most}")).into());
            }
        }
        let distance = counts["distance"].as_f64().with_context(|| format!("the page reports no {kind}.distance"))?;
        if distance > MAX_DISTANCE {
            return Err(Different(format!("{kind} rays: t differs by {distance:e} of it")).into());
        }
    }
    Ok(())
}

/// The greatest difference of `t` relative to it: 64 roundings of the scene's extent, which is some hundred times the least distance.
const MAX_DISTANCE: f64 = 64.0 * 100.0 / (1 << 24) as f64;

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn report(hits: u64, one_side: u64, distance: f64) -> Value {
        let counts = json!({
            "rays": 1000, "hits": hits, "one_side": one_side, "triangle": 1, "incomplete": 0, "distance": distance,
        });
        json!({ "camera": counts, "shadow": counts })
    }

    #[test]
    fn differences_are_noticed() {
        assert!(judged(&report(700, 0, 1e-6)).is_ok());
        assert!(judged(&report(700, 1, 1e-6)).unwrap_err().is::<Different>());
        assert!(judged(&report(700, 0, 1e-2)).unwrap_err().is::<Different>());
        assert!(!judged(&report(3, 0, 1e-6)).unwrap_err().is::<Different>());
        assert!(judged(&json!({ "error": "no adapter for device 'best'" })).unwrap_err().is::<NoAdapter>());
        assert!(!judged(&json!({ "error": "device lost" })).unwrap_err().is::<NoAdapter>());
    }
}
