//! The example in a browser: `cargo xtask browser` builds and serves the page, `cargo xtask test` runs it in headless Chromium.
//!
//! The page reports how the device's answers differ from the CPU's. The test judges that, once as it is and once with an instance missing
//! on the device, which the judgment must notice.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::{Child, Stdio},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::command::{self, Count, cargo, say, succeeds, succeeds_silently};

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
    loop {
        let (stream, _) = listener.accept().context("cannot accept a connection")?;
        // A browser that closes a connection ends only that.
        let _ = answer(stream, &page);
    }
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
        match verdict {
            Ok(Verdict::NoAdapter(reason)) => {
                say(&format!("skipped browser::{test}: {program} has no WebGPU: {reason}"));
                count.skipped += 1;
                continue;
            }
            Ok(Verdict::Same) if wanted => count.passed += 1,
            Ok(Verdict::Different(how)) if !wanted => {
                say(&how);
                count.passed += 1;
            }
            other => {
                say(&format!("test browser::{test} ... FAILED: {other:?}"));
                count.failed += 1;
                is_well = false;
                continue;
            }
        }
        say(&format!("test browser::{test} ... ok"));
    }
    Ok(is_well)
}

/// Builds the page; its folder, or `None` where it does not build.
fn build() -> Result<Option<PathBuf>> {
    let folder = command::root().join("target/browser");
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
    fs::copy(command::root().join("examples/browser/index.html"), page.join("index.html"))
        .context("cannot copy index.html")?;
    Ok(Some(page))
}

/// The first program that is Chromium.
fn program() -> Option<&'static str> {
    PROGRAMS.into_iter().find(|program| succeeds_silently(&mut command::program(*program, &["--version"])))
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
    let profile = command::root().join("target/browser/profile");
    let mut command = command::program(program, &FLAGS);
    command.arg(format!("--user-data-dir={}", profile.display())).arg(address);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut browser = Browser(command.spawn().with_context(|| format!("cannot start {program}"))?);
    let check = || match browser.0.try_wait().with_context(|| format!("cannot wait for {program}"))? {
        Some(status) => bail!("{program} has ended before the page reported: {status}"),
        None => Ok(()),
    };
    let report = until_reported(&listener, page, PATIENCE, check)?;
    drop(browser);
    serde_json::from_str(&report).context("the page reports what is not JSON")
}

/// How the device's answers differ from the CPU's.
#[derive(Debug)]
enum Verdict {
    Same,
    Different(String),
    /// The browser offers no adapter: it has no WebGPU.
    NoAdapter(String),
}

/// Checks what the page reports: the device hits what the CPU hits, except for ties.
fn judged(report: &Value) -> Result<Verdict> {
    if let Some(error) = report["error"].as_str() {
        if error.starts_with("no adapter") {
            return Ok(Verdict::NoAdapter(error.to_owned()));
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
        for (what, most) in [("one_side", 0), ("triangle", rays / 500), ("incomplete", 0)] {
            let found = n(what)?;
            if found > most {
                return Ok(Verdict::Different(format!("{kind} rays: {what} {found} of {rays}, at most {most}")));
            }
        }
        let distance = counts["distance"].as_f64().with_context(|| format!("the page reports no {kind}.distance"))?;
        if distance > MAX_DISTANCE {
            return Ok(Verdict::Different(format!("{kind} rays: t differs by {distance:e} of it")));
        }
    }
    Ok(Verdict::Same)
}

/// The greatest difference of `t` relative to it: 64 roundings of the scene's extent, which is some hundred times the least distance.
const MAX_DISTANCE: f64 = 64.0 * 100.0 / (1 << 24) as f64;

/// Kinds of files of a page.
const KINDS: [(&str, &str); 3] = [("html", "text/html"), ("js", "text/javascript"), ("wasm", "application/wasm")];

/// The path that reports are sent to.
const REPORT: &str = "report";

/// How long a connection may be silent.
const SILENCE: Duration = Duration::from_secs(10);

/// Serves `folder` until a report arrives, and returns it. An error of `check`, which is called while nothing comes, ends the wait.
fn until_reported(
    listener: &TcpListener,
    folder: &Path,
    patience: Duration,
    mut check: impl FnMut() -> Result<()>,
) -> Result<String> {
    listener.set_nonblocking(true).context("cannot wait for connections")?;
    let start = Instant::now();
    while start.elapsed() < patience {
        match listener.accept() {
            Ok((stream, _)) => {
                if let Ok(Some(report)) = answer(stream, folder) {
                    return Ok(report);
                }
            }
            Err(_) => {
                check()?;
                thread::sleep(Duration::from_millis(20));
            }
        }
    }
    bail!("the page reports nothing within {} s", patience.as_secs())
}

/// Answers one request; a report that it brings.
fn answer(stream: TcpStream, folder: &Path) -> Result<Option<String>> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(SILENCE))?;
    let mut reader = BufReader::new(stream);
    let mut first = String::new();
    reader.read_line(&mut first)?;
    let mut length = 0;
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? <= 2 {
            break;
        }
        if let Some(value) = line.to_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse()?;
        }
    }
    let mut words = first.split_whitespace();
    let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let name = path.split('?').next().unwrap_or_default().trim_start_matches('/');
    if (method, name) == ("POST", REPORT) {
        let mut body = vec![0; length];
        reader.read_exact(&mut body)?;
        reply(reader.into_inner(), "204 No Content", "text/plain", &[])?;
        return Ok(Some(String::from_utf8(body)?));
    }
    let name = if name.is_empty() { "index.html" } else { name };
    let kind = KINDS.iter().find(|(extension, _)| name.ends_with(&format!(".{extension}")));
    // Names of plain files only: nothing outside of the folder.
    let file =
        kind.filter(|_| method == "GET" && !name.contains(['/', '\\'])).map(|(_, kind)| (kind, folder.join(name)));
    match file.and_then(|(kind, path)| Some((kind, fs::read(path).ok()?))) {
        Some((kind, content)) => reply(reader.into_inner(), "200 OK", kind, &content)?,
        None => reply(reader.into_inner(), "404 Not Found", "text/plain", b"not found")?,
    }
    Ok(None)
}

fn reply(mut stream: TcpStream, status: &str, kind: &str, content: &[u8]) -> Result<()> {
    let length = content.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.write_all(head.as_bytes())?;
    stream.write_all(content)?;
    Ok(stream.flush()?)
}

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
        assert!(matches!(judged(&report(700, 0, 1e-6)), Ok(Verdict::Same)));
        assert!(matches!(judged(&report(700, 1, 1e-6)), Ok(Verdict::Different(_))));
        assert!(matches!(judged(&report(700, 0, 1e-2)), Ok(Verdict::Different(_))));
        assert!(judged(&report(3, 0, 1e-6)).is_err());
        assert!(matches!(judged(&json!({ "error": "no adapter for device 'best'" })), Ok(Verdict::NoAdapter(_))));
        assert!(judged(&json!({ "error": "device lost" })).is_err());
    }

    fn asked(address: std::net::SocketAddr, request: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn files_are_served_until_a_report_arrives() {
        let folder = command::root().join("target/xtask-serve-test");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("index.html"), "page").unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let browser = thread::spawn(move || {
            assert!(asked(address, "GET /?report HTTP/1.1\r\nHost: x\r\n\r\n").ends_with("\r\n\r\npage"));
            assert!(asked(address, "GET /../Cargo.toml HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404"));
            asked(address, "POST /report HTTP/1.1\r\nContent-Length: 4\r\n\r\n{\"a\"")
        });
        let report = until_reported(&listener, &folder, Duration::from_secs(20), || Ok(())).unwrap();
        assert_eq!(report, "{\"a\"");
        assert!(browser.join().unwrap().starts_with("HTTP/1.1 204"));
        assert!(until_reported(&listener, &folder, Duration::from_millis(50), || Ok(())).is_err());
        let ended = until_reported(&listener, &folder, Duration::from_secs(20), || bail!("ended")).unwrap_err();
        assert_eq!(ended.to_string(), "ended");
        fs::remove_dir_all(&folder).unwrap();
    }
}
