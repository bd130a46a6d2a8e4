//! `--frames`: the pictures of an animation or of a turning camera.
//!
//! ```text
//! source (pose) -> build or update -> camera (turntable) -> picture -> file (names)
//! ```

mod resume;
mod source;

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use anyhow::{Error, Result, anyhow};
use canted_film::{Aov, Record};
use canted_renderer::{Integrator, RenderError, SceneBvh, UpdateOptions, UpdatePolicy, Updates};
use canted_scene::Scene;
use serde_json::{Value, json};

use super::{Frame, Job, LastFrame, Picture, facts, facts::Fact, open_machine, render_picture, setup};
#[cfg(feature = "gpu")]
use canted_gpu::DeviceBvh;
#[cfg(feature = "gpu")]
use canted_renderer::{DeviceFrames, DeviceUpdates};

use crate::{
    device::Machine,
    light::LightSource,
    load,
    output::{self, Named},
    process,
    settings::LookOptions,
};
use resume::FrameList;
use source::{FrameNames, Source, turned};

/// Renders all frames and prints the report.
pub(super) fn run(job: &Job, [first, end]: [u32; 2]) -> Result<()> {
    let start = Instant::now();
    let names = FrameNames::parse(&job.output.path)?;
    job.sequence.check_time(end - 1)?;
    let (inputs, scene_file) = (job.plan.inputs()?, job.plan.source.scene.as_deref());
    let others: Vec<Named> = inputs.named().into_iter().chain(job.checkpoint_file()).collect();
    output::check_distinct(&[], &others)?;
    let (mut todo, mut whole) = (Vec::new(), Vec::new());
    for frame in first..end {
        let path = names.path(frame);
        output::check_distinct(&others, &[("--output", &path)])?;
        let is_whole = job.sequence.resume && resume::is_whole(&path, job.output.shown_size())?;
        if is_whole { &mut whole } else { &mut todo }.push(frame);
    }
    if let Some(&frame) = todo.first() {
        output::probe(&names.path(frame))?;
    }
    let time = job.sequence.time(whole.iter().chain(&todo).copied().min().unwrap_or(first));
    let mut source = Source::open(job, time).map_err(|error| in_frame(first, error))?;
    let machine = &open_machine(job)?;
    let job = &job.on(machine);
    let mut list = FrameList::read(names.list());
    let shared = resume::shared(job, source.unposed(), machine.name());
    let sequence = Sequence { job, machine, names: &names, todo: &todo, shared: &shared, load_time: start.elapsed() };
    let mut decisions = Decisions::default();
    if list.path().exists() {
        for &frame in &whole {
            source.pose(job, job.sequence.time(frame)).map_err(|error| in_frame(frame, error))?;
            resume::check(&names.path(frame), &list, &resume::of_frame(&shared, job, frame, &source.scene))?;
        }
    } else {
        check_by_rendering(&sequence, &mut source, &whole, &mut decisions)?;
    }
    let n_kept = (end - first) as usize - todo.len();
    let mut facts = vec![
        ("scene", json!(load::name(scene_file))),
        ("picture", json!(job.output.path.display().to_string())),
        ("size", json!(job.output.shown_size())),
        ("frames", json!(format!("{first}..{end}"))),
        ("rendered_frames", json!(todo.len())),
        ("kept_frames", json!(n_kept)),
    ];
    if !todo.is_empty() {
        let checkpoint: Vec<Named> = job.checkpoint_file().into_iter().collect();
        load::check_outputs(scene_file, &source.scene, &checkpoint)?;
        for &frame in &todo {
            let path = names.path(frame);
            load::check_outputs(scene_file, &source.scene, &[("--output", &path)])?;
        }
        let paths: Vec<PathBuf> = todo.iter().map(|&frame| names.path(frame)).collect();
        list.forget(paths.iter().map(PathBuf::as_path))?;
        facts.extend(render_all(&sequence, &mut source, &mut list, &mut decisions)?);
    }
    list.remove()?;
    facts.extend(process::peak_bytes().map(|bytes| ("peak_memory_bytes", json!(bytes))));
    facts.push(("seconds", json!(start.elapsed().as_secs_f64())));
    facts::report(&facts, job.run.json)
}

/// An error with the number of its frame; an interruption stays one.
fn in_frame(frame: u32, error: Error) -> Error {
    match error.downcast_ref() {
        Some(RenderError::Cancelled) => error,
        _ => anyhow!("frame {frame}: {error}"),
    }
}

/// The frames to render.
struct Sequence<'a> {
    job: &'a Job,
    machine: &'a Machine,
    names: &'a FrameNames,
    todo: &'a [u32],
    /// What the records of all frames share.
    shared: &'a Record,
    load_time: Duration,
}

/// What frames share on a device, which builds the BVHs itself with some builders.
#[cfg(feature = "gpu")]
fn on_device(job: &Job) -> DeviceFrames {
    let frames = DeviceFrames::new(job.sequence.update);
    match job.plan.structure.built_on_gpu {
        Some(DeviceBvh::Wide(wide)) => frames.with_wide(wide),
        // The device builds binary BVHs anyway.
        Some(DeviceBvh::Binary(_)) | None => frames,
    }
}

/// Checks the whole pictures of a finished sequence, which has no list: renders the first and the last again, and compares the files.
fn check_by_rendering(
    sequence: &Sequence,
    source: &mut Source,
    whole: &[u32],
    decisions: &mut Decisions,
) -> Result<()> {
    let (Some(&first), Some(&last)) = (whole.first(), whole.last()) else { return Ok(()) };
    let frames = if first == last { vec![first] } else { vec![first, last] };
    let names = &sequence.names.temporary();
    let mut list = FrameList::read(names.list());
    let rendered = render_all(&Sequence { names, todo: &frames, ..*sequence }, source, &mut list, decisions);
    let same = frames.iter().map(|&frame| resume::check_same(&sequence.names.path(frame), &names.path(frame)));
    let checked = rendered.and_then(|_| same.collect::<Result<()>>());
    frames.iter().for_each(|&frame| drop(fs::remove_file(names.path(frame))));
    list.remove()?;
    checked
}

/// Renders the frames in order. Returns the facts of the whole sequence.
fn render_all(
    sequence: &Sequence,
    source: &mut Source,
    list: &mut FrameList,
    decisions: &mut Decisions,
) -> Result<Vec<Fact>> {
    let mut progress = Progress {
        bvh: None,
        updates: Updates::default(),
        trace_time: Duration::ZERO,
        last: LastFrame {
            #[cfg(feature = "gpu")]
            device: sequence.machine.has_gpu().then(|| on_device(sequence.job)),
            ..LastFrame::default()
        },
        decisions,
        #[cfg(feature = "gpu")]
        is_noted: false,
        is_dark: false,
    };
    let (mut facts, mut pictures) = (Vec::new(), Vec::new());
    for (done, &frame) in sequence.todo.iter().enumerate() {
        let start = Instant::now();
        let rendered = render_frame(sequence, source, &mut progress, frame, done);
        if crate::process::is_interrupted() {
            let n = sequence.todo.len();
            output::note(&format!("{done} of {n} frames are finished; --resume continues with frame {frame}"));
        }
        let (of_frame, record) = rendered.map_err(|error| in_frame(frame, error))?;
        list.add(&sequence.names.path(frame), record)?;
        facts = facts::sum(facts, of_frame);
        pictures.push(json!({
            "frame": frame,
            "time": sequence.job.sequence.time(frame),
            "picture": sequence.names.path(frame).display().to_string(),
            "seconds": start.elapsed().as_secs_f64(),
        }));
    }
    let updated = of_updates(sequence.job.sequence.update, &progress.updates);
    #[cfg(feature = "gpu")]
    let updated = of_device(updated, progress.last.device.as_ref().map(DeviceFrames::updates).unwrap_or_default());
    facts.extend(updated);
    if sequence.job.run.json {
        facts.push(("pictures", Value::Array(pictures)));
    }
    Ok(facts)
}

/// What the first frame decides for all, so that a sequence does not flicker.
#[derive(Default)]
struct Decisions {
    /// Whether emission lights the scene, and whether most of what is seen reflects light.
    emission: Option<(LightSource, bool)>,
    integrator: Option<Integrator>,
    /// With the exposure.
    look: Option<LookOptions>,
}

/// What one frame hands to the next.
struct Progress<'a> {
    bvh: Option<SceneBvh>,
    updates: Updates,
    trace_time: Duration,
    last: LastFrame,
    decisions: &'a mut Decisions,
    /// Whether it was said that the device does not build the BVHs.
    #[cfg(feature = "gpu")]
    is_noted: bool,
    /// Whether a frame was nearly black: one warning is enough.
    is_dark: bool,
}

/// Renders and writes a frame. Returns what it was rendered with, too.
fn render_frame(
    sequence: &Sequence,
    source: &mut Source,
    progress: &mut Progress<'_>,
    frame: u32,
    done: usize,
) -> Result<(Vec<Fact>, Record)> {
    let &Sequence { job, machine, names, todo, shared, load_time } = sequence;
    let (start, name) = (Instant::now(), load::name(job.plan.source.scene.as_deref()));
    let mut light = source.pose(job, job.sequence.time(frame))?;
    let load_time = start.elapsed() + if done == 0 { load_time } else { Duration::ZERO };
    let scene = &mut source.scene;
    let record = resume::of_frame(shared, job, frame, scene);
    let mut own = job.clone();
    own.output.path = names.path(frame);
    if own.plan.shows_z_up(scene) {
        own.plan.set_z_up();
        if done == 0 {
            output::note(setup::Z_UP);
        }
    }
    let options = UpdateOptions { policy: job.sequence.update, trace_time: progress.trace_time };
    let Progress { bvh: last_bvh, updates, .. } = progress;
    let mut build = |scene: &Scene| match last_bvh.take() {
        Some(mut bvh) if updates_in_place(job) => {
            *updates += bvh.update(scene, &options).map_err(|error| rejected(scene, &name, &error))?;
            Ok(bvh)
        }
        _ => SceneBvh::build(scene, &job.plan.structure.config_for(scene))
            .map_err(|error| rejected(scene, &name, &error)),
    };
    let (bvh, mut staged) = setup::stage(scene, &own.plan, light, &mut build)?;
    let bvh = progress.bvh.insert(bvh);
    let (mut camera, of_camera) = own.plan.camera(scene, bvh, staged.as_ref())?;
    if light == LightSource::Emission {
        let (decided, reflects) = match progress.decisions.emission {
            Some(known) => known,
            None => {
                let decided = setup::decided(scene, bvh, &camera, &own.plan, light, &mut staged)?;
                (decided, staged.is_none_or(|staged| staged.reflects))
            }
        };
        if let Some(staged) = &mut staged {
            staged.reflects = reflects;
        }
        (light, progress.decisions.emission) = (decided, Some((decided, reflects)));
    }
    setup::settle(scene, bvh, &camera, &own.plan, light, staged.as_ref())?;
    if let Some(integrator) = progress.decisions.integrator {
        own.plan.choose(integrator);
    }
    if let Some(look) = &progress.decisions.look {
        own.plan.look.clone_from(look);
    }
    // By the camera at rest, so that a turntable does not flicker.
    let (plan, mip_maps) = (&mut own.plan, &mut progress.last.mip_maps);
    let choice = setup::choose(scene, bvh, (&camera, of_camera), plan, light, staged.as_ref(), mip_maps)?;
    progress.decisions.integrator = own.plan.integrator;
    progress.decisions.look = Some(own.plan.look.clone());
    own.output.look = own.plan.look.clone();
    if job.sequence.turntable.is_some() {
        camera = turned(camera, job.sequence.degrees(frame));
    }
    let label = format!("frame {frame} ({} of {}) ", done + 1, todo.len());
    let view = Frame { scene, bvh, camera: &camera, choice, label: &label };
    let Picture { rendered, trace_time } = render_picture(&view, &own, machine, &mut progress.last)?;
    progress.trace_time = trace_time;
    #[cfg(feature = "gpu")]
    if let Some(reason) = progress.last.device.as_ref().and_then(DeviceFrames::fallback_reason)
        && !std::mem::replace(&mut progress.is_noted, true)
    {
        output::note(&format!("frame {frame}: the CPU builds the BVHs: {reason}"));
    }
    if !progress.is_dark
        && let Some(warning) = rendered.darkness(&own.output)
    {
        progress.is_dark = true;
        output::warn(&format!("frame {frame}: {warning}"));
    }
    let mut facts = rendered.write(&own.output)?;
    facts.push(("load_seconds", json!(load_time.as_secs_f64())));
    Ok((facts, record))
}

/// Whether a frame may use the updated BVHs of the last one: not where the picture shows the BVH itself.
fn updates_in_place(job: &Job) -> bool {
    job.plan.heatmap.is_none() && !job.output.aovs.contains(Aov::Tests)
}

/// The error of a scene that cannot be traced, with the first vertex that is not finite in world space, if there is one.
fn rejected(scene: &Scene, name: &str, error: &canted_renderer::PrepareError) -> Error {
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let image = |position: &[f32; 3]| instance.world_from_object.point(*position);
        let lost = mesh.positions.iter().position(|position| image(position).iter().any(|x| !x.is_finite()));
        if let Some(vertex) = lost {
            let [x, y, z] = image(&mesh.positions[vertex]);
            let (mesh, number) = (&mesh.name, instance.mesh.0);
            return anyhow!(
                "{name}: mesh {number} {mesh:?}: vertex {vertex} is not finite in world space: {x}, {y}, {z}"
            );
        }
    }
    anyhow!("{name}: {error}")
}

/// Facts about updates, and about those on a device, if it built the BVHs that rays traverse.
#[cfg(feature = "gpu")]
fn of_device(mut facts: Vec<Fact>, updates: DeviceUpdates) -> Vec<Fact> {
    let DeviceUpdates { whole, refits, rebuilds, top_rebuilds } = updates;
    if whole == 0 {
        return facts;
    }
    let decision = format!(
        "on the GPU: whole builds {whole}, refits {refits}, rebuilds {rebuilds}, rebuilds of the top level {top_rebuilds}"
    );
    facts.iter_mut().filter(|(name, _)| *name == "update_decision").for_each(|(_, text)| *text = json!(decision));
    let of_gpu = [
        ("gpu_whole_builds", json!(whole)),
        ("gpu_bvh_refits", json!(refits)),
        ("gpu_bvh_rebuilds", json!(rebuilds)),
        ("gpu_top_rebuilds", json!(top_rebuilds)),
    ];
    facts.extend(of_gpu);
    facts
}

/// Facts about the updates between frames.
fn of_updates(policy: UpdatePolicy, updates: &Updates) -> Vec<Fact> {
    let Updates { unchanged, refits, rebuilds, top_unchanged, top_refits, top_rebuilds, whole, .. } = *updates;
    let milliseconds = |time: Duration, n: usize| 1e3 * time.as_secs_f64() / n.max(1) as f64;
    let decision = match (refits, rebuilds) {
        (0, 0) => "no BVH over triangles changed".to_owned(),
        _ => format!(
            "{refits} refits of {:.2} ms, {rebuilds} rebuilds of {:.2} ms, greatest drift {:.2}",
            milliseconds(updates.refit_time, refits),
            milliseconds(updates.rebuild_time, rebuilds),
            updates.max_drift
        ),
    };
    vec![
        ("update", json!(policy.name())),
        ("update_decision", json!(decision)),
        ("bvhs_unchanged", json!(unchanged)),
        ("bvh_refits", json!(refits)),
        ("bvh_rebuilds", json!(rebuilds)),
        ("top_unchanged", json!(top_unchanged)),
        ("top_refits", json!(top_refits)),
        ("top_rebuilds", json!(top_rebuilds)),
        ("whole_updates", json!(whole)),
        ("greatest_drift", json!(updates.max_drift)),
        ("update_seconds", json!(updates.time.as_secs_f64())),
        ("refit_seconds", json!(updates.refit_time.as_secs_f64())),
        ("rebuild_seconds", json!(updates.rebuild_time.as_secs_f64())),
    ]
}
