//! Grazing rays through BVHs that a device builds.

use std::{io::Write, process::ExitCode};

use canted_fixtures::Mesh;
use canted_gpu::build::{BuildConfig, STRATEGIES, Topology, WideConfig};
use canted_gpu::{BufferScene, Choice, DeviceBvh, Gpu, IndexBuffer, MeshBuffers, block_on, wgpu};
use canted_lbvh::Strategy;
use canted_tests::device::{Tally, World, error_of_one_level};
use canted_trace::{Hit, Ray};
use rayon::prelude::*;

use crate::{JOB, N_KINDS, Oracle, rays_of};

/// Default of `--rays`, for each BVH.
pub(crate) const N_RAYS: usize = 1_000_000;

/// A kind of BVH, and what its rays found.
struct Row {
    kind: &'static str,
    strategy: Strategy,
    bvh: DeviceBvh,
    tally: Tally,
    n_rays: usize,
    n_lost: usize,
}

impl Row {
    fn new((kind, strategy, bvh): (&'static str, Strategy, DeviceBvh)) -> Self {
        Self { kind, strategy, bvh, tally: Tally::default(), n_rays: 0, n_lost: 0 }
    }
}

/// Every kind of BVH, with every strategy.
fn rows() -> Vec<Row> {
    let binary = STRATEGIES.map(|strategy| ("binary", strategy, BuildConfig { strategy, ..Default::default() }.into()));
    let wide = [("wide", Topology::Radix), ("wide, clustered", Topology::Ploc)].into_iter().cycle().zip(STRATEGIES);
    let wide = wide.map(|((kind, topology), strategy)| {
        (kind, strategy, WideConfig { topology, strategy, ..WideConfig::default() }.into())
    });
    binary.into_iter().chain(wide).map(Row::new).collect()
}

/// Rays, and their hits on the CPU.
type Batch = (Vec<Ray>, Vec<Option<Hit>>);

/// Traces the rays through each kind of BVH and prints the table.
pub(crate) fn run(out: &mut impl Write, scenes: &[(&'static str, Mesh)], n_rays: usize) -> ExitCode {
    let gpu = match block_on(Gpu::open(&Choice::Best)) {
        Ok(gpu) => gpu,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "{error}");
            return ExitCode::from(2);
        }
    };
    let mut rows = rows();
    for (name, mesh) in scenes {
        let batches = batches(mesh, n_rays.div_ceil(scenes.len()));
        for row in &mut rows {
            if let Err(error) = shoot(&gpu, mesh, &batches, row) {
                let _ = writeln!(std::io::stderr(), "{name}, {}, {:?}: {error}", row.kind, row.strategy);
                row.n_lost += 1;
            }
        }
    }
    let _ = writeln!(
        out,
        "| device | BVH | boxes | rays | same triangle | ties | only on the device | missed | not answered | lost |"
    );
    let _ = writeln!(out, "|---|---|---|---|---|---|---|---|---|---|");
    let device = &gpu.info().name;
    for Row { kind, strategy, tally, n_rays, n_lost, .. } in &rows {
        let Tally { n_same, n_ties, n_besides, n_at_ends, n_missed, n_cut, .. } = tally;
        let missed = n_missed + n_at_ends;
        let _ = writeln!(
            out,
            "| {device} | {kind} | {strategy:?} | {n_rays} | {n_same} | {n_ties} | {n_besides} | {missed} | {n_cut} | {n_lost} |"
        );
    }
    ExitCode::from(u8::from(rows.iter().any(|row| row.n_lost > 0)))
}

/// Rays at a mesh. A batch has jobs of several kinds, so that a dispatch is worth its start.
fn batches(mesh: &Mesh, n_rays: usize) -> Vec<Batch> {
    let oracle = Oracle::new(mesh);
    let jobs: Vec<usize> = (0..n_rays.div_ceil(JOB)).collect();
    let batch = |jobs: &[usize]| {
        let rays: Vec<Ray> = jobs.iter().flat_map(|&job| rays_of(mesh, job % N_KINDS, 1_000 + job as u64)).collect();
        let hits = rays.iter().map(|ray| (oracle.closest_hit)(ray)).collect();
        (rays, hits)
    };
    jobs.par_chunks(N_KINDS).map(batch).collect()
}

/// Traces rays through a BVH over one mesh.
fn shoot(gpu: &Gpu, mesh: &Mesh, batches: &[Batch], row: &mut Row) -> Result<(), String> {
    let said = |error: canted_gpu::GpuError| error.to_string();
    let reach = mesh.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()));
    let world = World {
        corners: &|_, primitive| mesh.corners(primitive as usize),
        error: &|ray: &Ray, _| error_of_one_level(ray, reach),
    };
    let vertices = gpu.buffer("positions", &mesh.positions).map_err(said)?;
    let indices = gpu.buffer("indices", &mesh.triangles).map_err(said)?;
    let count = |n: usize| u32::try_from(n).expect("meshes are small");
    let buffers = MeshBuffers {
        vertices: vertices.wgpu(),
        first_byte: 0,
        stride: 12,
        n_vertices: count(mesh.positions.len()),
        indices: Some(IndexBuffer { buffer: indices.wgpu(), format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
        n_triangles: count(mesh.triangles.len()),
    };
    let scene = block_on(BufferScene::new(gpu, &[buffers], row.bvh)).map_err(said)?;
    for (rays, hits) in batches {
        world.check_each(gpu, scene.traced(), rays, hits, &mut row.tally)?;
        row.n_rays += rays.len();
    }
    Ok(())
}
