//! Loading glTF files: ours compared with the `gltf` crate's `import`.

use std::{
    env,
    fmt::Write,
    fs,
    io::Write as _,
    process::{Command, Stdio},
};

use anyhow::{Context, Result, anyhow};
use canted_scene::SceneStats;

use crate::{
    clock::{Seconds, time_all},
    models,
    options::Options,
};

/// The argument with which this program measures the memory that one reader needs for one file.
pub(crate) const PEAK: &str = "load-peak";

/// The readers, as `--engines` names them.
const READERS: [&str; 2] = ["ours", "gltf"];

/// The files; the first one has a bound.
const FILES: [&str; 4] = ["country_kitchen", "sponza_gltf", "dragon_871k", "eiffel"];

/// Reads each file with both readers in turn and writes the section.
///
/// `gltf::import` decodes images and returns the file's buffers. It gathers no vertices, checks no indices and places
/// no nodes.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## Loading glTF\n\nFrom the file to a scene with all textures on all threads, compared with the `gltf` crate's `import`, \
         which decodes images and copies buffers but builds no meshes. Minimum wall milliseconds (and processor milliseconds of all \
         threads). Memory is the peak growth of a process that only reads the file.\n\n\
         | file | triangles placed | decoded | ours | peak | `gltf::import` | peak |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for name in FILES {
        let Some(path) = models::path(name)? else { continue };
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        let mut counts = SceneStats::default();
        // The first round warms the file's cache.
        for round in 0..=rounds {
            let (scene, our_time) = time_all(|| canted_scene::read(&path));
            counts = SceneStats::of(&scene.map_err(|error| anyhow!("{error}"))?);
            let (import, their_time) = time_all(|| gltf::import(&path));
            import.with_context(|| format!("gltf::import of {name}"))?;
            if round > 0 {
                ours.push(our_time);
                theirs.push(their_time);
            }
        }
        let decoded = (counts.geometry_bytes + counts.texture_bytes) / 1_000_000;
        let [our_peak, their_peak] = READERS.map(|reader| peak(name, reader));
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "| {name} | {} | {decoded} MB | {} | {our_peak} | {} | {their_peak} |",
            counts.n_placed_triangles,
            least(&ours),
            least(&theirs)
        );
    }
    Ok(())
}

/// The minimum times of several rounds, as a table cell.
fn least(rounds: &[Seconds]) -> String {
    let least = |of: fn(&Seconds) -> f64| 1e3 * rounds.iter().map(of).fold(f64::INFINITY, f64::min);
    format!("{:.0} ms ({:.0} ms)", least(|seconds| seconds.wall), least(|seconds| seconds.cpu))
}

/// The output of [`print_peak`] in a separate process, or "unknown".
fn peak(name: &str, reader: &str) -> String {
    let run = || {
        let mut command = Command::new(env::current_exe().ok()?);
        let output = command.args([PEAK, "--scenes", name, "--engines", reader]).stderr(Stdio::null()).output().ok()?;
        let bytes = String::from_utf8(output.stdout).ok()?.trim().parse::<usize>().ok()?;
        Some(format!("{} MB", bytes / 1_000_000))
    };
    run().unwrap_or_else(|| "unknown".to_owned())
}

/// Reads one file with one reader and prints by how many bytes the peak resident memory of this process grew.
pub(crate) fn print_peak(options: &Options) -> Result<()> {
    let names = options.scenes(&[]);
    let path = names.first().map(|name| models::path(name)).transpose()?.flatten().context("there is no such file")?;
    let before = most_resident_bytes().context("the system does not report the memory of a process")?;
    if options.wants_engine(READERS[0]) {
        drop(canted_scene::read(&path)?);
    } else {
        drop(gltf::import(&path)?);
    }
    let after = most_resident_bytes().unwrap_or(before);
    writeln!(std::io::stdout(), "{}", after - before)?;
    Ok(())
}

/// Peak resident memory of this process so far; `None` if the system does not report it.
fn most_resident_bytes() -> Option<usize> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib * 1024)
}
