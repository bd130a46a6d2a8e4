//! `canted scene`: writes a scene file that contains every setting of a picture.

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
use canted_renderer::{View, environment_of};
use canted_scene::{Environment, EnvironmentSource, Scene, SceneFile};
use canted_wide::LaneKernel;
use clap::ArgMatches;

use crate::{
    load,
    options::{self, with_kernel},
    output::{self, Named},
    render::{self, Setup},
    settings,
};

/// Options of `canted scene`: those of `canted render` that determine the picture.
#[derive(clap::Args)]
#[group(skip)]
#[command(
    after_help = "Examples:\n  canted scene room.glb -o room.toml\n  canted scene room.toml --spp 256 --eye 0,2,5 -o better.toml",
    mut_args(settings::hide_run_option),
    mut_arg("output", |arg| arg.default_value("scene.toml").help("Output scene file: .toml"))
)]
pub(crate) struct Args {
    #[command(flatten)]
    render: render::Args,
}

/// Writes the scene file. `canted render` makes the same picture of it as of the same scene with the same options.
pub(crate) fn run(args: &Args, matches: &ArgMatches) -> Result<()> {
    let Some((_, options)) = matches.subcommand() else { return Ok(()) };
    let mut args = args.render.clone();
    let path = &args.output.clone();
    if let Some(option) = settings::run_option(options) {
        return Err(anyhow!("{option} is not a setting of a scene; use it with `canted render`"));
    }
    if !load::is_scene_file(path) {
        return Err(output::unsupported(path, ".toml"));
    }
    let outputs: [Named; 1] = [("--output", path)];
    output::check_distinct(&args.inputs()?.named(), &outputs)?;
    output::probe(path)?;
    options::use_threads(None)?;
    let mut file = match args.scene.as_deref() {
        Some(scene) if load::is_scene_file(scene) => {
            load::check_asset_options(scene, &args.read_options(args.time))?;
            load::scene_file(scene)?.moved_to(path)?
        }
        scene => SceneFile::for_scene(scene, path)?,
    };
    if let Some(time) = args.time {
        file = file.with_time(time);
    }
    if let Some(animation) = &args.animation {
        file = file.with_animation(animation);
    }
    if let Some(variant) = &args.variant {
        file = file.with_variant(variant);
    }
    if let Some((image, scale, turn_degrees)) = args.light.environment_file() {
        file = file.with_environment(image, scale, turn_degrees)?;
    }
    let (mut scene, mut file) = file.load_explicit()?;
    load::check_outputs(args.scene.as_deref(), &scene, &outputs)?;
    load::warn(&scene.warnings);
    with_kernel!(args.structure.triangles, set_view_and_light(&mut file, &mut scene, &mut args))?;
    let picture = args.settings()?;
    let sampler = format!("{:?}", picture.pattern).to_lowercase();
    let mut resolved = vec![
        ("spp", picture.samples.to_string()),
        ("sampler", sampler),
        ("bounces", picture.bounces.to_string()),
        ("integrator", format!("{:?}", picture.integrator).to_lowercase()),
    ];
    // Scene files have the exposure that they say.
    if let Some(stops) = args.look.stops().filter(|stops| *stops != 0.0) {
        resolved.push(("exposure", stops.to_string()));
    }
    file.settings = settings::all(options, &resolved);
    write(&file, &args)
}

/// Sets the camera, the lights and the environment of the file.
fn set_view_and_light<K: LaneKernel>(file: &mut SceneFile, scene: &mut Scene, args: &mut render::Args) -> Result<()> {
    let source = args.light.apply(scene)?;
    let Setup { camera, .. } = render::setup::<K>(scene, args, source)?;
    View::new(&camera, args.size[0], args.size[1])?;
    file.camera = Some(camera);
    file.lights = Some(scene.lights.clone());
    // The file already refers to an environment map.
    if let Environment::Constant(radiance) = environment_of(scene) {
        file.environment = Some(EnvironmentSource::Constant(*radiance));
    }
    Ok(())
}

/// Writes the file after checking that its text can be read again.
fn write(file: &SceneFile, args: &render::Args) -> Result<()> {
    let path = &args.output;
    let text = file.to_toml();
    let reread = SceneFile::parse(text.as_bytes(), path)
        .map_err(|error| anyhow!("the scene cannot be written as a scene file: {error}"))?;
    settings::check(&reread.settings, path)?;
    let mut out = AtomicFile::create(path)?;
    out.write(|out| out.write_all(text.as_bytes()))?;
    Ok(out.finish()?)
}
