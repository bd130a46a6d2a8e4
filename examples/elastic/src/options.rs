//! Options of the program.

use std::{fmt::Display, path::PathBuf, str::FromStr};

use anyhow::{Context, Result, bail, ensure};
use canted_renderer::UpdatePolicy;

pub(crate) const HELP: &str = "\
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
pub(crate) struct Options {
    pub(crate) folder: PathBuf,
    pub(crate) frames: u32,
    pub(crate) fps: u32,
    pub(crate) size: [u32; 2],
    pub(crate) samples: u32,
    pub(crate) spacing: f64,
    pub(crate) update: UpdatePolicy,
}

impl Options {
    /// The options in the arguments, without the program's name; `None` where they ask for help.
    pub(crate) fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Option<Self>> {
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
