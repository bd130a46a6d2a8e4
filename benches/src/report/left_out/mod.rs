//! What was left out: parts that a scene does without, forced back in, and what each would have cost.

mod forcings;
mod trees;

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_renderer::{Film, Integrator, Levels, Pattern, Settings, StructureConfig, frame, prepare, render};
use canted_scene::{Mesh, Scene};
use canted_trace::Watertight;

use forcings::{FORCINGS, Forcing, bare};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table, sentences};
use super::samples::{Samples, number};
use crate::clock;
use crate::models;

/// What a scene takes, bare or with a part forced in.
struct Cost {
    what: &'static str,
    seconds: Samples,
    n_bytes: usize,
    is_same: bool,
}

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "left-out", title: "What was left out", ..Chapter::default() };
    let mut scenes = vec![("built-in", canted_scene::builtin())];
    for name in effort.pick(&[][..], &["bunny"], &["bunny", "truss", "sponza"]) {
        match models::load(name)? {
            Some(model) => scenes.push((name, bare(model.mesh.positions, model.mesh.triangles))),
            None => chapter.skipped.push(format!("{name}: the model is not at hand.")),
        }
    }
    let mut says = vec![];
    for (name, scene) in scenes {
        says.push(add(&mut chapter, name, &scene, effort)?);
    }
    says.push(trees::add(&mut chapter, effort)?);
    chapter.says = sentences(&says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "Each scene is rendered as it is and with one part forced back in, in turn: a white texture on every material, masks that cut \
     nothing out, normals that say what the triangles say, a second light without power, two levels. Seconds are the processor's, all \
     threads, of the path integrator; bytes those of the structure and of the scene's arrays.",
    "Trees are wide and balanced, traced on one thread in turn: as the collapse chose them, with leaning nodes taken for a tenth of \
     their cost so that they come back everywhere, without any, and with a counter of boxes and triangles in the walk.",
    "A part that changes roundings changes bits: two levels map rays into each mesh's space, and normals are interpolated.",
];

fn add(chapter: &mut Chapter, name: &str, scene: &Scene, effort: Effort) -> Result<String> {
    let left_out: Vec<&str> =
        prepare::<Watertight>(scene, &StructureConfig::default())?.left_out.iter().map(|item| item.part).collect();
    let forcings: Vec<&Forcing> = FORCINGS.iter().filter(|forcing| left_out.contains(&forcing.part)).collect();
    let costs = measure(scene, &forcings, effort)?;
    let bare = &costs[0];
    let mut table = Table::new(
        format!("{name}: forced back in"),
        &["part", "render", "over the bare scene", "bytes", "more bytes", "same picture, bit for bit"],
    );
    for cost in &costs {
        let ratio = cost.seconds.median() / bare.seconds.median();
        let noise = if cost.seconds.is_noise_beside(&bare.seconds) { ", noise" } else { "" };
        let more = cost.n_bytes.saturating_sub(bare.n_bytes);
        table.rows.push(vec![
            Cell::text(cost.what),
            Cell::measured(cost.seconds.scaled(1e3), "ms"),
            Cell::text(format!("{:+.1}%{noise}", 100.0 * (ratio - 1.0))),
            Cell::text(cost.n_bytes.to_string()),
            Cell::text(more.to_string()),
            Cell::text(if cost.is_same { "yes" } else { "no" }),
        ]);
    }
    chapter.tables.push(table);
    let named: Vec<&str> = left_out.iter().filter(|part| !forcings.iter().any(|f| f.part == **part)).copied().collect();
    chapter.skipped.push(format!("{name}, left out too but not forced: {}.", named.join(", ")));
    plot(chapter, name, &costs);
    let dearest = costs[1..].iter().max_by(|a, b| a.seconds.median().total_cmp(&b.seconds.median()));
    Ok(match dearest {
        Some(cost) if !cost.seconds.is_noise_beside(&bare.seconds) && cost.seconds.median() > bare.seconds.median() => {
            let share = 100.0 * (cost.seconds.median() / bare.seconds.median() - 1.0);
            format!(
                "On {name} leaving out {} parts saves most with '{}': {}% of the time.",
                costs.len() - 1,
                cost.what,
                number(share)
            )
        }
        Some(_) => format!("On {name} what {} parts left out save of the time is noise.", costs.len() - 1),
        None => format!("On {name} nothing is left out."),
    })
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

/// The bare scene first, then with each part.
fn measure(scene: &Scene, forcings: &[&Forcing], effort: Effort) -> Result<Vec<Cost>> {
    let mut variants = vec![("nothing", scene.clone(), Levels::Auto)];
    variants.extend(forcings.iter().map(|forcing| {
        let (scene, levels) = (forcing.force)(scene.clone());
        (forcing.part, scene, levels)
    }));
    let [width, height] = effort.pick([24, 14], [96, 54], [160, 90]);
    let samples = effort.pick(1, 4, 16);
    let settings = Settings {
        width,
        height,
        samples,
        integrator: Integrator::Path,
        pattern: Pattern::Sobol,
        bounces: 3,
        tile: 8,
        ..Settings::default()
    };
    let prepared = variants
        .iter()
        .map(|(_, scene, levels)| {
            prepare::<Watertight>(scene, &StructureConfig { levels: *levels, ..StructureConfig::default() })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let camera = frame(scene, &prepared[0].structure, f64::from(width) / f64::from(height));
    let rounds = effort.pick(2, 7, 11);
    let mut seconds = vec![vec![]; variants.len()];
    let mut films: Vec<Option<Film>> = vec![None; variants.len()];
    for round in 0..=rounds {
        for (i, (_, scene, _)) in variants.iter().enumerate() {
            let cancel = AtomicBool::new(false);
            let (film, took) =
                clock::time_all(|| render(scene, &prepared[i].structure, &camera, &settings, &|_, _| {}, &cancel));
            films[i] = Some(film?);
            if round > 0 {
                seconds[i].push(took.cpu);
            }
        }
    }
    let pixels = |i: usize| films[i].as_ref().map(Film::pixels);
    Ok(variants
        .iter()
        .zip(seconds)
        .enumerate()
        .map(|(i, ((what, scene, _), seconds))| Cost {
            what,
            seconds: seconds.into(),
            n_bytes: prepared[i].structure.n_bytes() + n_bytes(scene),
            is_same: pixels(i) == pixels(0),
        })
        .collect())
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
