//! From a glTF file to memory: ours beside the import of the `gltf` crate.

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

/// The word by which this program is asked for the memory that one reader takes for one file.
pub(crate) const PEAK: &str = "load-peak";

/// The readers, as `--engines` names them.
const READERS: [&str; 2] = ["ours", "gltf"];

/// The files, of which the first is the one that has a bound.
const FILES: [&str; 4] = ["country_kitchen", "sponza_gltf", "dragon_871k", "eiffel"];

/// Reads each file by both, turn about, and writes the section.
///
/// The import decodes images and hands out buffers as they are in the file: it neither gathers vertices, nor checks an
/// index, nor places a node.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## Loading glTF\n\nFrom the file to a scene with all textures, all threads, and by the `gltf` crate's own `import`, which \
         decodes images and copies buffers but makes no meshes of them. Least milliseconds by the clock on the wall (and by the \
         processors of all threads), for a neighbour only lengthens them. Memory is the peak that a process which does \
         nothing else reaches, above what it had before.\n\n\
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

/// The least times of several rounds, as the table has them.
fn least(rounds: &[Seconds]) -> String {
    let least = |of: fn(&Seconds) -> f64| 1e3 * rounds.iter().map(of).fold(f64::INFINITY, f64::min);
    format!("{:.0} ms ({:.0} ms)", least(|seconds| seconds.wall), least(|seconds| seconds.cpu))
}

/// What [`print_peak`] says in a process of its own, or that nobody knows.
fn peak(name: &str, reader: &str) -> String {
    let run = || {
        let mut command = Command::new(env::current_exe().ok()?);
        let output = command.args([PEAK, "--scenes", name, "--engines", reader]).stderr(Stdio::null()).output().ok()?;
        let bytes = String::from_utf8(output.stdout).ok()?.trim().parse::<usize>().ok()?;
        Some(format!("{} MB", bytes / 1_000_000))
    };
    run().unwrap_or_else(|| "unknown".to_owned())
}

/// Reads one file by one reader, and prints by how many bytes the greatest resident memory of this process grew.
pub(crate) fn print_peak(options: &Options) -> Result<()> {
    let names = options.scenes(&[]);
    let path = names.first().map(|name| models::path(name)).transpose()?.flatten().context("there is no such file")?;
    let before = most_resident_bytes().context("the system does not say how much memory a process takes")?;
    if options.wants_engine(READERS[0]) {
        drop(canted_scene::read(&path)?);
    } else {
        drop(gltf::import(&path)?);
    }
    let after = most_resident_bytes().unwrap_or(before);
    writeln!(std::io::stdout(), "{}", after - before)?;
    Ok(())
}

/// Greatest resident memory of this process so far; `None` where the system does not say.
fn most_resident_bytes() -> Option<usize> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib * 1024)
}
