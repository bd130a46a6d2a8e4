//! `canted scene`: a scene and all that its picture is made by, as a file to change.

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
use canted_renderer::{View, environment_of};
use canted_scene::{Environment, EnvironmentSource, Scene, SceneFile};
use canted_wide::LaneKernel;
use clap::ArgMatches;

use crate::{
    Outcome, load,
    options::{self, with_kernel},
    output::{self, Named},
    render::{self, Looked},
    settings,
};

/// Options of `canted scene`: those of `canted render` that make the picture.
#[derive(clap::Args)]
#[group(skip)]
#[command(
    mut_args(settings::hide_the_run),
    mut_arg("output", |arg| arg.default_value("scene.toml").help("The scene file: `.toml`"))
)]
pub(crate) struct Args {
    #[command(flatten)]
    render: render::Args,
}

/// Writes the scene file by which `canted render` makes the picture that it makes of the same scene by the same options.
pub(crate) fn run(args: &Args, matches: &ArgMatches) -> Result<Outcome> {
    let Some((_, options)) = matches.subcommand() else { return Ok(Outcome::Done) };
    let args = &args.render;
    let path = &args.output;
    if let Some(option) = settings::about_the_run(options) {
        return Err(anyhow!("{option} says nothing about a scene"));
    }
    if !load::is_scene_file(path) {
        return Err(anyhow!("{}: scene files end in .toml", path.display()));
    }
    let outputs: [Named; 1] = [("--output", path)];
    output::check_distinct(&args.inputs()?.named(), &outputs)?;
    output::probe(path)?;
    options::use_threads(None)?;
    let error = |error| anyhow!("{error}");
    let mut file = match args.scene.as_deref() {
        Some(scene) if load::is_scene_file(scene) => {
            load::check_time(scene, args.time)?;
            load::scene_file(scene)?.moved_to(path).map_err(error)?
        }
        scene => SceneFile::for_scene(scene, path).map_err(error)?,
    };
    if let Some(time) = args.time {
        file = file.with_time(time);
    }
    if let Some((image, scale, turn_degrees)) = args.light.environment_file() {
        file = file.with_environment(image, scale, turn_degrees).map_err(error)?;
    }
    let (mut scene, mut file) = file.load_explicit().map_err(error)?;
    load::check_outputs(args.scene.as_deref(), &scene, &outputs)?;
    load::warn(&scene.warnings);
    with_kernel!(args.structure.triangles, look(&mut scene, args, &mut file))?;
    let picture = args.settings()?;
    let sampler = format!("{:?}", picture.pattern).to_lowercase();
    let resolved =
        [("spp", picture.samples.to_string()), ("sampler", sampler), ("bounces", picture.bounces.to_string())];
    file.settings = settings::spelled_out(options, &resolved);
    write(&file, args)?;
    Ok(Outcome::Done)
}

/// Says how the scene is looked at and lit.
fn look<K: LaneKernel>(scene: &mut Scene, args: &render::Args, file: &mut SceneFile) -> Result<()> {
    let default_light = args.light.apply(scene)?;
    let Looked { camera, .. } = render::look::<K>(scene, args, default_light)?;
    View::new(&camera, args.size[0], args.size[1])?;
    file.camera = Some(camera);
    file.lights = Some(scene.lights.clone());
    match environment_of(scene) {
        Environment::Constant(radiance) => file.environment = Some(EnvironmentSource::Constant(*radiance)),
        // The file has named it already.
        Environment::Image(_) => {}
    }
    Ok(())
}

/// Writes a file that was seen to read back as what it says.
fn write(file: &SceneFile, args: &render::Args) -> Result<()> {
    let path = &args.output;
    let text = file.to_toml();
    let back = SceneFile::parse(text.as_bytes(), path).map_err(|error| anyhow!("the scene has no file: {error}"))?;
    settings::check(&back.settings, path)?;
    let mut out = AtomicFile::create(path)?;
    out.write(|out| out.write_all(text.as_bytes()))?;
    Ok(out.finish()?)
}
