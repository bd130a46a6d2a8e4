//! Options of `canted render` about samples.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::{Aov, Aovs};
use canted_renderer::{Pattern, Settings};

use super::args::RENDERING;
use crate::options::{self, one_of};

/// The maximum number of samples per pixel, a guard against typing errors.
const MAX_SAMPLES: u32 = 1 << 20;

const DEFAULT_SAMPLES: u32 = 16;

const PATTERNS: [(&str, Pattern); 3] =
    [("random", Pattern::Random), ("stratified", Pattern::Stratified), ("sobol", Pattern::Sobol)];

/// The channels that guide the filter.
const GUIDES: [Aov; 3] = [Aov::Albedo, Aov::ShadingNormal, Aov::Depth];

/// Options of `canted render` about samples.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = RENDERING)]
pub(crate) struct SampleArgs {
    /// Samples per pixel; with --noise, the maximum [default: 16]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SAMPLES)), value_name = "N")]
    spp: Option<u32>,
    /// Render only the samples A to B-1 and store their exact sums in the EXR, for `canted merge`.
    #[arg(long, value_parser = range, value_name = "A..B", conflicts_with_all = ["noise", "boxes"], allow_hyphen_values = true)]
    samples: Option<[u32; 2]>,
    /// Sample pattern [default: stratified; sobol with --samples or --noise]
    #[arg(long, value_parser = one_of(&PATTERNS), value_name = "PATTERN")]
    sampler: Option<Pattern>,
    /// Stop sampling a pixel when its relative standard error falls below ERROR, e.g. 0.02.
    #[arg(long, value_parser = options::noise, value_name = "ERROR")]
    noise: Option<f32>,
    /// Render on the CPU in passes over the whole picture, and rewrite the output after each; Ctrl-C leaves the passes that are complete.
    #[arg(long, conflicts_with_all = ["samples", "noise", "checkpoint", "frames"])]
    pub(super) preview: bool,
    /// Render on the CPU in passes for at most this time, up to --spp samples per pixel, if it is given. One sample is always taken.
    #[arg(long, value_parser = options::noise, value_name = "N", conflicts_with_all = ["samples", "noise", "checkpoint", "frames"])]
    pub(super) seconds: Option<f32>,
    /// Additional EXR channels: depth, normal, shading-normal, albedo, instance, primitive, tests, or all.
    #[arg(long, value_parser = aov, value_delimiter = ',', value_name = "LIST")]
    aovs: Vec<Aovs>,
    /// Remove noise with a filter guided by albedo, normals and depth; other channels are not filtered.
    #[arg(long)]
    pub(super) denoise: bool,
    /// Checkpoint file: continue from it if it exists, update it while rendering, remove it when the picture is written.
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Time between checkpoint updates in seconds.
    #[arg(long, default_value_t = 60, requires = "checkpoint", value_name = "SECONDS")]
    pub(super) checkpoint_every: u32,
}

impl SampleArgs {
    /// Rejects options that the output format or a heat map does not support.
    pub(super) fn check(&self, is_exr: bool, is_heatmap: bool) -> Result<()> {
        let given = [
            ("--samples", self.samples.is_some(), true),
            ("--aovs", !self.aovs.is_empty(), true),
            ("--noise", self.noise.is_some(), false),
            ("--checkpoint", self.checkpoint.is_some(), false),
            ("--denoise", self.denoise, false),
            ("--preview", self.preview, false),
            ("--seconds", self.seconds.is_some(), false),
        ];
        for (name, _, needs_exr) in given.into_iter().filter(|&(_, is_given, _)| is_given) {
            if is_heatmap {
                return Err(anyhow!("{name} and --heatmap cannot be used together"));
            }
            if needs_exr && !is_exr {
                return Err(anyhow!("{name} requires an .exr output"));
            }
        }
        if self.denoise && self.samples.is_some() {
            return Err(anyhow!(
                "--denoise and --samples cannot be used together; render the parts with --aovs albedo and use canted merge --denoise"
            ));
        }
        Ok(())
    }

    /// Rejects options that need a file.
    pub(super) fn check_stream(&self) -> Result<()> {
        let given = [
            ("--samples", self.samples.is_some()),
            ("--aovs", !self.aovs.is_empty()),
            ("--checkpoint", self.checkpoint.is_some()),
        ];
        match given.into_iter().find(|&(_, is_given)| is_given) {
            None => Ok(()),
            Some((name, _)) => Err(anyhow!("{name} requires an output file, not -")),
        }
    }

    /// Rejects options that need the whole picture.
    pub(super) fn check_crop(&self) -> Result<()> {
        let given = [("--samples", self.samples.is_some()), ("--checkpoint", self.checkpoint.is_some())];
        match given.into_iter().find(|&(_, is_given)| is_given) {
            None => Ok(()),
            Some((name, _)) => Err(anyhow!("{name} and --crop cannot be used together")),
        }
    }

    /// Whether the picture is rendered in passes.
    pub(super) fn has_passes(&self) -> bool {
        self.preview || self.seconds.is_some()
    }

    /// The additional channels that are written.
    pub(super) fn aovs(&self) -> Aovs {
        self.aovs.iter().flat_map(|aovs| aovs.iter()).collect()
    }

    /// Whether the output needs no sums of samples, only their means.
    pub(super) fn needs_means_only(&self) -> bool {
        !self.has_passes()
    }

    /// Sets the settings about samples.
    pub(super) fn apply(&self, settings: &mut Settings) -> Result<()> {
        // Both need samples that do not depend on the total number.
        let needs_prefix = self.samples.is_some() || self.noise.is_some() || self.seconds.is_some();
        let pattern = self.sampler.unwrap_or(if needs_prefix { Pattern::Sobol } else { Pattern::Stratified });
        settings.samples = match (self.samples, self.spp) {
            (None, None) if self.seconds.is_some() => MAX_SAMPLES,
            (None, spp) => spp.unwrap_or(DEFAULT_SAMPLES),
            (Some([start, end]), Some(spp)) if pattern == Pattern::Stratified => {
                if end > spp {
                    return Err(anyhow!("--samples {start}..{end} exceeds --spp {spp}"));
                }
                spp
            }
            (Some([start, end]), Some(spp)) => {
                return Err(anyhow!(
                    "--samples {start}..{end} sets the number of samples; leave out --spp {spp}, or add --sampler stratified, which needs the total"
                ));
            }
            (Some([start, end]), None) if pattern == Pattern::Stratified => {
                return Err(anyhow!(
                    "--samples {start}..{end} with --sampler stratified requires --spp, the total of all parts"
                ));
            }
            (Some([_, end]), None) => end,
        };
        settings.pattern = pattern;
        settings.part = self.samples;
        settings.noise = self.noise;
        settings.aovs = self.aovs();
        if self.denoise {
            settings.aovs = GUIDES.into_iter().fold(settings.aovs, Aovs::with);
        }
        Ok(())
    }
}

/// Sample numbers as `A..B`.
fn range(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once("..").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    let [start, end]: [u32; 2] = parsed.ok_or("expected A..B, e.g. 0..16")?;
    if start >= end {
        return Err(format!("{start}..{end} is empty"));
    }
    if end > MAX_SAMPLES {
        return Err(format!("{end} exceeds the limit of {MAX_SAMPLES} samples"));
    }
    Ok([start, end])
}

/// One channel name, or all.
fn aov(text: &str) -> Result<Aovs, String> {
    if text == "all" {
        return Ok(Aov::ALL.into_iter().collect());
    }
    let found = Aov::ALL.into_iter().find(|aov| aov.name() == text);
    let unknown = || format!("unknown channel '{text}'; use {} or all", Aov::ALL.map(Aov::name).join(", "));
    found.map(|aov| Aovs::NONE.with(aov)).ok_or_else(unknown)
}
