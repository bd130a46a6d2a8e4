//! Bias of the hybrid integrator: mean radiance of its pictures relative to the path integrator's.

use std::{fmt::Write, path::Path, sync::atomic::AtomicBool};

use anyhow::Result;
use canted_film::{Comparison, Picture, compare};
use canted_renderer::{Integrator, Pattern, Prepared, Settings, StructureConfig, frame, prepare, render};
use canted_scene::{Camera, Scene, SceneFile};
use canted_trace::Watertight;

use crate::{
    models,
    picture::{kitchen, outside, sponza},
};

const SIZE: [u32; 2] = [160, 90];

/// A scene with its light and view, and samples a pixel.
struct Subject {
    name: &'static str,
    scene: Scene,
    /// `None` for the scene's own camera, or one that shows the whole scene.
    camera: Option<Camera>,
    samples: u32,
}

/// Renders every subject four times and writes the section.
pub(crate) fn section(out: &mut String) -> Result<()> {
    let [width, height] = SIZE;
    let _ = writeln!(
        out,
        "\n## Bias of the hybrid integrator\n\nMean radiance of {width} x {height} pictures by `hybrid` over that by `path`. \
         *direct*: no bounces and no ambient light; *total*: the picture with default options; *indirect*: the rest. The last column \
         is the relative RMSE between the totals, including the noise of both.\n\n\
         | scene | samples | direct | share of direct | indirect | total | relRMSE |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    );
    for subject in subjects()? {
        let prepared = prepare::<Watertight>(&subject.scene, &StructureConfig::default())?;
        let camera = subject.camera(&prepared);
        let picture = |integrator: Integrator, is_direct: bool| -> Result<Picture> {
            let bounces = if is_direct { 0 } else { integrator.bounces() };
            let ao_radius = is_direct.then_some(f32::INFINITY);
            let (samples, pattern) = (subject.samples, Pattern::Sobol);
            let settings =
                Settings { width, height, integrator, samples, pattern, bounces, ao_radius, ..Settings::default() };
            let cancel = AtomicBool::new(false);
            Ok(render(&subject.scene, &prepared.structure, &camera, &settings, &|_, _| {}, &cancel)?.picture())
        };
        let [path, hybrid] = [picture(Integrator::Path, false)?, picture(Integrator::Hybrid, false)?];
        let [direct_path, direct_hybrid] = [picture(Integrator::Path, true)?, picture(Integrator::Hybrid, true)?];
        let Comparison { mean_ratio: total, rel_mse, .. } = compare(&hybrid, &path)?;
        let direct = compare(&direct_hybrid, &direct_path)?.mean_ratio;
        let share = compare(&direct_path, &path)?.mean_ratio;
        let _ = writeln!(
            out,
            "| {} | {} | {direct:.3} | {share:.3} | {:.2} | {total:.3} | {:.2} |",
            subject.name,
            subject.samples,
            (total - direct * share) / (1.0 - share),
            rel_mse.sqrt()
        );
    }
    Ok(())
}

impl Subject {
    fn camera(&self, prepared: &Prepared<Watertight>) -> Camera {
        let [width, height] = SIZE.map(f64::from);
        let of_file = || self.scene.cameras.first().copied();
        self.camera.or_else(of_file).unwrap_or_else(|| frame(&self.scene, &prepared.structure, width / height))
    }
}

/// Built-in scenes, then the available models.
fn subjects() -> Result<Vec<Subject>> {
    let builtin = canted_scene::builtin();
    let mut subjects = vec![
        Subject { name: "built-in scene", scene: builtin, camera: None, samples: 32 },
        Subject { name: "forest of instances", scene: example("forest.toml")?, camera: None, samples: 32 },
        Subject { name: "room with glass and mirror", scene: example("cornell.toml")?, camera: None, samples: 256 },
    ];
    if let Some(scene) = models::scene("eiffel")? {
        subjects.push(Subject { name: "Eiffel Tower", scene: outside(scene), camera: None, samples: 32 });
    }
    if let Some(scene) = sponza()? {
        let camera = Camera::pinhole([700.0, 700.0, -100.0], [-300.0, 250.0, 100.0], [0.0, 1.0, 0.0], 60.0);
        subjects.push(Subject { name: "Sponza", scene, camera: Some(camera), samples: 48 });
    }
    if let Some(scene) = kitchen()? {
        subjects.push(Subject { name: "kitchen", scene, camera: None, samples: 48 });
    }
    Ok(subjects)
}

/// A scene of the repository's examples.
pub(crate) fn example(name: &str) -> Result<Scene> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples")).join(name);
    Ok(SceneFile::read(&path)?.load()?)
}
