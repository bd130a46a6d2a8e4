//! Fuzzes all readers with mutated files.
//!
//! `cargo xtask fuzz --minutes N` runs it and records the table. Each case mutates a real or malformed file and reads it.
//! Panics, invalid scenes and times over 30 seconds are findings. Half of the mutations of JSON and TOML keep the syntax valid,
//! to get past the parsers. Cases are determined by `--seed` and the thread number. Findings are saved in `target/fuzz`, and
//! the exit code is 1.
//!
//! Not covered: memory (see `tests/allocation.rs`), files larger than [`corpus::MAX_BYTES`], paths of referenced files.
#![forbid(unsafe_code)]

mod corpus;
#[path = "../../tests/scene/flaw.rs"]
mod flaw;

use std::collections::BTreeMap;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use std::{fs, thread};

use canted_scene::{EnvironmentImage, ReadOptions, SceneFile, read_environment, read_with};
use corpus::{Corpus, Entry, Kind, Random, hash, mutated};
use flaw::flaw;

/// Time limit of a case; valid cases take less than a second.
const MAX_TIME: Duration = Duration::from_secs(30);

/// Results of the cases of one kind.
#[derive(Clone, Debug, Default)]
struct Tally {
    n_read: u64,
    n_rejected: u64,
    findings: Vec<String>,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.n_read += other.n_read;
        self.n_rejected += other.n_rejected;
        self.findings.extend(other.findings);
    }
}

fn main() -> ExitCode {
    let Some((minutes, seed)) = options() else {
        let _ = writeln!(std::io::stderr(), "usage: fuzz [--minutes N] [--seed N]");
        return ExitCode::from(2);
    };
    let Some(corpus) = Corpus::load() else {
        let _ = writeln!(std::io::stderr(), "error: no scene folder found; set CANTED_SCENES");
        return ExitCode::from(2);
    };
    // Panics are reported in the table.
    std::panic::set_hook(Box::new(|_| {}));
    let end = Instant::now() + Duration::from_secs_f64(60.0 * minutes);
    let n_threads = thread::available_parallelism().map_or(1, usize::from) as u64;
    let mut tallies = BTreeMap::new();
    thread::scope(|scope| {
        let corpus = &corpus;
        let work = |number: u64| scope.spawn(move || run(corpus, Random::new(seed * n_threads + number), end));
        for worker in (0..n_threads).map(work).collect::<Vec<_>>() {
            for (kind, tally) in worker.join().unwrap_or_default() {
                tallies.entry(kind).or_insert_with(Tally::default).add(tally);
            }
        }
    });
    let _ = write!(std::io::stdout(), "{}", table(&corpus, &tallies));
    let is_clean = !tallies.is_empty() && tallies.values().all(|tally| tally.findings.is_empty());
    if is_clean { ExitCode::SUCCESS } else { ExitCode::from(1) }
}

/// Minutes to run and the seed; `None` for invalid arguments.
fn options() -> Option<(f64, u64)> {
    let (mut minutes, mut seed) = (1.0, 0);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match &arg[..] {
            "--minutes" => minutes = args.next()?.parse().ok().filter(|&n: &f64| (0.0..1e6).contains(&n))?,
            "--seed" => seed = args.next()?.parse::<u32>().ok()?.into(),
            _ => return None,
        }
    }
    Some((minutes, seed))
}

/// Runs cases in one thread, in its own copy of the corpus.
fn run(corpus: &Corpus, mut random: Random, end: Instant) -> BTreeMap<Kind, Tally> {
    let mut tallies = BTreeMap::<Kind, Tally>::new();
    // Each case writes its file twice, which dominates the time on a disk.
    let Ok(copy) = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()) else { return tallies };
    if corpus.write(copy.path()).is_err() {
        return tallies;
    }
    while Instant::now() < end {
        let entry = corpus.draw(&mut random);
        let bytes = mutated(entry, corpus, &mut random);
        let tally = tallies.entry(entry.kind).or_default();
        match case(copy.path(), entry, &bytes, &mut random) {
            Ok(true) => tally.n_read += 1,
            Ok(false) => tally.n_rejected += 1,
            Err(finding) => tally.findings.push(save(entry, &bytes, &finding)),
        }
    }
    tallies
}

/// Reads one mutated file; whether it was accepted, or a finding.
fn case(folder: &Path, entry: &Entry, bytes: &[u8], random: &mut Random) -> Result<bool, String> {
    let path = folder.join(&entry.file);
    fs::write(&path, bytes).map_err(|error| error.to_string())?;
    let time = [None, None, Some(0.7), Some(-1.0), Some(f32::NAN), Some(1e38)][random.below(6)];
    let attempt = || {
        let start = Instant::now();
        let answer = catch_unwind(AssertUnwindSafe(|| match entry.kind {
            Kind::Hdr | Kind::Exr => {
                read_environment(&path, &mut Vec::new()).map(|image| flaw_of_environment(&image)).ok()
            }
            Kind::SceneFile => SceneFile::read(&path).and_then(|file| file.load()).map(|scene| flaw(&scene)).ok(),
            _ => read_with(&folder.join(&entry.read_through), &ReadOptions { time, ..ReadOptions::default() })
                .map(|scene| flaw(&scene))
                .ok(),
        }));
        (answer, start.elapsed())
    };
    let (mut answer, mut took) = attempt();
    // Repeats slow cases, in case the machine was suspended.
    if took > MAX_TIME {
        (answer, took) = attempt();
    }
    fs::write(&path, &entry.bytes).map_err(|error| error.to_string())?;
    if took > MAX_TIME {
        return Err(format!("took {took:?}"));
    }
    match answer {
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            Err(format!("panic: {}", text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")))
        }
        Ok(None) => Ok(false),
        Ok(Some(None)) => Ok(true),
        Ok(Some(Some(flaw))) => Err(flaw),
    }
}

/// Saves the input of a finding and describes it.
fn save(entry: &Entry, bytes: &[u8], finding: &str) -> String {
    let name = entry.file.to_string_lossy().replace(['/', '\\'], "-");
    let path = Path::new("target/fuzz").join(format!("{:08x}-{name}", hash(bytes)));
    let _ = fs::create_dir_all("target/fuzz").and_then(|()| fs::write(&path, bytes));
    format!("{}: {finding}", path.display())
}

fn table(corpus: &Corpus, tallies: &BTreeMap<Kind, Tally>) -> String {
    let mut table =
        "| reader | files | cases | accepted | rejected | findings |\n| --- | --- | --- | --- | --- | --- |\n"
            .to_owned();
    for (kind, Tally { n_read, n_rejected, findings }) in tallies {
        let n_files = corpus.entries.iter().filter(|entry| entry.kind == *kind).count();
        let n_cases = n_read + n_rejected + findings.len() as u64;
        table += &format!("| {kind:?} | {n_files} | {n_cases} | {n_read} | {n_rejected} | {} |\n", findings.len());
    }
    let findings = tallies.values().flat_map(|tally| &tally.findings);
    table + &findings.map(|finding| format!("\n* {finding}")).collect::<String>()
}

/// The first violated guarantee of an environment map.
fn flaw_of_environment(image: &EnvironmentImage) -> Option<String> {
    let n_texels = u64::from(image.width) * u64::from(image.height);
    let is_valid = n_texels > 0
        && image.texels.len() as u64 == n_texels
        && image.texels.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0);
    (!is_valid).then(|| format!("{} x {} texels are invalid", image.width, image.height))
}
