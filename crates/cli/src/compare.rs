//! `canted compare`: how two pictures differ.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::{Comparison, PIXELS_PER_DEGREE, flip, flip_hdr, read_picture, write_png};
use serde_json::json;

use crate::{Outcome, output, render};

/// Options of `canted compare`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The picture in question, PNG or EXR.
    a: PathBuf,
    /// The reference, PNG or EXR.
    b: PathBuf,
    /// Say no (exit code 1) where the relative mean square error is above this, or a pixel is not finite.
    #[arg(long, value_name = "RELMSE")]
    max: Option<f64>,
    /// What FLIP looks at: what a screen shows of the pictures clamped to 0..=1, or of all exposures from the
    /// reference's brightest to its median.
    #[arg(long, value_enum, default_value_t = Range::Ldr, value_name = "RANGE")]
    flip: Range,
    /// Pixels in a degree of the viewer's sight, from which FLIP follows what the eye resolves: at most 1000.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = pixels_per_degree)]
    pixels_per_degree: f64,
    /// Write FLIP's errors as a PNG: dark where the pictures agree, yellow where they differ most.
    #[arg(long, value_name = "FILE")]
    errors: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What FLIP looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Range {
    /// Low dynamic range: the pictures clamped to 0..=1.
    Ldr,
    /// High dynamic range: tone-mapped at several exposures.
    Hdr,
}

fn pixels_per_degree(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|n: &f64| (1.0..=1000.0).contains(n));
    value.ok_or_else(|| "not a number of pixels in 1..=1000".to_owned())
}

/// Compares the two pictures.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    if let Some(max) = args.max
        && (max.is_nan() || max < 0.0)
    {
        return Err(anyhow!("--max {max} is not a relative mean square error"));
    }
    if let Some(path) = &args.errors {
        if !render::is_png(path) {
            return Err(anyhow!("{}: --errors ends in .png", path.display()));
        }
        output::check_distinct(&[("A", &args.a), ("B", &args.b)], &[("--errors", path)])?;
        output::probe(path)?;
    }
    let a = read_picture(&args.a)?;
    let b = read_picture(&args.b)?;
    let named = |error| anyhow!("{} and {}: {error}", args.a.display(), args.b.display());
    let found = canted_film::compare(&a, &b).map_err(named)?;
    let (flip, word) = match args.flip {
        Range::Ldr => (flip(&a, &b, args.pixels_per_degree), "FLIP"),
        Range::Hdr => (flip_hdr(&a, &b, args.pixels_per_degree), "HDR-FLIP"),
    };
    let flip = flip.map_err(named)?;
    if let Some(path) = &args.errors {
        write_png(path, &flip.picture())?;
    }
    let Comparison { mean_ratio, mse, rmse, mae, rel_mse, n_not_finite, .. } = found;
    if n_not_finite > 0 {
        output::to_stderr(&format!("warning: {n_not_finite} pixels are not finite in both pictures and are left out"));
    }
    let text = if args.json {
        json!({
            "mean_ratio": mean_ratio, "mse": mse, "rmse": rmse, "mae": mae, "relmse": rel_mse,
            "not_finite": n_not_finite,
            word.to_lowercase().replace('-', "_"): flip.mean(),
        })
        .to_string()
    } else {
        format!(
            "mean ratio {mean_ratio:.6}   RMSE {rmse:.6}   relMSE {rel_mse:.6}   MSE {mse:.6e}   MAE {mae:.6}   \
             {word} {:.6}",
            flip.mean()
        )
    };
    output::to_stdout(&text)?;
    // A pixel that is not a number is within no limit.
    let is_within = args.max.is_none_or(|max| rel_mse <= max && n_not_finite == 0);
    Ok(if is_within { Outcome::Done } else { Outcome::No })
}
