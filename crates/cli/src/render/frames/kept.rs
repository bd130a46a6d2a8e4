//! `--resume`: frames that exist.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_film::{Hash, Record, read_picture};
use canted_renderer::{geometry_hash, light_hash, material_hash};
use canted_scene::Scene;

use super::list::FrameList;
use super::{Args, turntable};
use crate::{output, render::difference};

/// Whether a frame exists as a whole picture of this size. Warns about a file that is no whole picture: it is rendered again.
///
/// # Errors
/// A picture of another size, which belongs to another sequence.
pub(super) fn is_whole(path: &Path, [width, height]: [u32; 2]) -> Result<bool> {
    if !path.exists() {
        return Ok(false);
    }
    match read_picture(path) {
        Ok(picture) if [picture.width, picture.height] == [width, height] => Ok(true),
        Ok(picture) => Err(anyhow!(
            "{}: the picture is {} x {}, not {width} x {height}; remove it, or render without --resume",
            path.display(),
            picture.width,
            picture.height
        )),
        Err(error) => {
            output::warn(&format!("rendering the frame again: {error}"));
            Ok(false)
        }
    }
}

/// Rejects a whole picture that was not rendered with this record.
pub(super) fn check(path: &Path, list: &FrameList, ours: &Record) -> Result<()> {
    let (name, remedy) = (path.display(), "remove the picture, or render without --resume");
    let Some(theirs) = list.record_of(path) else {
        let list = list.path().display();
        return Err(anyhow!("{name}: {list} does not state what this picture was rendered with; {remedy}"));
    };
    match difference(theirs, ours) {
        Some((what, theirs, ours)) => {
            Err(anyhow!("{name}: rendered with another {what}: {theirs}, not {ours}; {remedy}"))
        }
        None => Ok(()),
    }
}

/// What all frames share.
pub(super) fn shared(args: &Args, scene: &mut Scene, device: String) -> Result<Record> {
    // Without `..`, so that a new option cannot be forgotten.
    let Args {
        scene: _,
        time: _,
        animation: _,
        variant: _,
        output: _,
        format,
        size: _,
        crop,
        look,
        heatmap,
        heatmap_scale,
        boxes,
        run: _,
        sequence: _,
        samples,
        seed: _,
        filter: _,
        lod: _,
        integrator,
        bounces: _,
        ao_radius: _,
        energy_compensation: _,
        first_hit: _,
        sums: _,
        camera,
        light,
        structure,
    } = args;
    let settings = args.settings()?;
    // Lights differ between frames.
    let lights = std::mem::take(&mut scene.lights);
    let environment = light_hash(scene);
    scene.lights = lights;
    let own = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("device", device),
        ("range of samples", format!("{:?}", settings.range())),
        ("noise", settings.noise.map_or_else(|| "none".to_owned(), |noise| noise.to_string())),
        ("list of channels", samples.aovs().to_string()),
        ("use of --denoise", samples.denoise.to_string()),
        ("heat map", format!("{heatmap:?} {heatmap_scale}")),
        ("boxes", format!("{boxes:?}")),
        ("output format", format!("{format:?}")),
        ("crop", format!("{crop:?}")),
        ("look", format!("{look:?}")),
        ("choice of integrator", integrator.map_or_else(|| "by the scene".to_owned(), |given| format!("{given:?}"))),
        ("acceleration structure", format!("{structure:?}")),
        ("camera", format!("{camera:?}")),
        ("light", format!("{light:?} {environment:016x}")),
        ("material", format!("{:016x}", material_hash(scene))),
    ];
    Ok(own.map(|(name, value)| (name.to_owned(), value)).into_iter().chain(settings.record()).collect())
}

/// The record of a frame whose pose `scene` has.
pub(super) fn of_frame(shared: &Record, args: &Args, [first, end]: [u32; 2], frame: u32, scene: &Scene) -> Record {
    let mut lights = Hash::default();
    lights.debug(&scene.lights);
    lights.debug(&scene.cameras);
    let degrees = args.sequence.turntable.map_or(0.0, |degrees| turntable::degrees(degrees, [first, end], frame));
    let own = [
        ("pose", format!("{:016x}", geometry_hash(scene))),
        ("light or camera of the file", format!("{:016x}", lights.finish())),
        ("turn in degrees", degrees.to_string()),
    ];
    shared.iter().cloned().chain(own.map(|(name, value)| (name.to_owned(), value))).collect()
}
