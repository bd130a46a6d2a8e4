//! What was left out: parts that a scene does without, forced back in, and what each would have cost.

mod bindings;
mod forcings;
mod trees;

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::Film;
use canted_renderer::{Integrator, Pattern, Prepared, Settings, StructureConfig, frame, prepare, render};
use canted_scene::{Camera, Mesh, Scene};
use canted_trace::Watertight;

use forcings::{FORCINGS, Forcing, NOT_FORCED, bare, one_light};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number};
use super::subjects;
use crate::clock;
use crate::models;

/// A scene as it is, or with a part forced in.
struct Variant {
    what: &'static str,
    scene: Scene,
    prepared: Prepared<Watertight>,
}

/// What a variant takes.
struct Cost {
    what: &'static str,
    seconds: Samples,
    n_bytes: usize,
    is_same: bool,
}

/// The scene that has textures and masks of its own.
const SPONZA: &str = "sponza";

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "left-out", title: "What was left out", ..Chapter::default() };
    let mut scenes = vec![("built-in", canted_scene::builtin()), ("terrain under a sun alone", one_light())];
    for name in effort.pick(&[][..], &["bunny"], &["bunny", "truss", SPONZA]) {
        let scene = match *name {
            SPONZA => subjects::lit_sponza()?,
            name => models::load(name)?.map(|model| bare(model.mesh.positions, model.mesh.triangles)),
        };
        match scene {
            Some(scene) => scenes.push((name, scene)),
            None => chapter.skipped.push(format!("{name}: the model is not at hand.")),
        }
    }
    let (mut savings, mut says) = (vec![], vec![]);
    for (name, scene) in scenes {
        savings.push((name, add(&mut chapter, name, &scene, effort)?));
    }
    says.push(over_scenes(&savings));
    says.extend(savings.iter().map(|(name, parts)| sentence(name, parts)));
    says.extend(trees::add(&mut chapter, effort)?);
    chapter.tell(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 4] = [
    "Sponza is the whole scene, with its textures and masks, lit as in the chapter of pictures; bunny and truss are grey meshes under a \
     sun and a sky; the terrain is grey under a sun and a black sky, for only a scene of one light does without a choice among lights. \
     Each scene is rendered as it is and with one part forced back in, in turn: two levels; instances that move by one unit in the last \
     place, which need two levels too; a white texture on every material; coordinates that nothing looks up; masks that cut nothing \
     out; normals that say what the triangles say; one triangle that emits 1e-30; a second light without power. Seconds are the \
     processor's, all threads, of the path integrator; bytes those of the structure and of the scene's arrays.",
    "On a device, where one opens, the same parts are counted as bindings of the picture's kernel and their bytes, and timed by the \
     clock on the wall, which a software driver shares with everything else.",
    "Trees are wide and balanced, traced on one thread in turn: as the collapse chose them, with leaning nodes taken for a tenth of \
     their cost so that they come back everywhere, without any, and with a counter of boxes and triangles in the walk.",
    "A part that changes roundings changes bits: two levels map rays into each mesh's space, normals are interpolated, and lights \
     are chosen by other numbers where there are more of them.",
];

/// What a part that is left out would cost, were it in.
struct Saving {
    part: &'static str,
    /// Over the bare scene's, less one.
    time: f64,
    is_noise: bool,
    /// More bytes than the bare scene's; fewer where the structure has less to hold.
    n_bytes: i64,
}

/// Of all parts on all scenes, how many save time, and the most.
fn over_scenes(savings: &[(&str, Vec<Saving>)]) -> String {
    let all = || savings.iter().flat_map(|(scene, parts)| parts.iter().map(move |part| (*scene, part)));
    let real = || all().filter(|(_, part)| !part.is_noise && part.time > 0.0);
    let dearest = real().max_by(|a, b| a.1.time.total_cmp(&b.1.time)).map_or_else(String::new, |(scene, part)| {
        format!(", at most {}% ('{}' on {scene})", number(100.0 * part.time), part.part)
    });
    let heaviest = all().max_by_key(|(_, part)| part.n_bytes).map_or_else(String::new, |(scene, part)| {
        #[expect(clippy::cast_precision_loss, reason = "bytes are fewer than 2^53")]
        let megabytes = part.n_bytes as f64 / 1e6;
        format!(", and up to {} MB ('{}' on {scene})", number(megabytes), part.part)
    });
    format!(
        "Of {} parts that {} scenes do without {} save time beyond noise{dearest}{heaviest}.",
        all().count(),
        savings.len(),
        real().count()
    )
}

/// What the parts of one scene would cost.
fn sentence(name: &str, parts: &[Saving]) -> String {
    let real = parts.iter().filter(|part| !part.is_noise && part.time > 0.0);
    match real.max_by(|a, b| a.time.total_cmp(&b.time)) {
        Some(part) => format!(
            "On {name} '{}' costs most of the {} parts left out: {}% of the time, were it in.",
            part.part,
            parts.len(),
            number(100.0 * part.time)
        ),
        None if parts.is_empty() => format!("On {name} nothing is left out."),
        None => format!("On {name} what {} parts left out save of the time is noise.", parts.len()),
    }
}

fn add(chapter: &mut Chapter, name: &str, scene: &Scene, effort: Effort) -> Result<Vec<Saving>> {
    let variants = variants(scene)?;
    let [width, height] = size(effort);
    let camera = frame(scene, &variants[0].prepared.structure, f64::from(width) / f64::from(height));
    let costs = measure(&variants, &camera, effort)?;
    let bare = &costs[0];
    let mut table = Table::new(
        format!("{name}: forced back in"),
        &["part", "render", "over the bare scene", "bytes", "more bytes", "same picture, bit for bit"],
    );
    for cost in &costs {
        table.rows.push(vec![
            Cell::text(cost.what),
            Cell::measured(cost.seconds.scaled(1e3), "ms"),
            Cell::text(if std::ptr::eq(cost, bare) { "–".to_owned() } else { over(&cost.seconds, &bare.seconds) }),
            Cell::text(cost.n_bytes.to_string()),
            Cell::text(format!("{:+}", more(cost.n_bytes, bare.n_bytes))),
            Cell::text(if cost.is_same { "yes" } else { "no" }),
        ]);
    }
    chapter.tables.push(table);
    for (part, why) in NOT_FORCED {
        if variants[0].prepared.unused.iter().any(|item| item.feature == part) {
            chapter.skipped.push(format!("{name}, {part}: left out too, but {why}."));
        }
    }
    plot(chapter, &format!("{name}, {width} x {height}"), &costs);
    bindings::add(chapter, name, &variants, &camera, effort)?;
    let saving = |cost: &Cost| {
        let ratio = cost.seconds.over(&bare.seconds);
        let n_bytes = more(cost.n_bytes, bare.n_bytes);
        Saving { part: cost.what, time: ratio.median - 1.0, is_noise: ratio.is_noise(), n_bytes }
    };
    Ok(costs[1..].iter().map(saving).collect())
}

/// How much longer than the bare scene, and whether that is noise.
fn over(seconds: &Samples, bare: &Samples) -> String {
    let ratio = seconds.over(bare);
    let noise = if ratio.is_noise() { ", noise" } else { "" };
    format!("{:+.1}%{noise}", 100.0 * (ratio.median - 1.0))
}

/// How many bytes more than the bare scene's, or how many fewer.
fn more<N: TryInto<i64>>(n_bytes: N, bare: N) -> i64 {
    let [n_bytes, bare] = [n_bytes, bare].map(|n| n.try_into().unwrap_or(i64::MAX));
    n_bytes - bare
}

/// The scene as it is, then with each part that it does without.
fn variants(scene: &Scene) -> Result<Vec<Variant>> {
    let usual = StructureConfig::default();
    let prepared = prepare::<Watertight>(scene, &usual)?;
    let is_left_out = |forcing: &&Forcing| prepared.unused.iter().any(|item| item.feature == forcing.part);
    let forcings: Vec<&Forcing> = FORCINGS.iter().filter(is_left_out).collect();
    let mut variants = vec![Variant { what: "nothing", scene: scene.clone(), prepared }];
    for forcing in forcings {
        let (scene, levels) = (forcing.force)(scene.clone());
        let prepared = prepare(&scene, &StructureConfig { levels, ..usual })?;
        variants.push(Variant { what: forcing.part, scene, prepared });
    }
    Ok(variants)
}

fn size(effort: Effort) -> [u32; 2] {
    effort.pick([24, 14], [96, 54], [160, 90])
}

fn settings([width, height]: [u32; 2], samples: u32) -> Settings {
    Settings {
        width,
        height,
        samples,
        integrator: Integrator::Path,
        pattern: Pattern::Sobol,
        bounces: 3,
        tile: 8,
        ..Settings::default()
    }
}

#[expect(clippy::cast_precision_loss, reason = "bytes are fewer than 2^53")]
fn plot(chapter: &mut Chapter, name: &str, costs: &[Cost]) {
    let series = costs.iter().map(|cost| Series {
        name: cost.what.to_owned(),
        points: vec![Point { label: String::new(), x: (cost.n_bytes as f64).into(), y: cost.seconds.scaled(1e3) }],
        is_joined: false,
    });
    chapter.plots.push(Plot {
        title: format!("{name}: time and memory with parts forced back in"),
        x: Axis::linear("bytes"),
        y: Axis::linear("render, processor ms"),
        series: series.collect(),
    });
}

/// Renders all variants in turn.
fn measure(variants: &[Variant], camera: &Camera, effort: Effort) -> Result<Vec<Cost>> {
    let settings = settings(size(effort), effort.pick(1, 4, 16));
    let rounds = effort.pick(2, 7, 11);
    let mut seconds = vec![vec![]; variants.len()];
    let mut films: Vec<Option<Film>> = vec![None; variants.len()];
    for round in 0..=rounds {
        for (i, Variant { scene, prepared, .. }) in variants.iter().enumerate() {
            let cancel = AtomicBool::new(false);
            let (film, took) =
                clock::time_all(|| render(scene, &prepared.structure, camera, &settings, &|_, _| {}, &cancel));
            films[i] = Some(film?);
            if round > 0 {
                seconds[i].push(took.cpu);
            }
        }
    }
    let pixels = |i: usize| films[i].as_ref().map(Film::pixels);
    let cost = |(i, (variant, seconds)): (usize, (&Variant, Vec<f64>))| Cost {
        what: variant.what,
        seconds: seconds.into(),
        n_bytes: variant.prepared.structure.n_bytes() + n_bytes(&variant.scene),
        is_same: pixels(i) == pixels(0),
    };
    Ok(variants.iter().zip(seconds).enumerate().map(cost).collect())
}

/// Bytes of the arrays of meshes and textures.
fn n_bytes(scene: &Scene) -> usize {
    let of_mesh = |mesh: &Mesh| {
        size_of_val(&mesh.positions[..])
            + size_of_val(&mesh.triangles[..])
            + mesh.normals.as_deref().map_or(0, size_of_val)
            + mesh.uvs.as_deref().map_or(0, size_of_val)
    };
    let of_textures = scene.textures.iter().map(|texture| size_of_val(&texture.texels[..])).sum::<usize>();
    scene.meshes.iter().map(of_mesh).sum::<usize>() + of_textures
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_bytes_are_said_to_be_fewer() {
        assert_eq!(format!("{:+} {:+}", more(4_369_680usize, 4_371_984), more(5u64, 3)), "-2304 +2");
    }

    #[test]
    fn every_part_that_can_be_forced_is_left_out_somewhere() {
        let scenes = [canted_scene::builtin(), one_light()];
        let left_out: Vec<&str> = scenes.iter().flat_map(|scene| variants(scene).unwrap()).map(|v| v.what).collect();
        for Forcing { part, .. } in &FORCINGS {
            assert!(left_out.contains(part), "'{part}' is never forced back in");
        }
    }

    #[test]
    fn times_are_compared_round_by_round() {
        let bare = Samples::from(vec![1.0, 1.1, 1.2, 1.3, 1.5]);
        assert_eq!(over(&bare.scaled(1.25), &bare), "+25.0%");
        assert_eq!(over(&bare, &bare), "+0.0%, noise");
    }
}
