//! Traces millions of grazing rays through wide BVHs and compares every answer bit for bit.
//!
//! `cargo xtask grazing [--rays N]` runs it and records the table. `cargo xtask grazing-device [--rays N]` runs it with `--device`: BVHs that
//! a device builds, with every volume strategy, and their answers judged as `canted_tests::device` describes. The reference is the loop over all triangles for small scenes,
//! and for large ones the binary BVH with axis-aligned boxes, which the tests compare with the loop. The number of rays determines
//! the rays on every machine. Exits with 1 if an answer differs.
#![forbid(unsafe_code)]

use std::{
    io::Write,
    process::ExitCode,
    sync::atomic::{AtomicUsize, Ordering},
};

use canted_fixtures::{Grazing, Mesh, displaced_icosphere, poles, scaffold, scaffold_of, soup, truss};
use canted_lbvh::Strategy;
use canted_tests::{
    brute, rays, scenes,
    variants::{binary, build},
};
use canted_trace::{Hit, Intersect, Ray, TriangleTest};
use canted_wide::{Config, Preset};
use rayon::prelude::*;

mod on_device;

/// Default of `--rays`.
const N_RAYS: usize = 10_000_000;

/// Rays of one job.
const JOB: usize = 1_000;

/// Larger scenes use the binary BVH as reference.
const MOST_FOR_THE_LOOP: usize = 2_000;

/// The reference.
struct Oracle {
    name: &'static str,
    closest_hit: brute::Loop<Option<Hit>>,
}

impl Oracle {
    fn new(mesh: &Mesh) -> Self {
        if mesh.triangles.len() <= MOST_FOR_THE_LOOP {
            let closest_hit = brute::of_mesh(mesh, TriangleTest::Watertight);
            return Self { name: "loop over all triangles", closest_hit };
        }
        let bvh = binary(mesh, Strategy::Aabb, TriangleTest::Watertight);
        Self { name: "binary BVH", closest_hit: Box::new(move |ray| bvh.closest_hit(ray)) }
    }
}

fn scenes() -> Vec<(&'static str, Mesh)> {
    let at_1e7 = |mesh: Mesh| mesh.placed(|p| [p[0] * 50.0 + 1e7, p[1] * 50.0 - 1e7, p[2] * 50.0 + 1e7]);
    let mut all: Vec<(&'static str, Mesh)> = vec![
        ("soup", soup(7, 500)),
        ("displaced icosphere", displaced_icosphere(3, 2)),
        ("scaffold, 3 nodes", scaffold_of(1, true, 3)),
        ("scaffold, 3 nodes, at 1e7", at_1e7(scaffold_of(1, false, 3))),
        ("room, rotated", scenes::room(3, 60).off_axis()),
    ];
    all.extend(
        ["truss, part", "tubes", "ribbons"].into_iter().zip(scenes::needles().into_iter().skip(1).map(|c| c.mesh)),
    );
    all.extend([("scaffold", scaffold(1, false)), ("poles", poles(2)), ("truss", truss(4))]);
    all
}

/// Kinds of rays: the grazing classes, from inside, and from 100, 1,000 and 10,000 mesh sizes away.
const N_KINDS: usize = Grazing::ALL.len() + 4;

fn rays_of(mesh: &Mesh, kind: usize, seed: u64) -> Vec<Ray> {
    match kind.checked_sub(Grazing::ALL.len()) {
        None => {
            let mut rays = rays::of_classes(mesh, &[Grazing::ALL[kind]], JOB, seed);
            rays.truncate(JOB);
            rays
        }
        Some(0) => rays::from_inside(mesh, JOB, seed),
        Some(far) => rays::from_afar(mesh, [1e2, 1e3, 1e4][far - 1], JOB, seed),
    }
}

/// Number of rays, hits and differing answers.
#[derive(Default)]
struct Row {
    rays: AtomicUsize,
    hits: AtomicUsize,
    different: AtomicUsize,
}

fn shoot(mesh: &Mesh, oracle: &Oracle, n_rays: usize) -> Row {
    let presets = [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality];
    let trees = presets.map(|preset| build(mesh, &Config::preset(preset)));
    let row = Row::default();
    (0..n_rays.div_ceil(JOB)).into_par_iter().for_each(|job| {
        let rays = rays_of(mesh, job % N_KINDS, 1_000 + job as u64);
        let wants: Vec<_> = rays.iter().map(|ray| (oracle.closest_hit)(ray)).collect();
        row.rays.fetch_add(rays.len(), Ordering::Relaxed);
        row.hits.fetch_add(wants.iter().flatten().count(), Ordering::Relaxed);
        for tree in &trees {
            let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
            tree.closest_hits(&rays, &mut hits);
            tree.occluded_many(&rays, &mut occluded);
            let is_different = |i: &usize| hits[*i] != wants[*i] || occluded[*i] != wants[*i].is_some();
            row.different.fetch_add((0..rays.len()).filter(is_different).count(), Ordering::Relaxed);
        }
    });
    row
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (is_on_device, args) = match &args[..] {
        [first, rest @ ..] if first == "--device" => (true, rest),
        all => (false, all),
    };
    let n_rays = match args {
        [] => Some(if is_on_device { on_device::N_RAYS } else { N_RAYS }),
        [name, n] if name == "--rays" => n.parse().ok(),
        _ => None,
    };
    let mut out = std::io::stdout().lock();
    let Some(n_rays) = n_rays else {
        let _ = writeln!(std::io::stderr(), "usage: grazing [--device] [--rays N]");
        return ExitCode::from(2);
    };
    if is_on_device {
        return on_device::run(&mut out, &scenes(), n_rays);
    }
    let scenes = scenes();
    let mut sums = [0; 3];
    let mut lines = vec!["| scene | triangles | reference | rays | hits | differing answers |".to_owned()];
    lines.push("|---|---|---|---|---|---|".to_owned());
    for (name, mesh) in &scenes {
        let oracle = Oracle::new(mesh);
        let Row { rays, hits, different } = shoot(mesh, &oracle, n_rays.div_ceil(scenes.len()));
        let counts = [rays, hits, different].map(AtomicUsize::into_inner);
        let [rays, hits, different] = counts;
        lines.push(format!("| {name} | {} | {} | {rays} | {hits} | {different} |", mesh.triangles.len(), oracle.name));
        sums = [0, 1, 2].map(|k| sums[k] + counts[k]);
    }
    let [rays, hits, different] = sums;
    lines.push(format!("| all | | | {rays} | {hits} | {different} |"));
    // A closed pipe is not a differing answer.
    let _ = writeln!(out, "{}", lines.join("\n"));
    ExitCode::from(u8::from(different > 0))
}
