//! `canted render`: a picture, and what it took.

mod args;
mod camera;
mod checkpoint;
mod choices;
mod exposure;
mod facts;
mod film;
mod look;
mod samples;

use std::{
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Film, Picture, Record, write_exr, write_film, write_png};
use canted_renderer::{Measure, Surfaces, heatmap};
use canted_scene::Scene;
use canted_wide::LaneKernel;
use serde_json::json;

use crate::{
    Outcome,
    device::{DeviceArg, Machine},
    left_out, load, memory,
    options::{self, with_kernel},
    output::{self, Named},
};
pub(crate) use args::Args;
use args::{HeatmapArg, of_tiles};
use checkpoint::Keeper;
pub(crate) use checkpoint::difference;
use facts::Fact;
use film::Maker;
pub(crate) use look::{Looked, look};

/// Whether a file's name says EXR.
pub(crate) fn is_exr(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"))
}

/// Whether a file's name says PNG.
pub(crate) fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

/// Tells of names of files that are no pictures, and of options that the picture has no room for.
fn check_output(args: &Args) -> Result<()> {
    let path = &args.output;
    if !is_exr(path) && !is_png(path) {
        return Err(anyhow!("{}: pictures end in .png or .exr", path.display()));
    }
    args.samples.check(is_exr(path), args.heatmap.is_some())
}

/// What was made.
enum Made {
    Picture(Picture),
    Film(Film, Record),
}

impl Made {
    fn write(&self, args: &Args) -> Result<()> {
        match self {
            Self::Film(film, record) if film.part().is_some() || !film.guides().is_empty() => {
                write_film(&args.output, film, args.samples.aovs(), record)?;
                Ok(())
            }
            Self::Film(film, _) => write_picture(&args.output, &film.picture()),
            Self::Picture(picture) => write_picture(&args.output, picture),
        }
    }
}

fn write_picture(path: &Path, picture: &Picture) -> Result<()> {
    Ok(if is_exr(path) { write_exr(path, picture) } else { write_png(path, picture) }?)
}

/// What was made, what it took, and the checkpoint that is of no more use once it is written.
struct Run {
    made: Made,
    facts: Vec<Fact>,
    keeper: Option<Keeper>,
}

/// Renders the picture.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    options::use_threads(args.threads)?;
    check_output(args)?;
    let checkpoint = args.samples.checkpoint.as_deref().map(|path| ("--checkpoint", path));
    let outputs: Vec<Named> = [("--output", args.output.as_path())].into_iter().chain(checkpoint).collect();
    output::check_distinct(&args.inputs()?.named(), &outputs)?;
    args.settings()?;
    let machine = machine(args)?;
    // A place that cannot be written is told before the work.
    output::probe(&args.output)?;
    let start = Instant::now();
    let mut scene = load::scene_at(args.scene.as_deref(), args.time)?;
    load::check_outputs(args.scene.as_deref(), &scene, &outputs)?;
    let default_light = args.light.apply(&mut scene)?;
    let load_time = start.elapsed();
    let run = with_kernel!(args.structure.triangles, trace(&mut scene, args, &machine, default_light, load_time))?;
    let written = run.made.write(args);
    if let Some(keeper) = run.keeper {
        // A picture that finds no place, on a full disk say, is not to be made once more.
        if written.is_ok() { keeper.remove()? } else { keeper.save() }
    }
    written?;
    let mut facts = vec![
        ("scene", json!(load::name(args.scene.as_deref()))),
        ("picture", json!(args.output.display().to_string())),
        ("size", json!(args.size)),
    ];
    facts.extend(run.facts);
    if let Some(bytes) = memory::peak_bytes() {
        facts.push(("peak_memory_bytes", json!(bytes)));
    }
    facts.push(("seconds", json!(start.elapsed().as_secs_f64())));
    facts::report(&facts, args.json)?;
    Ok(Outcome::Done)
}

/// Opens what computes the picture.
fn machine(args: &Args) -> Result<Machine> {
    match (args.heatmap, &args.device) {
        (None, device) => device.open(),
        (Some(_), DeviceArg::Auto | DeviceArg::Cpu) => Ok(Machine::Cpu),
        (Some(_), _) => Err(anyhow!("--heatmap shows the tests of the CPU: use --device cpu")),
    }
}

fn trace<K: LaneKernel>(
    scene: &mut Scene,
    args: &Args,
    machine: &Machine,
    default_light: bool,
    load_time: Duration,
) -> Result<Run> {
    let Looked { prepared, camera, default_light } = look::<K>(scene, args, default_light)?;
    let settings = args.settings()?;
    let mut facts = facts::built(scene, &prepared, load_time);
    facts.extend(default_light.map(|strength| ("default_light", json!(strength))));
    let scene: &Scene = scene;
    let start = Instant::now();
    let mut keeper = None;
    let made = if let Some(measure) = args.heatmap {
        let measure = match measure {
            HeatmapArg::Boxes => Measure::Boxes,
            HeatmapArg::Triangles => Measure::Triangles,
        };
        let surfaces = Surfaces::new(scene);
        let map = heatmap(&surfaces, &prepared.structure, &camera, args.size, measure, args.heatmap_scale)?;
        let [boxes, triangles] = map.mean();
        facts.push(("box_tests_per_ray", json!(boxes)));
        facts.push(("triangle_tests_per_ray", json!(triangles)));
        Made::Picture(map.picture)
    } else {
        let surfaces = machine.gpu().map(|_| Surfaces::with_lod(scene, settings.lod));
        let maker = Maker::new(machine, args, surfaces.as_ref(), &prepared.structure, &camera, &settings)?;
        let needs_record = settings.part.is_some() || args.samples.checkpoint.is_some();
        let record = if needs_record { args.record(scene, &camera, &settings, maker.device()) } else { Record::new() };
        let mut done = Vec::new();
        if let Some(path) = &args.samples.checkpoint {
            let interval = Duration::from_secs(args.samples.checkpoint_every.into());
            let (opened, tiles) = Keeper::open(path.clone(), interval, &of_tiles(&record, &settings))?;
            (keeper, done) = (Some(opened), tiles);
        }
        let (film, of_device) = maker.film(scene, &prepared, &camera, (args, &settings), keeper.as_ref(), done)?;
        facts.extend(of_device);
        facts.extend(facts::of_film(&film, &settings, start.elapsed()));
        if let Some(warning) = facts::of_dropped(&film) {
            output::to_stderr(&warning);
        }
        Made::Film(film, record)
    };
    facts.push(("trace_seconds", json!(start.elapsed().as_secs_f64())));
    facts.push(("threads", json!(rayon::current_num_threads())));
    facts.push(("left_out", left_out::json(&prepared.left_out, args.heatmap.is_some())));
    Ok(Run { made, facts, keeper })
}
