//! The long run: rays at every vertex and edge of closed meshes, by every way to trace; nothing may slip through.
//!
//! `cargo xtask watertight [--rays N]` runs it and keeps the table. Each ray is asked for its first hit and for any, or
//! counted through. Where the folder of real models is (`CANTED_SCENES`, else `../shared/scenes` beside the workspace) the
//! bunny is among them, its holes closed. Exits with 1 where a ray slips through.
#![forbid(unsafe_code)]

use std::{collections::BTreeMap, io::Write, process::ExitCode};

use canted_fixtures::Mesh;
use canted_tests::{
    closed::{Closed, closed},
    leaks::{Found, closed_up, places, search},
    models::models,
    tracers,
};

/// Rays without `--rays`.
const N_RAYS: usize = 10_000_000;

fn bunny() -> Option<Closed> {
    let scene = canted_scene::read(&models("bunny")?.join("stanford/bunny.ply")).ok()?;
    let mesh = scene.meshes.into_iter().next()?;
    closed_up("bunny, closed", Mesh { positions: mesh.positions, triangles: mesh.triangles })
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let n_rays = match &args[..] {
        [] => Some(N_RAYS),
        [name, n] if name == "--rays" => n.parse().ok(),
        _ => None,
    };
    let (mut out, mut err) = (std::io::stdout().lock(), std::io::stderr());
    let Some(n_rays) = n_rays else {
        let _ = writeln!(err, "usage: watertight [--rays N]");
        return ExitCode::from(2);
    };
    let (ways, missing) = tracers::ours();
    for name in missing {
        let _ = writeln!(err, "not tried, this machine has no {name}");
    }
    let mut meshes = closed();
    match bunny() {
        Some(bunny) => meshes.push(bunny),
        None => drop(writeln!(err, "not tried, there is no stanford/bunny.ply in the folder of models")),
    }
    let found = search(&meshes, &places(), &ways, n_rays);
    // A closed pipe is no leak.
    let _ = writeln!(out, "{}", table(&found));
    ExitCode::from(u8::from(found.iter().any(|found| found.n_leaks > 0)))
}

/// A line each way, over all meshes; then one each mesh, over all ways.
fn table(found: &[Found]) -> String {
    let mut lines =
        vec!["| traced by, or mesh | triangles | rays | leaks |".to_owned(), "|---|---|---|---|".to_owned()];
    let mut by_name: BTreeMap<(u8, &str), (String, usize, usize)> = BTreeMap::new();
    for row in found {
        let kinds = [
            (0, row.way.as_str(), String::new()),
            (1, row.mesh, row.n_triangles.to_string()),
            (2, "all", String::new()),
        ];
        for (kind, name, triangles) in kinds {
            let (_, n_rays, n_leaks) = by_name.entry((kind, name)).or_insert((triangles, 0, 0));
            *n_rays += row.n_rays;
            *n_leaks += row.n_leaks;
        }
    }
    for ((_, name), (triangles, n_rays, n_leaks)) in by_name {
        lines.push(format!("| {name} | {triangles} | {n_rays} | {n_leaks} |"));
    }
    lines.join("\n")
}
