//! Long runs whose tables are kept: the extremes of every numerical promise, ours compared with the peers, and rays at every vertex and
//! edge of closed meshes, by every traversal; none may slip through.

use std::{
    collections::BTreeMap,
    io::Write as _,
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow, ensure};
use canted_fixtures::Mesh;
use canted_tests::{
    closed::{Closed, Found, Progress, all_placements, closed, closed_up, search},
    extremes, tracers,
};

use crate::{models, wide};

/// The argument that selects it.
pub(crate) const EXTREMES: &str = "extremes";

/// Prints the table; an error if one of our promises is broken.
pub(crate) fn extremes(mut args: impl Iterator<Item = String>) -> Result<()> {
    let mut effort = 1;
    while let Some(arg) = args.next() {
        ensure!(arg == "--effort", "unexpected '{arg}'; use --effort N");
        let value = args.next().ok_or_else(|| anyhow!("--effort needs a value"))?;
        let number = value.parse().ok().filter(|&effort| effort > 0);
        effort = number.ok_or_else(|| anyhow!("--effort '{value}' is not a positive number"))?;
    }
    let (mut methods, missing) = tracers::ours();
    methods.extend(wide::peers());
    let rows = extremes::rows(effort, &methods);
    let mut out = std::io::stdout();
    writeln!(out, "{}\n\nNot tried:\n", extremes::table(&rows))?;
    for what in extremes::not_tried(&missing) {
        writeln!(out, "* {what}.")?;
    }
    for peer in wide::skipped_peers() {
        writeln!(out, "* {peer}.")?;
    }
    let n_broken = rows.iter().filter(|row| row.is_broken()).count();
    ensure!(n_broken == 0, "{n_broken} promises are broken");
    Ok(())
}

/// The argument that selects it.
pub(crate) const WATERTIGHT: &str = "watertight";

/// Rays without `--rays`.
const N_RAYS: usize = 100_000_000;

/// Minimum time between two lines of progress.
const SILENCE: Duration = Duration::from_secs(10);

/// Prints the table; an error if a ray slips through.
pub(crate) fn watertight(mut args: impl Iterator<Item = String>) -> Result<()> {
    let mut n_rays = N_RAYS;
    while let Some(arg) = args.next() {
        ensure!(arg == "--rays", "unexpected '{arg}'; use --rays N");
        let value = args.next().ok_or_else(|| anyhow!("--rays needs a value"))?;
        let number = value.parse().ok().filter(|&rays| rays > 0);
        n_rays = number.ok_or_else(|| anyhow!("--rays '{value}' is not a number of rays"))?;
    }
    let (methods, missing) = tracers::ours();
    let mut not_tried: Vec<String> =
        missing.iter().map(|name| format!("{name}: not available on this machine")).collect();
    let mut meshes = closed();
    match bunny()? {
        Some(bunny) => meshes.push(bunny),
        None => not_tried.push("the bunny, which is not in the folder of models".to_owned()),
    }
    let mut last_report = Instant::now();
    let found = search(&meshes, &all_placements(), &methods, n_rays, &mut |progress| {
        if last_report.elapsed() >= SILENCE {
            last_report = Instant::now();
            // A failed progress message does not stop the run.
            let _ = writeln!(std::io::stderr(), "{}", line(progress));
        }
    });
    let mut out = std::io::stdout();
    writeln!(out, "{}", table(&found))?;
    if !not_tried.is_empty() {
        writeln!(out, "\nNot tried: {}.", not_tried.join("; "))?;
    }
    let n_leaks: usize = found.iter().map(|found| found.n_leaks).sum();
    ensure!(n_leaks == 0, "{n_leaks} rays leak");
    Ok(())
}

/// A progress line.
fn line(progress: &Progress<'_>) -> String {
    let Progress { at: [mesh, placement], method, n_rays: [n_shot, n_all], n_leaks } = progress;
    let percent = 100 * n_shot / n_all;
    format!("{n_shot} of {n_all} rays, {percent} %, {n_leaks} leaks; now {mesh}, {placement}, by {method}")
}

/// The bunny with its holes closed; `None` if it is not available.
fn bunny() -> Result<Option<Closed>> {
    let Some(scene) = models::scene("bunny")? else { return Ok(None) };
    let mesh = scene.meshes.into_iter().next().ok_or_else(|| anyhow!("the bunny's file has no mesh"))?;
    let closed = closed_up("bunny, closed", Mesh { positions: mesh.positions, triangles: mesh.triangles });
    closed.map(Some).ok_or_else(|| anyhow!("the bunny's holes cannot be closed"))
}

/// A row per tracer over all meshes, then a row per mesh over all tracers.
fn table(found: &[Found]) -> String {
    let mut lines = vec![
        "| tracer or mesh | triangles | rays | queries ended early by the driver | leaks |".to_owned(),
        "|---|---|---|---|---|".to_owned(),
    ];
    let mut by_name: BTreeMap<(u8, &str), (String, [usize; 3])> = BTreeMap::new();
    for row in found {
        let kinds = [
            (0, row.method.as_str(), String::new()),
            (1, row.mesh, row.n_triangles.to_string()),
            (2, "all", String::new()),
        ];
        for (kind, name, triangles) in kinds {
            let (_, sums) = by_name.entry((kind, name)).or_insert((triangles, [0; 3]));
            for (sum, n) in sums.iter_mut().zip([row.n_rays, row.n_cut, row.n_leaks]) {
                *sum += n;
            }
        }
    }
    for ((_, name), (triangles, [n_rays, n_cut, n_leaks])) in by_name {
        lines.push(format!("| {name} | {triangles} | {n_rays} | {n_cut} | {n_leaks} |"));
    }
    lines.join("\n")
}
