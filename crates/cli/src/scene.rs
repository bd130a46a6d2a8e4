//! `canted scene`: writes a scene file that contains every setting of a picture.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
use canted_renderer::{View, environment_of};
use canted_scene::{Environment, EnvironmentSource, Scene, SceneFile};

use crate::{
    load, options,
    output::{self, Named},
    render::{self, Setup},
    settings::{self, PICTURE, PictureArgs, Plan, Purpose, SceneSettings},
};

/// Options of `canted scene`: those of `canted render` that determine the picture.
pub(crate) type Args = PictureArgs<SceneOutput>;

/// Options of `canted scene` alone.
#[derive(clap::Args, Clone)]
#[command(
    after_help = "Examples:\n  canted scene room.glb -o room.toml\n  canted scene room.toml --spp 256 --eye 0,2,5 -o better.toml"
)]
pub(crate) struct SceneOutput {
    /// Output scene file: .toml. A file of this name is replaced [default: scene.toml]
    #[arg(short, long, help_heading = PICTURE, display_order = 3, value_name = "FILE", allow_hyphen_values = true)]
    output: Option<PathBuf>,
    /// Without --output, replace scene.toml even if it was not written by canted.
    #[arg(long, help_heading = PICTURE, display_order = 3)]
    force: bool,
}

/// The output without `--output`.
const DEFAULT_OUTPUT: &str = "scene.toml";

/// Writes the scene file. `canted render` makes the same picture of it as of the same scene with the same options.
pub(crate) fn run(args: Args) -> Result<()> {
    let SceneOutput { output, force } = args.own.clone();
    let keeps_others = output.is_none() && !force;
    let path = &output.unwrap_or_else(|| DEFAULT_OUTPUT.into());
    if !load::is_scene_file(path) {
        return Err(output::unsupported(path, ".toml"));
    }
    let given = args.structure.0.clone();
    let of_scene = settings::scene_file(args.source.scene.as_deref())?;
    let mut plan = args.resolve(of_scene.as_ref(), &Purpose::default())?;
    plan.options.structure.warn_ignored_preset(&given);
    let outputs: [Named; 1] = [("--output", path)];
    output::check_distinct(&plan.inputs()?.named(), &outputs)?;
    output::probe(path)?;
    if keeps_others && path.exists() && !SceneFile::is_own(path) {
        let name = path.display();
        return Err(anyhow!(
            "{name} is not a scene file that canted wrote; use -o for another name, or --force to replace it"
        ));
    }
    options::use_threads(None)?;
    let mut file = match plan.source.scene.as_deref() {
        Some(scene) if load::is_scene_file(scene) => {
            load::check_asset_options(scene, &plan.source.read_options(plan.source.time()))?;
            load::scene_file(scene)?.moved_to(path)?
        }
        scene => SceneFile::for_scene(scene, path)?,
    };
    if let Some(time) = plan.source.time() {
        file = file.with_time(time);
    }
    if let Some(animation) = &plan.source.animation {
        file = file.with_animation(animation);
    }
    if let Some(variant) = &plan.source.variant {
        file = file.with_variant(variant);
    }
    if !plan.source.files.texture_path.is_empty() {
        file = file.with_texture_paths(&plan.source.files.texture_path)?;
    }
    if plan.source.files.allows_parent() {
        file = file.with_allow_parent(true);
    }
    let radii = [plan.source.files.line_radius, plan.source.files.point_radius];
    if radii.iter().any(Option::is_some) {
        file = file.with_radii(radii.map(|radius| radius.map(|radius| radius.0)));
    }
    if let Some((image, scale, turn_degrees)) = plan.light.environment_file() {
        file = file.with_environment(image, scale, turn_degrees)?;
    }
    let (mut scene, mut file) = file.load_explicit()?;
    load::check_outputs(plan.source.scene.as_deref(), &scene, &outputs)?;
    load::report(&mut scene);
    set_view_and_light(&mut file, &mut scene, &mut plan)?;
    file.settings = plan.decided_settings().written();
    write(&file, path)
}

/// Sets the camera, the lights and the environment of the file.
fn set_view_and_light(file: &mut SceneFile, scene: &mut Scene, plan: &mut Plan) -> Result<()> {
    let source = plan.apply_light(scene)?;
    let Setup { camera, choice, .. } = render::setup(scene, plan, source)?;
    let [width, height] = plan.size();
    View::new(&camera, width, height)?;
    file.camera = Some(camera);
    if choice.default_light.is_some() {
        // The setting `light` says it.
        file.lights = Some(Vec::new());
        file.environment = Some(EnvironmentSource::Constant([0.0; 3]));
        return Ok(());
    }
    file.lights = Some(scene.lights.clone());
    // The file already refers to an environment map.
    if let Environment::Constant(radiance) = environment_of(scene) {
        file.environment = Some(EnvironmentSource::Constant(*radiance));
    }
    Ok(())
}

/// Writes the file after checking that its text can be read again.
fn write(file: &SceneFile, path: &Path) -> Result<()> {
    let text = file.to_toml();
    let reread = SceneFile::parse(text.as_bytes(), path)
        .map_err(|error| anyhow!("the scene cannot be written as a scene file: {error}"))?;
    SceneSettings::of_file(&reread)?;
    let mut out = AtomicFile::create(path)?;
    out.write(|out| out.write_all(text.as_bytes()))?;
    Ok(out.finish()?)
}
