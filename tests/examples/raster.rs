//! Times the raster pass to first surfaces and the equivalent camera rays:
//! `cargo run --release -p canted-tests --example raster -- FILE`.

use std::path::Path;
use std::time::{Duration, Instant};

use canted_gpu::{Choice, Gpu, SceneInput, TracedScene};
use canted_renderer::{
    DevicePicture, Integrator, Levels, Lod, Prepared, Settings, Structure, StructureConfig, Surfaces, View, frame,
    prepare,
};
use canted_scene::Scene;
use canted_trace::{Ray, Watertight};

const SIZES: [[u32; 2]; 2] = [[480, 270], [1920, 1080]];

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let gpu = Gpu::open(&Choice::Best)?;
    report(&format!("| scene on {} | size | drawn | rays |\n| --- | --- | --- | --- |", gpu.info().name));
    for path in std::env::args().skip(1) {
        let scene = canted_scene::read(Path::new(&path))?;
        let config = StructureConfig { levels: Levels::One, ..StructureConfig::default() };
        let prepared: Prepared<Watertight> = prepare(&scene, &config)?;
        for size in SIZES {
            let [drawn, rays] = times(&gpu, &scene, &prepared, size)?.map(|time| time.as_secs_f64() * 1e3);
            report(&format!("| {path} | {} x {} | {drawn:.1} ms | {rays:.1} ms |", size[0], size[1]));
        }
    }
    Ok(())
}

/// Least of three times of rasterizing the first surfaces, and of tracing one ray per pixel without shading.
fn times(
    gpu: &Gpu,
    scene: &Scene,
    prepared: &Prepared<Watertight>,
    [width, height]: [u32; 2],
) -> Result<[Duration; 2]> {
    let settings = Settings { width, height, lod: Lod::Aniso, integrator: Integrator::Hybrid, ..Settings::default() };
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let structure = &prepared.structure;
    let aspect = f64::from(width) / f64::from(height);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, structure, aspect));
    let picture = DevicePicture::new(gpu, &surfaces, structure, &camera, &settings)?;
    let mut drawn = Duration::MAX;
    for _ in 0..3 {
        drawn = drawn.min(picture.first_surfaces()?.time);
    }
    let traced = traced(gpu, scene, structure)?;
    let view = View::new(&camera, width, height)?;
    let center = |k: u32| [f64::from(k % width) + 0.5, f64::from(k / width) + 0.5];
    let rays: Vec<Ray> = (0..width * height).map(|k| view.ray(center(k))).collect();
    let mut cast = Duration::MAX;
    for _ in 0..3 {
        let start = Instant::now();
        traced.closest_hits(gpu, &rays)?;
        cast = cast.min(start.elapsed());
    }
    Ok([drawn, cast])
}

fn traced(gpu: &Gpu, scene: &Scene, structure: &Structure<Watertight>) -> Result<TracedScene> {
    let Structure::One(flat) = structure else { return Err("expected one level".into()) };
    let canted_renderer::Bvh::Wide(wide) = flat.bvh() else { return Err("expected a wide BVH".into()) };
    let mut first = 0_u32;
    let firsts: Vec<u32> = scene
        .instances
        .iter()
        .map(|instance| {
            let this = first;
            first += u32::try_from(scene.meshes[instance.mesh.0 as usize].triangles.len()).unwrap_or(u32::MAX);
            this
        })
        .collect();
    Ok(TracedScene::new(gpu, SceneInput::upload([wide]).parts(&firsts))?)
}

#[expect(clippy::print_stdout, reason = "the program's output")]
fn report(line: &str) {
    println!("{line}");
}
