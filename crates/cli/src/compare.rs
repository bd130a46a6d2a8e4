//! `canted compare`: error measures between two pictures.

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Result, anyhow};
use canted_film::{Comparison, PIXELS_PER_DEGREE, flip, flip_hdr, read_picture, write_png};
use serde_json::json;

use crate::{options::one_of, output};

/// Options of `canted compare`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  canted compare test.png reference.png --errors errors.png\n  canted compare test.exr reference.exr --max 0.01 --flip hdr"
)]
pub(crate) struct Args {
    /// Test picture: .png, .jpg, .webp, .hdr or .exr.
    a: PathBuf,
    /// Reference picture, in any of these formats.
    b: PathBuf,
    /// Exit with code 1 if the relative mean squared error exceeds RELMSE or a pixel is not finite.
    #[arg(long, value_name = "RELMSE")]
    max: Option<f64>,
    /// FLIP variant: `ldr` clamps radiance to 0..=1, `hdr` tone-maps at several exposures derived from the reference.
    #[arg(long, default_value = "ldr", value_parser = one_of(&[("ldr", Range::Ldr), ("hdr", Range::Hdr)]), value_name = "RANGE")]
    flip: Range,
    /// Pixels per degree of the viewer's field of view, for FLIP; at most 1000.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = pixels_per_degree)]
    pixels_per_degree: f64,
    /// Write the FLIP error map as a PNG, from black (no error) to yellow (largest error).
    #[arg(long, value_name = "FILE")]
    errors: Option<PathBuf>,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// The dynamic range for FLIP.
#[derive(Clone, Copy)]
enum Range {
    Ldr,
    Hdr,
}

fn pixels_per_degree(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|n: &f64| (1.0..=1000.0).contains(n));
    value.ok_or_else(|| format!("'{text}' is not a number from 1 to 1000"))
}

/// Compares two pictures.
pub(crate) fn run(args: &Args) -> Result<ExitCode> {
    if let Some(max) = args.max
        && (max.is_nan() || max < 0.0)
    {
        return Err(anyhow!("--max {max}: expected a number of at least 0"));
    }
    if let Some(path) = &args.errors {
        if !output::has_extension(path, "png") {
            return Err(output::unsupported(path, ".png"));
        }
        output::check_distinct(&[("A", &args.a), ("B", &args.b)], &[("--errors", path)])?;
        output::probe(path)?;
    }
    let a = read_picture(&args.a)?;
    let b = read_picture(&args.b)?;
    let named = |error| anyhow!("{} and {}: {error}", args.a.display(), args.b.display());
    let Comparison { mean_ratio, mse, rmse, mae, rel_mse, n_not_finite, .. } =
        canted_film::compare(&a, &b).map_err(named)?;
    let (flip, name) = match args.flip {
        Range::Ldr => (flip(&a, &b, args.pixels_per_degree), "FLIP"),
        Range::Hdr => (flip_hdr(&a, &b, args.pixels_per_degree), "HDR-FLIP"),
    };
    let flip = flip.map_err(named)?;
    if let Some(path) = &args.errors {
        write_png(path, &flip.picture())?;
    }
    if n_not_finite > 0 {
        output::warn(&format!("skipping {n_not_finite} pixels that are not finite in both pictures"));
    }
    let text = if args.json {
        json!({
            "mean_ratio": mean_ratio, "mse": mse, "rmse": rmse, "mae": mae, "relmse": rel_mse,
            "not_finite": n_not_finite,
            name.to_lowercase().replace('-', "_"): flip.mean(),
        })
        .to_string()
    } else {
        format!(
            "mean ratio {mean_ratio:.6}   RMSE {rmse:.6}   relMSE {rel_mse:.6}   MSE {mse:.6e}   MAE {mae:.6}   \
             {name} {:.6}",
            flip.mean()
        )
    };
    output::to_stdout(&text)?;
    let is_within = args.max.is_none_or(|max| rel_mse <= max && n_not_finite == 0);
    Ok(if is_within { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
