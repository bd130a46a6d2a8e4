//! Grazing rays through BVHs that a device builds.

use std::{io::Write, process::ExitCode};

use canted_fixtures::Mesh;
use canted_gpu::build::{BuildConfig, STRATEGIES};
use canted_gpu::{BufferScene, Choice, Gpu, IndexBuffer, MeshBuffers, wgpu};
use canted_lbvh::Strategy;
use canted_tests::judge::{Tally, World, error_of_one_level};
use canted_trace::Ray;

use crate::{JOB, N_KINDS, Oracle, rays_of};

/// Default of `--rays`, for each strategy.
pub(crate) const N_RAYS: usize = 1_000_000;

/// Traces the rays with each strategy and prints the table.
pub(crate) fn run(out: &mut impl Write, scenes: &[(&'static str, Mesh)], n_rays: usize) -> ExitCode {
    let gpu = match Gpu::open(&Choice::Best) {
        Ok(gpu) => gpu,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "{error}");
            return ExitCode::from(2);
        }
    };
    let _ = writeln!(
        out,
        "| device | volumes | rays | same triangle | ties | only on the device | missed | not answered | lost |"
    );
    let _ = writeln!(out, "|---|---|---|---|---|---|---|---|---|");
    let mut n_lost = 0;
    for strategy in STRATEGIES {
        let (mut tally, mut n_rays_of_all, mut lost) = (Tally::default(), 0, 0);
        for (name, mesh) in scenes {
            let n = n_rays.div_ceil(scenes.len());
            match shoot(&gpu, mesh, strategy, n, &mut tally) {
                Ok(n) => n_rays_of_all += n,
                Err(error) => {
                    let _ = writeln!(std::io::stderr(), "{name}, {strategy:?}: {error}");
                    lost += 1;
                }
            }
        }
        let Tally { n_same, n_ties, n_besides, n_at_ends, n_missed, n_cut, .. } = tally;
        let device = &gpu.info().name;
        let missed = n_missed + n_at_ends;
        let _ = writeln!(
            out,
            "| {device} | {strategy:?} | {n_rays_of_all} | {n_same} | {n_ties} | {n_besides} | {missed} | {n_cut} | {lost} |"
        );
        n_lost += lost;
    }
    ExitCode::from(u8::from(n_lost > 0))
}

/// Traces rays through one scene. Returns their number.
fn shoot(gpu: &Gpu, mesh: &Mesh, strategy: Strategy, n_rays: usize, tally: &mut Tally) -> Result<usize, String> {
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
    let scene = BufferScene::new(gpu, &[buffers], BuildConfig { strategy, ..BuildConfig::default() }).map_err(said)?;
    let oracle = Oracle::new(mesh);
    let mut n = 0;
    // Jobs of several kinds together, so that a dispatch is worth its start.
    let jobs: Vec<usize> = (0..n_rays.div_ceil(JOB)).collect();
    for jobs in jobs.chunks(N_KINDS) {
        let rays: Vec<Ray> = jobs.iter().flat_map(|&job| rays_of(mesh, job % N_KINDS, 1_000 + job as u64)).collect();
        world.check_all(gpu, scene.traced(), &rays, |ray| oracle.closest_hit(ray), tally)?;
        n += rays.len();
    }
    Ok(n)
}
