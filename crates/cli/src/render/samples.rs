//! Which samples are taken, how many, and what is kept of them.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::{Aov, Aovs};
use canted_renderer::{Pattern, Settings};

use super::choices::SamplerArg;

/// Most samples of a pixel, a bound that keeps a slip of the finger from running for years.
const MAX_SAMPLES: u32 = 1 << 20;

/// Samples of a pixel where nothing is said.
const DEFAULT_SAMPLES: u32 = 16;

/// Options of `canted render` about samples.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct SampleArgs {
    /// Samples per pixel, 16 without it; with --noise the most that a pixel takes.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SAMPLES)), value_name = "N")]
    spp: Option<u32>,
    /// Take the samples with the numbers A to B-1 and keep their exact sums in the EXR, for `canted merge`.
    #[arg(long, value_parser = range, value_name = "A..B", conflicts_with = "noise", allow_hyphen_values = true)]
    samples: Option<[u32; 2]>,
    /// How the samples of a pixel are spread: `stratified` without it; `sobol`, whose samples do not depend on how many
    /// there are, with --samples and --noise.
    #[arg(long, value_enum, value_name = "PATTERN")]
    sampler: Option<SamplerArg>,
    /// Stop pixels once the relative standard error of their luminance is at most this, as 0.02.
    #[arg(long, value_parser = noise, value_name = "ERROR")]
    noise: Option<f32>,
    /// Channels of the EXR beside light: depth, normal, shading-normal, albedo, instance, primitive, tests; or all.
    #[arg(long, value_parser = aov, value_delimiter = ',', value_name = "LIST")]
    aovs: Vec<Aovs>,
    /// Keep finished tiles in this file, and go on from it where it is there; it goes away with the last tile.
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Seconds between two writes of the checkpoint.
    #[arg(long, default_value_t = 60, requires = "checkpoint", value_name = "SECONDS")]
    pub(super) checkpoint_every: u32,
}

impl SampleArgs {
    /// The options that only an EXR, or only light, has room for; with why.
    pub(super) fn check(&self, is_exr: bool, is_heatmap: bool) -> Result<()> {
        let given = [
            ("--samples", self.samples.is_some(), true),
            ("--aovs", !self.aovs.is_empty(), true),
            ("--noise", self.noise.is_some(), false),
            ("--checkpoint", self.checkpoint.is_some(), false),
        ];
        for (name, _, needs_exr) in given.into_iter().filter(|&(_, is_given, _)| is_given) {
            if is_heatmap {
                return Err(anyhow!("{name} and --heatmap cannot be used together"));
            }
            if needs_exr && !is_exr {
                return Err(anyhow!("{name} needs a picture that ends in .exr"));
            }
        }
        Ok(())
    }

    /// What is shown beside light.
    pub(super) fn aovs(&self) -> Aovs {
        self.aovs.iter().flat_map(|aovs| aovs.iter()).collect()
    }

    /// Puts all of it into the settings.
    pub(super) fn apply(&self, settings: &mut Settings) -> Result<()> {
        // Stopping early keeps a prefix of the samples, and a range may be any piece of them.
        let is_open = self.samples.is_some() || self.noise.is_some();
        settings.pattern = match self.sampler {
            Some(sampler) => sampler.pattern(),
            None if is_open => Pattern::Sobol,
            None => Pattern::Stratified,
        };
        settings.samples = match (self.samples, self.spp) {
            (None, spp) => spp.unwrap_or(DEFAULT_SAMPLES),
            (Some([start, end]), Some(spp)) if settings.pattern == Pattern::Stratified => {
                if end > spp {
                    return Err(anyhow!("--samples {start}..{end} ends after --spp {spp}"));
                }
                spp
            }
            (Some([start, end]), Some(spp)) => {
                return Err(anyhow!(
                    "--spp {spp} and --samples {start}..{end} cannot be used together, but with --sampler stratified"
                ));
            }
            (Some([start, end]), None) if settings.pattern == Pattern::Stratified => {
                return Err(anyhow!(
                    "--samples {start}..{end} with --sampler stratified needs --spp, the samples of all parts together"
                ));
            }
            (Some([_, end]), None) => end,
        };
        settings.part = self.samples;
        settings.noise = self.noise;
        settings.aovs = self.aovs();
        Ok(())
    }
}

/// Sample numbers as `A..B`.
fn range(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once("..").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    let [start, end]: [u32; 2] = parsed.ok_or("sample numbers are A..B, as 0..16")?;
    if start >= end {
        return Err(format!("{start}..{end} has no samples"));
    }
    if end > MAX_SAMPLES {
        return Err(format!("{end} is more than {MAX_SAMPLES} samples"));
    }
    Ok([start, end])
}

/// A relative error above zero.
fn noise(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(noise) if noise > 0.0 && noise.is_finite() => Ok(noise),
        _ => Err(format!("'{text}' is not an error above zero")),
    }
}

/// One name, or all of them.
fn aov(text: &str) -> Result<Aovs, String> {
    if text == "all" {
        return Ok(Aov::ALL.into_iter().collect());
    }
    let found = Aov::ALL.into_iter().find(|aov| aov.name() == text);
    found
        .map(|aov| Aovs::NONE.with(aov))
        .ok_or_else(|| format!("'{text}' is none of {}, all", Aov::ALL.map(Aov::name).join(", ")))
}
