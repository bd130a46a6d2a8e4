//! A reference picture with its own error.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::{Film, Picture, REL_MSE_FLOOR, compare};
use canted_renderer::{Settings, render};

use super::stage::Stage;

/// First seed of references; measured pictures use smaller seeds.
const FIRST_SEED: u32 = 0x4000_0000;

/// The mean of several pictures, with its own error.
pub(super) struct Reference {
    pub(super) picture: Picture,
    /// Expected squared error, averaged over channels.
    mse: f64,
    /// The same relative to the squared reference plus a constant.
    rel_mse: f64,
}

/// MSE and relMSE of a picture, minus the reference's own error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    pub(super) mse: f64,
    pub(super) rel_mse: f64,
}

/// Renders a stage.
pub(super) fn film(stage: &Stage, settings: &Settings) -> Result<Film> {
    let Stage { scene, prepared, camera, .. } = stage;
    Ok(render(scene, &prepared.structure, camera, settings, &|_, _| {}, &AtomicBool::new(false))?)
}

impl Reference {
    /// The mean of `n` pictures of these settings with different seeds.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how pictures are stored")]
    pub(super) fn new(stage: &Stage, settings: &Settings, n: u32) -> Result<Self> {
        let picture = |k| Ok(film(stage, &Settings { seed: FIRST_SEED + k, ..*settings })?.picture());
        let pictures = (0..n).map(picture).collect::<Result<Vec<Picture>>>()?;
        let mut mean = pictures[0].clone();
        let (mut mse, mut rel_mse, mut n_channels) = (0.0, 0.0, 0.0);
        for (i, pixel) in mean.pixels.iter_mut().enumerate() {
            for (c, channel) in pixel.iter_mut().enumerate() {
                let values = || pictures.iter().map(|picture| f64::from(picture.pixels[i][c]));
                let center = values().sum::<f64>() / f64::from(n);
                let squares: f64 = values().map(|x| (x - center).powi(2)).sum();
                let variance_of_mean = squares / (f64::from(n) * f64::from(n - 1));
                *channel = center as f32;
                mse += variance_of_mean;
                rel_mse += variance_of_mean / (center * center + REL_MSE_FLOOR);
                n_channels += 1.0;
            }
        }
        Ok(Self { picture: mean, mse: mse / n_channels, rel_mse: rel_mse / n_channels })
    }

    /// The errors of `picture`.
    pub(super) fn errors(&self, picture: &Picture) -> Result<Errors> {
        let found = compare(picture, &self.picture)?;
        Ok(Errors { mse: found.mse - self.mse, rel_mse: found.rel_mse - self.rel_mse })
    }

    /// Share of the reference's own error in a squared error.
    pub(super) fn share(&self, mse: f64) -> f64 {
        self.mse / mse
    }
}
