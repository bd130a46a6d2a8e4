//! Options of `canted render` about frames.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_renderer::UpdatePolicy;
use clap::ArgGroup;

use crate::{
    load,
    options::{self, Names, one_of},
};

/// Options about frames.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Frames", group = ArgGroup::new("timed").args(["frames", "shutter"]).multiple(true))]
pub(crate) struct FrameArgs {
    /// Render the frames A to B-1, frame N at N / FPS seconds of the animation. --output requires a field for the frame number,
    /// e.g. frame_%04d.png.
    #[arg(long, value_parser = range, value_name = "A..B", conflicts_with = "time", allow_hyphen_values = true)]
    pub(in crate::render) frames: Option<[u32; 2]>,
    /// Frames per second.
    #[arg(long, default_value = "24", value_parser = rate, requires = "timed", value_name = "N", allow_hyphen_values = true)]
    pub(super) fps: f64,
    /// Open the shutter A to B frames after the time of the picture, e.g. 0..0.5: what the animation moves or deforms is
    /// blurred. Requires --time or --frames.
    #[arg(long, value_parser = interval, requires = "scene", value_name = "A..B", allow_hyphen_values = true)]
    pub(in crate::render) shutter: Option<[f64; 2]>,
    /// Turn the camera around its target by DEGREES in the course of all frames, counter-clockwise seen from above.
    #[arg(long, value_parser = options::number, requires = "frames", value_name = "DEGREES", allow_hyphen_values = true)]
    pub(super) turntable: Option<f32>,
    /// Keep frames whose pictures exist and are whole.
    #[arg(long, requires = "frames")]
    pub(super) resume: bool,
    /// How BVHs follow moving triangles. `auto` refits until a rebuild pays for itself.
    #[arg(long, default_value = "auto", value_parser = one_of(&POLICIES), requires = "frames", value_name = "POLICY")]
    pub(super) update: UpdatePolicy,
    /// Stands before the progress bar of a frame.
    #[arg(skip)]
    pub(in crate::render) label: String,
}

const POLICIES: [(&str, UpdatePolicy); 3] =
    [("auto", UpdatePolicy::Auto), ("refit", UpdatePolicy::Refit), ("rebuild", UpdatePolicy::Rebuild)];

/// The values of `--update`.
pub(super) const POLICY_NAMES: &Names<UpdatePolicy> = &POLICIES;

impl FrameArgs {
    /// Time of a frame in seconds: that of `--time N/FPS`, so the quotient is rounded once.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(super) fn time(&self, frame: u32) -> f32 {
        (f64::from(frame) / self.fps) as f32
    }

    /// Times in seconds as the shutter opens and as it closes, for the picture of a time; `None` without --shutter.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(in crate::render) fn shutter_times(&self, time: f32) -> Option<[f32; 2]> {
        Some(self.shutter?.map(|frames| (f64::from(time) + frames / self.fps) as f32))
    }

    /// Rejects --shutter without a time, or with a scene file.
    pub(in crate::render) fn check_shutter(&self, scene: Option<&Path>, time: Option<f32>) -> Result<()> {
        let (Some([a, b]), Some(scene)) = (self.shutter, scene) else { return Ok(()) };
        if load::is_scene_file(scene) {
            let scene = scene.display();
            return Err(anyhow!("{scene}: --shutter requires a glTF file; a scene file sets the time of each asset"));
        }
        let last = time.or_else(|| self.frames.map(|[_, end]| self.time(end - 1)));
        let last = last.ok_or_else(|| anyhow!("--shutter requires --time or --frames"))?;
        match self.shutter_times(last) {
            Some(times) if times.iter().all(|time| time.is_finite()) => Ok(()),
            _ => Err(anyhow!("--shutter {a}..{b}: the time exceeds single precision")),
        }
    }

    /// Rejects frames whose time is not a number of `f32`.
    pub(super) fn check_time(&self, last: u32) -> Result<()> {
        if self.time(last).is_finite() {
            return Ok(());
        }
        Err(anyhow!("--fps {}: the time of frame {last} exceeds single precision", self.fps))
    }
}

/// Frame numbers as `A..B`.
fn range(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once("..").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    let [start, end]: [u32; 2] = parsed.ok_or("expected A..B, e.g. 0..48")?;
    if start >= end { Err(format!("{start}..{end} is empty")) } else { Ok([start, end]) }
}

/// An interval of finite numbers as `A..B`.
fn interval(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let parsed = text.split_once("..").and_then(|(a, b)| Some([number(a)?, number(b)?]));
    let [open, close] = parsed.ok_or("expected A..B, e.g. 0..0.5")?;
    if open < close { Ok([open, close]) } else { Err(format!("{open}..{close} is empty")) }
}

/// A number of frames per second.
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.trim().parse().ok().filter(|&rate: &f64| rate > 0.0 && rate.is_finite());
    rate.ok_or_else(|| format!("'{text}' is not a finite number greater than 0"))
}
