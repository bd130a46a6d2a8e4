//! From a glTF file to memory: ours beside the import of the `gltf` crate.

use std::fmt::Write;

use anyhow::{Context, Result, anyhow};
use canted_scene::Description;

use crate::{
    clock::{Seconds, time_all},
    models,
};

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
         processors of all threads), for a neighbour only lengthens them.\n\n\
         | file | triangles placed | decoded | ours | `gltf::import` |\n| --- | --- | --- | --- | --- |\n",
    );
    for name in FILES {
        let Some(path) = models::path(name)? else { continue };
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        let mut counts = Description::default();
        // The first round warms the file's cache.
        for round in 0..=rounds {
            let (scene, our_time) = time_all(|| canted_scene::read(&path));
            counts = Description::of(&scene.map_err(|error| anyhow!("{error}"))?);
            let (import, their_time) = time_all(|| gltf::import(&path));
            import.with_context(|| format!("gltf::import of {name}"))?;
            if round > 0 {
                ours.push(our_time);
                theirs.push(their_time);
            }
        }
        let decoded = (counts.geometry_bytes + counts.texture_bytes) / 1_000_000;
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "| {name} | {} | {decoded} MB | {} | {} |",
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
