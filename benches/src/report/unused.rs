//! Unused features: features that a scene does not need, forced in, and what each would cost.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::Film;
use canted_fixtures::grid;
use canted_gpu::{Choice, Gpu, block_on};
use canted_obb::Affine;
use canted_renderer::{
    DevicePicture, Integrator, Levels, Monitor, Pattern, SceneBvh, SceneBvhConfig, Settings, Surfaces, frame, render,
};
use canted_scene::{
    AlphaMode, Camera, Encoding, Instance, Light, Material, MaterialId, Mesh, MeshId, Part, Scene, Texture, TextureId,
    TextureRef, Wrap,
};

use super::{
    model::{Axis, Cell, Chapter, Point, Series, Table},
    samples::{Samples, number},
};
use crate::report::model::Effort;
use crate::{models, timing};

/// A scene as it is, or with a feature forced in.
struct Variant {
    what: &'static str,
    scene: Scene,
    prepared: SceneBvh,
}

/// The cost of a variant.
struct Cost {
    what: &'static str,
    seconds: Samples,
    n_bytes: usize,
    is_same: bool,
}

/// The scene with its own textures and masks.
const SPONZA: &str = "sponza";

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "unused", title: "Cost of unused features", ..Chapter::default() };
    let mut scenes = vec![("built-in", canted_scene::builtin()), ("terrain under a sun alone", one_light())];
    for name in effort.pick(&[][..], &["bunny"], &["bunny", "truss", SPONZA]) {
        let scene = match *name {
            SPONZA => crate::picture::sponza()?,
            name => models::load(name)?.map(|model| plain(model.mesh.positions, model.mesh.triangles)),
        };
        match scene {
            Some(scene) => scenes.push((name, scene)),
            None => chapter.skipped.push(format!("{name}: the model is not available.")),
        }
    }
    let (mut savings, mut says) = (vec![], vec![]);
    for (name, scene) in scenes {
        savings.push((name, add(&mut chapter, name, &scene, effort)?));
    }
    says.push(over_scenes(&savings));
    says.extend(savings.iter().map(|(name, features)| sentence(name, features)));
    chapter.set_sentences(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "Sponza has its textures and masks and a sun and a sky; bunny and truss are gray meshes under a sun and a \
     sky; the terrain is gray under a sun and a black sky, because only a scene with one light needs no light selection. Each scene \
     is rendered as it is and with one feature forced in, in turn: a top-level BVH; instances that move by one unit in the last \
     place, which also need a top-level BVH; a white texture on every material; unused texture coordinates; masks that are fully \
     opaque; normals equal to those of the triangles; one triangle that emits 1e-30; a second light without power. Times are \
     processor seconds of all threads of the path integrator; bytes are those of the structure and the scene's arrays.",
    "On a device, if one is available, the same features are counted as bindings of the picture's kernel with their bytes, and \
     measured in wall time, which other work slows down on a software driver.",
    "Some features change rounding and therefore bits: a top-level BVH transforms rays into each mesh's space, normals are \
     interpolated, and more lights use other random numbers.",
];

/// What an unused feature would cost.
struct Saving {
    feature: &'static str,
    /// Relative to the plain scene, minus one.
    time: f64,
    is_noise: bool,
    /// Bytes in addition to the plain scene's; negative if the structure is smaller.
    n_bytes: i64,
}

/// Over all features and scenes, how many save time, and the largest savings.
fn over_scenes(savings: &[(&str, Vec<Saving>)]) -> String {
    let all = || savings.iter().flat_map(|(scene, features)| features.iter().map(move |feature| (*scene, feature)));
    let significant = || all().filter(|(_, feature)| !feature.is_noise && feature.time > 0.0);
    let slowest =
        significant().max_by(|a, b| a.1.time.total_cmp(&b.1.time)).map_or_else(String::new, |(scene, feature)| {
            format!(", at most {}% ('{}' on {scene})", number(100.0 * feature.time), feature.feature)
        });
    let largest = all().max_by_key(|(_, feature)| feature.n_bytes).map_or_else(String::new, |(scene, feature)| {
        let megabytes = feature.n_bytes as f64 / 1e6;
        format!(", and up to {} MB ('{}' on {scene})", number(megabytes), feature.feature)
    });
    format!(
        "Of {} unused features on {} scenes, skipping {} saves time beyond noise{slowest}{largest}.",
        all().count(),
        savings.len(),
        significant().count()
    )
}

/// What the unused features of one scene would cost.
fn sentence(name: &str, features: &[Saving]) -> String {
    let significant = features.iter().filter(|feature| !feature.is_noise && feature.time > 0.0);
    match significant.max_by(|a, b| a.time.total_cmp(&b.time)) {
        Some(feature) => format!(
            "On {name} '{}' would cost the most of {} unused features: {}% of the time.",
            feature.feature,
            features.len(),
            number(100.0 * feature.time)
        ),
        None if features.is_empty() => format!("On {name} no feature is unused."),
        None => format!("On {name} the savings of {} unused features are noise.", features.len()),
    }
}

fn add(chapter: &mut Chapter, name: &str, scene: &Scene, effort: Effort) -> Result<Vec<Saving>> {
    let variants = variants(scene)?;
    let [width, height] = size(effort);
    let camera = frame(scene, &variants[0].prepared, f64::from(width) / f64::from(height));
    let costs = measure(&variants, &camera, effort)?;
    let plain = &costs[0];
    let mut table = Table::new(
        format!("{name}: unused features forced in"),
        &["feature", "render", "over the plain scene", "bytes", "additional bytes", "same picture, bit for bit"],
    );
    for cost in &costs {
        table.rows.push(vec![
            Cell::text(cost.what),
            Cell::measured(cost.seconds.scaled(1e3), "ms"),
            Cell::text(if std::ptr::eq(cost, plain) { "–".to_owned() } else { over(&cost.seconds, &plain.seconds) }),
            Cell::text(cost.n_bytes.to_string()),
            Cell::text(format!("{:+}", more(cost.n_bytes, plain.n_bytes))),
            Cell::text(if cost.is_same { "yes" } else { "no" }),
        ]);
    }
    chapter.tables.push(table);
    for (feature, why) in NOT_FORCED {
        if variants[0].prepared.unused.iter().any(|item| item.feature == feature) {
            chapter.skipped.push(format!("{name}, {feature}: also unused, but {why}."));
        }
    }
    plot(chapter, &format!("{name}, {width} x {height}"), &costs);
    add_bindings(chapter, name, &variants, &camera, effort)?;
    let saving = |cost: &Cost| {
        let ratio = cost.seconds.over(&plain.seconds);
        let n_bytes = more(cost.n_bytes, plain.n_bytes);
        Saving { feature: cost.what, time: ratio.median - 1.0, is_noise: ratio.is_noise(), n_bytes }
    };
    Ok(costs[1..].iter().map(saving).collect())
}

/// Additional time relative to the plain scene, and whether it is noise.
fn over(seconds: &Samples, plain: &Samples) -> String {
    let ratio = seconds.over(plain);
    let noise = if ratio.is_noise() { ", noise" } else { "" };
    format!("{:+.1}%{noise}", 100.0 * (ratio.median - 1.0))
}

/// Bytes in addition to the plain scene's, possibly negative.
fn more<N: TryInto<i64>>(n_bytes: N, plain: N) -> i64 {
    let [n_bytes, plain] = [n_bytes, plain].map(|n| n.try_into().unwrap_or(i64::MAX));
    n_bytes - plain
}

/// The scene as it is, then with each unused feature forced in.
fn variants(scene: &Scene) -> Result<Vec<Variant>> {
    let usual = SceneBvhConfig::default();
    let prepared = SceneBvh::build(scene, &usual)?;
    let is_unused = |forcing: &&Forcing| prepared.unused.iter().any(|item| item.feature == forcing.feature);
    let forcings: Vec<&Forcing> = FORCINGS.iter().filter(is_unused).collect();
    let mut variants = vec![Variant { what: "nothing", scene: scene.clone(), prepared }];
    for forcing in forcings {
        let (scene, levels) = (forcing.force)(scene.clone());
        let prepared = SceneBvh::build(&scene, &SceneBvhConfig { levels, ..usual })?;
        variants.push(Variant { what: forcing.feature, scene, prepared });
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

fn plot(chapter: &mut Chapter, name: &str, costs: &[Cost]) {
    let series = costs.iter().map(|cost| Series {
        name: cost.what.to_owned(),
        points: vec![Point::new(String::new(), cost.n_bytes as f64, cost.seconds.scaled(1e3))],
        is_joined: false,
    });
    chapter.plot(
        format!("{name}: time and memory with unused features forced in"),
        Axis::linear("bytes"),
        Axis::linear("render, processor ms"),
        series.collect(),
    );
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
            let (film, took) = timing::time_all(|| render(scene, &prepared, camera, &settings, &|_, _| {}, &cancel));
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
        n_bytes: variant.prepared.n_bytes() + n_bytes(&variant.scene),
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

/// Adds the bindings of each feature, or the reason why no adapter opens.
fn add_bindings(
    chapter: &mut Chapter,
    name: &str,
    variants: &[Variant],
    camera: &Camera,
    effort: Effort,
) -> Result<()> {
    let gpu = match block_on(Gpu::open(&Choice::Best)) {
        Ok(gpu) => gpu,
        Err(error) => {
            chapter.skipped.push(format!("{name}, bindings on a device: {error}."));
            return Ok(());
        }
    };
    let settings = settings(effort.pick([8, 8], [32, 18], [64, 36]), 1);
    let surfaces: Vec<Surfaces<'_>> =
        variants.iter().map(|variant| Surfaces::with_lod(&variant.scene, settings.lod)).collect();
    let mut pictures = vec![];
    for (variant, surfaces) in variants.iter().zip(&surfaces) {
        match DevicePicture::new(&gpu, surfaces, &variant.prepared, camera, &settings) {
            Ok(picture) => pictures.push((variant.what, picture)),
            Err(error) => chapter.skipped.push(format!("{name}, {} on a device: {error}.", variant.what)),
        }
    }
    let mut ms: Vec<Vec<f64>> = vec![vec![]; pictures.len()];
    // The driver compiles in round 0.
    for round in 0..=effort.pick(2, 5, 11) {
        for ((_, picture), ms) in pictures.iter().zip(&mut ms) {
            let cancel = AtomicBool::new(false);
            let monitor = Monitor::quiet(&cancel);
            let (film, took) = timing::time(|| picture.render(vec![], &monitor));
            film?;
            if round > 0 {
                ms.push(took.wall * 1e3);
            }
        }
    }
    let title = format!("{name}: bindings of the picture's kernel on {} ({})", gpu.info().name, gpu.info().kind);
    let mut table = Table::new(
        title,
        &[
            "feature",
            "bindings",
            "bytes",
            "additional bytes",
            "not in the plain scene",
            "picture",
            "over the plain scene",
        ],
    );
    let ms: Vec<Samples> = ms.into_iter().map(Samples::from).collect();
    let Some(bare) = pictures.first().map(|(_, picture)| picture.buffers()) else { return Ok(()) };
    let sum = |buffers: &[(&str, u64)]| buffers.iter().map(|(_, n_bytes)| n_bytes).sum::<u64>();
    for (i, ((what, picture), ms_of_one)) in pictures.iter().zip(&ms).enumerate() {
        let buffers = picture.buffers();
        let is_new = |name: &&str| bare.iter().all(|(known, _)| known != name);
        let new: Vec<&str> = buffers.iter().map(|(name, _)| *name).filter(is_new).collect();
        table.rows.push(vec![
            Cell::text(*what),
            Cell::text(buffers.len().to_string()),
            Cell::text(sum(&buffers).to_string()),
            Cell::text(format!("{:+}", more(sum(&buffers), sum(&bare)))),
            Cell::text(if new.is_empty() { "–".to_owned() } else { new.join(", ") }),
            Cell::measured(ms_of_one.clone(), "ms"),
            Cell::text(if i == 0 { "–".to_owned() } else { over(ms_of_one, &ms[0]) }),
        ]);
    }
    chapter.tables.push(table);
    Ok(())
}

/// A feature that `prepare` reports as unused, and how to force it in.
pub(super) struct Forcing {
    pub(super) feature: &'static str,
    pub(super) force: fn(Scene) -> (Scene, Levels),
}

pub(super) const FORCINGS: [Forcing; 8] = [
    Forcing { feature: "top-level BVH", force: |scene| (scene, Levels::Two) },
    Forcing { feature: "motion", force: |scene| (with_least_motion(scene), Levels::Auto) },
    Forcing { feature: "textures", force: |scene| (with_white(scene), Levels::Auto) },
    Forcing { feature: "texture coordinates", force: |scene| (with_coordinates(scene), Levels::Auto) },
    Forcing { feature: "alpha test", force: |scene| (with_masks(scene), Levels::Auto) },
    Forcing { feature: "shading normals", force: |scene| (with_flat_normals(scene), Levels::Auto) },
    Forcing { feature: "emission", force: |scene| (with_least_light(scene), Levels::Auto) },
    Forcing { feature: "light selection", force: |scene| (with_dark_sun(scene), Levels::Auto) },
];

/// Features that are not forced in here, and why.
pub(super) const NOT_FORCED: [(&str, &str); 2] = [
    ("oriented nodes", "`cargo xtask bench nodes` forces them in"),
    ("listed lights", "a light with power would change the picture, and one without power is never sampled"),
];

/// Radiance of a triangle where emission is forced in: negligible next to any visible light, with a power that is a
/// normal number.
const LEAST_RADIANCE: f32 = 1e-30;

/// A gray mesh under a sun and a sky.
pub(super) fn plain(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Scene {
    let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
    Scene {
        meshes: vec![Mesh { positions, triangles, parts, ..Mesh::default() }],
        instances: vec![Instance {
            mesh: MeshId(0),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        }],
        materials: vec![Material { specular: 0.0, ..Material::default() }],
        lights: vec![Light::Sun { direction: [0.48, -0.64, 0.6], irradiance: [2.0; 3] }],
        environment: Some([0.4, 0.5, 0.6].into()),
        ..Scene::default()
    }
}

/// Terrain of a few thousand triangles with a sun as its only light.
pub(super) fn one_light() -> Scene {
    let terrain = grid(5, [64, 64]);
    // Its heights are along z, and the sun shines down along y.
    let positions = terrain.positions.into_iter().map(|[x, y, z]| [x, z, -y]).collect();
    Scene { environment: None, ..plain(positions, terrain.triangles) }
}

fn with_white(mut scene: Scene) -> Scene {
    let texture = TextureRef::new(TextureId(0));
    scene.textures = vec![Texture {
        name: "white".to_owned(),
        width: 1,
        height: 1,
        texels: vec![[255; 4]],
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: canted_scene::Magnification::Linear,
    }];
    for material in &mut scene.materials {
        material.base_color_texture = Some(texture);
    }
    with_coordinates(scene)
}

fn with_coordinates(mut scene: Scene) -> Scene {
    for mesh in &mut scene.meshes {
        mesh.uvs = Some(vec![[0.5; 2]; mesh.positions.len()]);
    }
    scene
}

/// Every instance moves by one unit in the last place.
fn with_least_motion(mut scene: Scene) -> Scene {
    for instance in &mut scene.instances {
        let mut close = instance.world_from_object;
        close.columns[3][0] = close.columns[3][0].next_up();
        instance.world_from_object_close = Some(close);
    }
    scene
}

/// Only the last triangle of the first mesh emits; otherwise a light tree over all triangles would be measured.
fn with_least_light(mut scene: Scene) -> Scene {
    let mesh = &mut scene.meshes[0];
    let material = mesh.parts.last().map_or(MaterialId(0), |feature| feature.material);
    let emissive = Material { emission: [LEAST_RADIANCE; 3], ..scene.materials[material.0 as usize].clone() };
    let n = scene.materials.len();
    scene.materials.push(emissive);
    let last = u32::try_from(mesh.triangles.len() - 1).unwrap_or(u32::MAX);
    mesh.parts.retain(|feature| feature.first_triangle < last);
    mesh.parts.push(Part { first_triangle: last, material: MaterialId(u32::try_from(n).unwrap_or(u32::MAX)) });
    scene
}

fn with_masks(mut scene: Scene) -> Scene {
    for material in &mut scene.materials {
        material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    }
    scene
}

fn with_dark_sun(mut scene: Scene) -> Scene {
    scene.lights.push(Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [0.0; 3] });
    scene
}

/// Separate vertices for every triangle, with its normal.
fn with_flat_normals(mut scene: Scene) -> Scene {
    for mesh in &mut scene.meshes {
        let corners: Vec<[[f32; 3]; 3]> =
            mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect();
        mesh.normals = Some(corners.iter().flat_map(|corners| [normal(corners); 3]).collect());
        mesh.positions = corners.concat();
        let triangles = &mesh.triangles;
        mesh.uvs = mesh.uvs.take().map(|values| of_corners(&values, triangles));
        mesh.second_uvs = mesh.second_uvs.take().map(|values| of_corners(&values, triangles));
        mesh.tangents = mesh.tangents.take().map(|values| of_corners(&values, triangles));
        mesh.colors = mesh.colors.take().map(|values| of_corners(&values, triangles));
        mesh.triangles = (0..).step_by(3).take(corners.len()).map(|first| [first, first + 1, first + 2]).collect();
    }
    scene
}

/// A value for each corner of each triangle, from one for each vertex.
fn of_corners<T: Copy>(values: &[T], triangles: &[[u32; 3]]) -> Vec<T> {
    triangles.iter().flatten().map(|&i| values[i as usize]).collect()
}

fn normal(&[a, b, c]: &[[f32; 3]; 3]) -> [f32; 3] {
    let sub = |p: [f32; 3], q: [f32; 3]| -> [f64; 3] { std::array::from_fn(|k| f64::from(p[k]) - f64::from(q[k])) };
    let ([p, q, r], [x, y, z]) = (sub(b, a), sub(c, a));
    let normal = [q * z - r * y, r * x - p * z, p * y - q * x];
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { normal.map(|x| (x / length) as f32) } else { [0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_bytes_are_negative() {
        assert_eq!(format!("{:+} {:+}", more(4_369_680usize, 4_371_984), more(5u64, 3)), "-2304 +2");
    }

    #[test]
    fn every_forced_feature_is_unused_somewhere() {
        let scenes = [canted_scene::builtin(), one_light()];
        let unused: Vec<&str> = scenes.iter().flat_map(|scene| variants(scene).unwrap()).map(|v| v.what).collect();
        for Forcing { feature, .. } in &FORCINGS {
            assert!(unused.contains(feature), "'{feature}' is never forced in");
        }
    }

    #[test]
    fn times_are_compared_round_by_round() {
        let plain = Samples::from(vec![1.0, 1.1, 1.2, 1.3, 1.5]);
        assert_eq!(over(&plain.scaled(1.25), &plain), "+25.0%");
        assert_eq!(over(&plain, &plain), "+0.0%, noise");
    }

    #[test]
    fn flat_normals_keep_texture_coordinates() {
        let mut scene =
            plain(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]], vec![[0, 1, 2], [2, 1, 3]]);
        scene.meshes[0].uvs = Some((0..4u8).map(|i| [f32::from(i), 0.0]).collect());
        let flat = with_flat_normals(scene).meshes.remove(0);
        assert_eq!(flat.uvs.unwrap().iter().map(|uv| uv[0]).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 2.0, 1.0, 3.0]);
        assert_eq!((flat.positions.len(), flat.normals), (6, Some(vec![[0.0, 0.0, 1.0]; 6])));
    }
}
