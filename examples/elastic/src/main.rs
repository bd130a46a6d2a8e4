//! Renders an elastic torus that falls onto a floor, one picture per frame.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program prints its results and its errors")]

use std::{
    fmt::Display,
    fs,
    path::PathBuf,
    process::ExitCode,
    str::FromStr,
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use canted_film::write_png;
use canted_renderer::{Integrator, Settings, UpdateOptions, UpdatePolicy, Updates, render};
use elastic::{Material, Simulation, torus};

fn main() -> ExitCode {
    match Options::parse(std::env::args().skip(1)).and_then(|options| options.as_ref().map_or_else(help, run)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn help() -> Result<()> {
    println!("{HELP}");
    Ok(())
}

fn run(options: &Options) -> Result<()> {
    fs::create_dir_all(&options.folder).with_context(|| format!("cannot create {}", options.folder.display()))?;
    let mesh = torus([0.45, 0.2], [192, 64], 1.25, 0.5);
    let mut simulation = Simulation::new(&mesh, options.spacing, &Material::RUBBER)?;
    println!("{} triangles follow {} phyxels", mesh.triangles.len(), simulation.body.n_phyxels());
    let [width, height] = options.size;
    let settings = Settings {
        width,
        height,
        samples: options.samples,
        integrator: Integrator::Path,
        bounces: 4,
        ..Settings::default()
    };
    let (mut total, mut trace_time) = (Updates::default(), Duration::ZERO);
    for frame in 0..options.frames {
        let start = Instant::now();
        let update = UpdateOptions { policy: options.update, trace_time };
        let frame_seconds = if frame == 0 { 0.0 } else { 1.0 / f64::from(options.fps) };
        let (n_steps, updates) = simulation.advance(frame_seconds, &update)?;
        let move_time = start.elapsed();
        total += updates;

        let start = Instant::now();
        let (structure, camera) = (&simulation.prepared, &simulation.scene.cameras[0]);
        let film = render(&simulation.scene, structure, camera, &settings, &|_, _| (), &AtomicBool::new(false))?;
        trace_time = start.elapsed();
        let path = options.folder.join(format!("frame_{frame:04}.png"));
        write_png(&path, &film.picture())?;
        println!(
            "{}: {n_steps} steps in {:.0} ms, update in {:.2} ms (drift {:.3}), rays in {:.0} ms",
            path.display(),
            1e3 * (move_time - updates.time).as_secs_f64(),
            1e3 * updates.time.as_secs_f64(),
            updates.max_drift,
            1e3 * trace_time.as_secs_f64(),
        );
    }
    println!("{} refits, {} rebuilds, greatest drift {:.2}", total.refits, total.rebuilds, total.max_drift);
    Ok(())
}

const HELP: &str = "\
Renders an elastic torus that falls onto a floor: one PNG per frame.

Usage: elastic [OPTIONS] [FOLDER]

  [FOLDER]                        Where the pictures frame_0000.png, ... go [default: .]
  --frames <N>                    Number of frames, the first at rest [default: 48]
  --fps <N>                       Frames per second [default: 24]
  --size <WIDTHxHEIGHT>           Size of a picture in pixels [default: 640x360]
  --samples <N>                   Samples per pixel [default: 16]
  --spacing <METERS>              Spacing of the phyxels [default: 0.07]
  --update <auto|refit|rebuild>   How the BVH follows the mesh [default: auto]
  --help                          This text";

/// What to simulate and to render.
#[derive(Clone, Debug, PartialEq)]
struct Options {
    folder: PathBuf,
    frames: u32,
    fps: u32,
    size: [u32; 2],
    samples: u32,
    spacing: f64,
    update: UpdatePolicy,
}

impl Options {
    /// The options in the arguments, without the program's name; `None` where they ask for help.
    fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Option<Self>> {
        let mut options = Self {
            folder: ".".into(),
            frames: 48,
            fps: 24,
            size: [640, 360],
            samples: 16,
            spacing: 0.07,
            update: UpdatePolicy::Auto,
        };
        let mut arguments = arguments.into_iter();
        let mut has_folder = false;
        while let Some(argument) = arguments.next() {
            if argument == "--help" || argument == "-h" {
                return Ok(None);
            }
            if !argument.starts_with('-') {
                ensure!(!has_folder, "a second folder '{argument}'; use one");
                options.folder = argument.into();
                has_folder = true;
                continue;
            }
            let mut value = || arguments.next().with_context(|| format!("{argument} requires a value"));
            match argument.as_str() {
                "--frames" => options.frames = number(&argument, &value()?)?,
                "--fps" => options.fps = number(&argument, &value()?)?,
                "--samples" => options.samples = number(&argument, &value()?)?,
                "--spacing" => options.spacing = number(&argument, &value()?)?,
                "--size" => options.size = size(&value()?)?,
                "--update" => options.update = policy(&value()?)?,
                _ => bail!("unknown option '{argument}'; --help lists the options"),
            }
        }
        let [width, height] = options.size;
        let counts = [("--fps", options.fps), ("--samples", options.samples), ("--size", width.min(height))];
        for (name, count) in counts {
            ensure!((1..=16384).contains(&count), "{name}: {count} is out of range; use 1 to 16384");
        }
        Ok(Some(options))
    }
}

fn number<T: FromStr<Err: Display>>(name: &str, value: &str) -> Result<T> {
    value.parse().map_err(|error| anyhow::anyhow!("{name}: invalid value '{value}': {error}"))
}

fn size(value: &str) -> Result<[u32; 2]> {
    let (width, height) =
        value.split_once('x').with_context(|| format!("--size: invalid value '{value}'; use 640x360"))?;
    Ok([number("--size", width)?, number("--size", height)?])
}

fn policy(value: &str) -> Result<UpdatePolicy> {
    Ok(match value {
        "auto" => UpdatePolicy::Auto,
        "refit" => UpdatePolicy::Refit,
        "rebuild" => UpdatePolicy::Rebuild,
        _ => bail!("--update: invalid value '{value}'; use auto, refit or rebuild"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Option<Options>> {
        Options::parse(line.split_whitespace().map(str::to_owned))
    }

    #[test]
    fn options_are_read() {
        let options = parse("out --frames 3 --size 64x32 --update rebuild --spacing 0.1").unwrap().unwrap();
        assert_eq!((options.folder, options.frames, options.size), ("out".into(), 3, [64, 32]));
        assert_eq!((options.update, options.spacing, options.fps), (UpdatePolicy::Rebuild, 0.1, 24));
        assert_eq!(
            parse("--frames --help").unwrap_err().to_string(),
            "--frames: invalid value '--help': invalid digit found in string"
        );
        assert_eq!(parse("--help").unwrap(), None);
    }

    #[test]
    fn errors_name_option_and_value() {
        let error = |line: &str| parse(line).unwrap_err().to_string();
        assert_eq!(error("--frames"), "--frames requires a value");
        assert_eq!(error("--fps 0"), "--fps: 0 is out of range; use 1 to 16384");
        assert_eq!(error("--size 64"), "--size: invalid value '64'; use 640x360");
        assert_eq!(error("--update never"), "--update: invalid value 'never'; use auto, refit or rebuild");
        assert_eq!(error("--sideways 3"), "unknown option '--sideways'; --help lists the options");
        assert_eq!(error("a b"), "a second folder 'b'; use one");
    }
}
