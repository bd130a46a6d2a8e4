//! Sequences of scenes that move: updates and rays together under each `--update` policy, and a sequence of pictures from a file on
//! disk to files on disk.

use std::{
    fmt::Write,
    fs,
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use anyhow::{Result, ensure};
use canted_film::write_png;
use canted_fixtures::{self as fixtures, Rotation, SplitMix64, View};
use canted_obb::Affine;
use canted_renderer::{SceneBvh, SceneBvhConfig, Settings, UpdateOptions, UpdatePolicy, Updates, render};
use canted_scene::{AnimatedScene, Camera, Instance, Mesh, MeshId, ReadOptions, Scene};
use canted_trace::{Hit, Intersect, Ray};
use elastic::{Material, Simulation, torus};

use crate::{
    models,
    options::Options,
    timing::{self, median},
};

const POLICIES: [(&str, UpdatePolicy); 3] =
    [("auto", UpdatePolicy::Auto), ("refit", UpdatePolicy::Refit), ("rebuild", UpdatePolicy::Rebuild)];

/// Widths of the square pictures: a preview, and a picture of several samples.
const WIDTHS: [u32; 2] = [96, 384];

/// The measurements of one policy over a sequence.
#[derive(Clone, Default)]
struct Took {
    /// Seconds of updates and of rays, of each round.
    seconds: Vec<[f64; 2]>,
    updates: Updates,
}

impl Took {
    /// Milliseconds of a frame: updates, rays, both; medians over the rounds.
    fn ms(&self, n_frames: usize) -> [f64; 3] {
        let scale = 1e3 / n_frames as f64;
        let of = |pick: fn(&[f64; 2]) -> f64| scale * median(&self.seconds.iter().map(pick).collect::<Vec<_>>());
        [of(|s| s[0]), of(|s| s[1]), of(|s| s[0] + s[1])]
    }
}

/// Measures and writes the table.
pub(super) fn policies(out: &mut String, options: &Options) -> Result<()> {
    let (n_frames, rounds) = if options.is_quick { (12, 2) } else { (48, options.rounds.min(3)) };
    let (sequences, missing) = all(n_frames, options.is_quick)?;
    let _ = writeln!(
        out,
        "\n### Update policies\n\nSequences of {n_frames} frames, the first one built alike by all; one thread, all policies in turn in each frame, medians of \
         {rounds} rounds. Milliseconds of processor time of this thread for a frame: its update / its camera rays. `auto over best` compares with the better one \
         of `refit` and `rebuild`, update and rays together.\n\n| sequence and rays | auto | refit | rebuild | auto over best | refits of auto | rebuilds of auto | \
         drift of refit |\n| --- | --- | --- | --- | --- | --- | --- | --- |",
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut worst = (0.0, String::new());
    for sequence in &sequences {
        for width in WIDTHS {
            let name = format!("{}, {} rays", sequence.name, width * width);
            let took = pool.install(|| measure(sequence, width, rounds))?;
            let ms: Vec<[f64; 3]> = took.iter().map(|took| took.ms(sequence.frames.len() - 1)).collect();
            let over = ms[0][2] / ms[1][2].min(ms[2][2]);
            let cells: Vec<String> = ms.iter().map(|[update, rays, _]| format!("{update:.2} / {rays:.2}")).collect();
            let of_auto = &took[0].updates;
            let _ = writeln!(
                out,
                "| {name} | {} | {over:.3} | {} | {} | {:.2} |",
                cells.join(" | "),
                of_auto.refits + of_auto.top_refits,
                of_auto.rebuilds + of_auto.top_rebuilds,
                took[1].updates.max_drift
            );
            if over > worst.0 {
                worst = (over, name);
            }
        }
    }
    let _ =
        writeln!(out, "\n`auto` takes at most {:.3} times as long as the best fixed policy ({}).", worst.0, worst.1);
    missing.iter().for_each(|name| {
        let _ = writeln!(out, "\nNot measured: {name}; the model is not available.");
    });
    Ok(())
}

/// Each policy over the sequence, in turn in each frame.
fn measure(sequence: &Sequence, width: u32, rounds: usize) -> Result<Vec<Took>> {
    let mut all = vec![Took::default(); POLICIES.len()];
    let rays = rays(sequence, width);
    for round in 0..rounds {
        let first = || -> Result<_> { Ok(SceneBvh::build(&sequence.frames[0], &SceneBvhConfig::default())?) };
        let mut prepared = POLICIES.iter().map(|_| first()).collect::<Result<Vec<_>>>()?;
        // The rays of the first frame.
        let mut traces: Vec<f64> = prepared.iter().map(|prepared| traced(prepared, &rays).1).collect();
        all.iter_mut().for_each(|took| {
            took.seconds.push([0.0; 2]);
            took.updates = Updates::default();
        });
        for (frame, scene) in sequence.frames.iter().enumerate().skip(1) {
            let mut hits: Vec<Vec<Option<Hit>>> = vec![];
            for i in 0..POLICIES.len() {
                // No policy is always the first to read the frame.
                let i = (i + frame + round) % POLICIES.len();
                let update =
                    UpdateOptions { policy: POLICIES[i].1, trace_time: Duration::from_secs_f64(traces[i].max(0.0)) };
                let (updates, updating) = timing::time(|| prepared[i].update(scene, &update));
                let (found, tracing) = traced(&prepared[i], &rays);
                let took = &mut all[i];
                took.updates += updates?;
                let seconds = took.seconds.last_mut().expect("a round has started");
                *seconds = [seconds[0] + updating.cpu, seconds[1] + tracing];
                traces[i] = tracing;
                hits.push(found);
            }
            ensure!(hits.iter().all(|found| *found == hits[0]), "{}: policies differ in frame {frame}", sequence.name);
        }
    }
    Ok(all)
}

/// Hits of all rays, and the seconds of processor time that they took.
fn traced(prepared: &SceneBvh, rays: &[Ray]) -> (Vec<Option<Hit>>, f64) {
    let (hits, took) = timing::time(|| rays.iter().map(|ray| prepared.closest_hit(ray)).collect::<Vec<_>>());
    (hits, took.cpu)
}

/// The pixels of a picture; the camera stands still.
fn rays(sequence: &Sequence, width: u32) -> Vec<Ray> {
    let [eye, target] = sequence.view.unwrap_or_else(|| {
        let bounds = sequence.frames[sequence.frames.len() / 2].bounds_world();
        let [low, high] = [bounds.min, bounds.max].map(|p| p.map(f64::from));
        let center: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let away = [0.9, 0.7, 1.1];
        [std::array::from_fn(|k| center[k] + extent * away[k]), center]
    });
    View { eye, target, fov_degrees: 50.0, rotation: Rotation::IDENTITY }.rays(width).iter().map(models::ray).collect()
}

/// Frames per second of the fox and of the elastic body.
const FPS: u16 = 24;

/// The scene of each frame.
pub(super) struct Sequence {
    pub(super) name: &'static str,
    pub(super) frames: Vec<Scene>,
    /// Camera and target; `None` looks at everything.
    pub(super) view: Option<[[f64; 3]; 2]>,
}

/// All sequences, and the names of those whose model is not available; `is_quick` makes them smaller.
fn all(n_frames: u16, is_quick: bool) -> Result<(Vec<Sequence>, Vec<&'static str>)> {
    let mut all = vec![
        twisted(n_frames, if is_quick { 12 } else { 15 }),
        morphed(n_frames, if is_quick { 4 } else { 6 }),
        exploding(n_frames, if is_quick { 200 } else { 2_000 }),
        elastic_body(n_frames, if is_quick { [48, 16] } else { [192, 64] })?,
    ];
    let mut missing = vec![];
    match fox(n_frames)? {
        Some(fox) => all.insert(1, fox),
        None => missing.push("skinned fox"),
    }
    Ok((all, missing))
}

/// A scaffold twisted by two degrees more in each frame.
fn twisted(n_frames: u16, log2_triangles: u32) -> Sequence {
    let still = fixtures::scaffold_of(1, false, fixtures::scaffold_nodes(log2_triangles));
    let [least, greatest] = still.bounds();
    let height = (greatest[2] - least[2]).max(f32::MIN_POSITIVE);
    let at = |frame: u16| {
        let twist = |&[x, y, z]: &[f32; 3]| {
            let (sin, cos) = (f32::from(2 * frame).to_radians() * (z - least[2]) / height).sin_cos();
            [cos * x - sin * y, sin * x + cos * y, z]
        };
        alone(still.positions.iter().map(twist).collect(), &still.triangles)
    };
    Sequence { name: "twisted scaffold", frames: (0..n_frames).map(at).collect(), view: None }
}

/// A sphere that grows bumps and loses them again, as a morph target moves it.
fn morphed(n_frames: u16, level: u32) -> Sequence {
    let (round, bumpy) = (fixtures::icosphere(level), fixtures::displaced_icosphere(3, level));
    let at = |frame: u16| {
        let weight = 4.0 * (std::f32::consts::PI * f32::from(frame) / f32::from(n_frames)).sin();
        let both = round.positions.iter().zip(&bumpy.positions);
        let positions = both.map(|(a, b)| std::array::from_fn(|k| a[k] + weight * (b[k] - a[k])));
        alone(positions.collect(), &round.triangles)
    };
    Sequence { name: "morphing sphere", frames: (0..n_frames).map(at).collect(), view: None }
}

/// Instances of two meshes that fly apart and spin.
fn exploding(n_frames: u16, n: u32) -> Sequence {
    let mesh = |mesh: fixtures::Mesh| Mesh {
        positions: mesh.positions.iter().map(|p| p.map(|x| 0.02 * x)).collect(),
        triangles: mesh.triangles,
        ..Mesh::default()
    };
    let meshes = vec![mesh(fixtures::icosphere(2)), mesh(fixtures::displaced_icosphere(1, 3))];
    let at = |frame: u16| {
        let (mut rng, mut first_primitive) = (SplitMix64::new(5), 0);
        let instances = (0..n).map(|i| {
            let (away, spin) = (rng.signed3().map(|x| x as f32), rng.signed() as f32);
            let (sin, cos) = (0.3 * spin * f32::from(frame)).sin_cos();
            let at = away.map(|x| x * (0.5 + 0.05 * f32::from(frame) * (1.0 + spin)));
            let place = Instance {
                mesh: MeshId(i % 2),
                world_from_object: Affine { columns: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0], at] },
                world_from_object_close: None,
                first_primitive,
            };
            first_primitive += u32::try_from(meshes[i as usize % 2].triangles.len()).expect("few triangles");
            place
        });
        Scene { instances: instances.collect(), meshes: meshes.clone(), ..Scene::default() }
    };
    Sequence { name: "exploding instances", frames: (0..n_frames).map(at).collect(), view: None }
}

/// The elastic ring of `examples/elastic`, which falls and bounces.
fn elastic_body(n_frames: u16, segments: [u32; 2]) -> Result<Sequence> {
    let mut simulation = Simulation::new(&torus([0.45, 0.2], segments, 1.25, 0.5), 0.08, &Material::RUBBER)?;
    let options = UpdateOptions { policy: UpdatePolicy::Refit, ..UpdateOptions::default() };
    let mut frames = vec![simulation.scene.clone()];
    for _ in 1..n_frames {
        simulation.advance(1.0 / f64::from(FPS), &options)?;
        frames.push(simulation.scene.clone());
    }
    Ok(Sequence { name: "falling elastic body", frames, view: Some([[1.3, 1.25, 3.6], [0.0, 0.62, 0.0]]) })
}

/// The run cycle of the fox.
fn fox(n_frames: u16) -> Result<Option<Sequence>> {
    let path = crate::models::folder().join("gltf/Fox.glb");
    if !path.is_file() {
        return Ok(None);
    }
    let options = ReadOptions { animation: Some("Run".to_owned()), ..ReadOptions::default() };
    let (mut animated, mut scene) = AnimatedScene::open(&path, &options)?;
    let mut frames = vec![];
    for frame in 0..n_frames {
        animated.pose(f32::from(frame) / f32::from(FPS), &mut scene)?;
        frames.push(scene.clone());
    }
    Ok(Some(Sequence { name: "skinned fox", frames, view: None }))
}

/// A scene of one mesh.
fn alone(positions: Vec<[f32; 3]>, triangles: &[[u32; 3]]) -> Scene {
    let instance = Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    };
    let mesh = Mesh { positions, triangles: triangles.to_vec(), ..Mesh::default() };
    Scene { meshes: vec![mesh], instances: vec![instance], ..Scene::default() }
}

const N_FRAMES: u16 = 48;
const SIZE: [u32; 2] = [640, 360];
const SAMPLES: u32 = 16;

/// Seconds of wall time.
#[derive(Default)]
struct PictureTook {
    load: f64,
    update: f64,
    rays: f64,
    write: f64,
    all: f64,
    updates: Updates,
}

/// Measures and writes the table.
pub(super) fn pictures(out: &mut String, options: &Options) -> Result<()> {
    let path = models::folder().join("gltf/Fox.glb");
    let [width, height] = if options.is_quick { SIZE.map(|n| n / 8) } else { SIZE };
    let _ = writeln!(
        out,
        "\n### A sequence of pictures\n\n{N_FRAMES} frames of the run cycle of the skinned Fox, {width}x{height}, {SAMPLES} samples, default integrator under a \
         sky, all threads: the file is read, and every frame is posed, updated by `auto`, rendered and written as PNG. Seconds of wall time.\n\n| sequence | read \
         and pose | update | rays | write | all | all over rays | refits | rebuilds |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    );
    if !path.is_file() {
        let _ = writeln!(out, "| skinned fox, not available | | | | | | | | |");
        return Ok(());
    }
    let took = frames(&path, [width, height])?;
    let _ = writeln!(
        out,
        "| skinned fox | {:.3} | {:.3} | {:.2} | {:.3} | {:.2} | {:.3} | {} | {} |",
        took.load,
        took.update,
        took.rays,
        took.write,
        took.all,
        took.all / took.rays,
        took.updates.refits,
        took.updates.rebuilds
    );
    Ok(())
}

fn frames(path: &std::path::Path, [width, height]: [u32; 2]) -> Result<PictureTook> {
    let folder = std::env::temp_dir().join(format!("canted-frames-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let start = Instant::now();
    let mut took = PictureTook::default();
    let read = ReadOptions { animation: Some("Run".to_owned()), ..ReadOptions::default() };
    let (mut animated, mut scene) = AnimatedScene::open(path, &read)?;
    scene.environment = Some([0.8, 0.9, 1.0].into());
    let bounds = scene.bounds_world();
    let target: [f32; 3] = std::array::from_fn(|k| 0.5 * (bounds.min[k] + bounds.max[k]));
    let extent = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(0.0, f32::max);
    let away: [f32; 3] = [0.9, 0.5, 0.8];
    let eye = std::array::from_fn(|k| target[k] + extent * away[k]);
    let camera = Camera::pinhole(eye, target, [0.0, 1.0, 0.0], 45.0);
    let settings = Settings { width, height, samples: SAMPLES, ..Settings::default() };
    let mut prepared = SceneBvh::build(&scene, &SceneBvhConfig::default())?;
    took.load = start.elapsed().as_secs_f64();
    let mut trace_time = Duration::ZERO;
    for frame in 0..N_FRAMES {
        let start = Instant::now();
        animated.pose(f32::from(frame) / f32::from(FPS), &mut scene)?;
        took.load += start.elapsed().as_secs_f64();
        let start = Instant::now();
        took.updates += prepared.update(&scene, &UpdateOptions { trace_time, ..UpdateOptions::default() })?;
        took.update += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let film = render(&scene, &prepared, &camera, &settings, &|_, _| (), &AtomicBool::new(false))?;
        trace_time = start.elapsed();
        took.rays += trace_time.as_secs_f64();
        let start = Instant::now();
        write_png(&folder.join(format!("frame_{frame:04}.png")), &film.picture())?;
        took.write += start.elapsed().as_secs_f64();
    }
    took.all = start.elapsed().as_secs_f64();
    fs::remove_dir_all(&folder)?;
    Ok(took)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sequence_moves_and_keeps_its_triangles() {
        for Sequence { name, frames, .. } in all(3, true).unwrap().0 {
            for (a, b) in frames.iter().zip(&frames[1..]) {
                let triangles =
                    |scene: &Scene| scene.meshes.iter().map(|mesh| mesh.triangles.clone()).collect::<Vec<_>>();
                let positions =
                    |scene: &Scene| scene.meshes.iter().map(|mesh| mesh.positions.clone()).collect::<Vec<_>>();
                assert_eq!(triangles(a), triangles(b), "{name}");
                assert!(positions(a) != positions(b) || a.instances != b.instances, "{name}");
            }
        }
    }
}
