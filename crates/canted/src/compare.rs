//! `canted compare`: how two pictures differ.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_renderer::read_picture;
use serde_json::json;

use crate::{Outcome, output};

/// Options of `canted compare`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The picture in question, PNG or EXR.
    a: PathBuf,
    /// The reference, PNG or EXR.
    b: PathBuf,
    /// Say no (exit code 1) where the relative mean square error is above this.
    #[arg(long, value_name = "RELMSE", allow_negative_numbers = true)]
    max: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Compares the two pictures.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    if let Some(max) = args.max
        && (max.is_nan() || max < 0.0)
    {
        return Err(anyhow!("--max {max} is not a relative mean square error"));
    }
    let a = read_picture(&args.a)?;
    let b = read_picture(&args.b)?;
    let found = canted_renderer::compare(&a, &b)
        .map_err(|error| anyhow!("{} and {}: {error}", args.a.display(), args.b.display()))?;
    let text = if args.json {
        json!({ "mean_ratio": found.mean_ratio, "rmse": found.rmse, "relmse": found.rel_mse }).to_string()
    } else {
        format!("mean ratio {:.6}   RMSE {:.6}   relMSE {:.6}", found.mean_ratio, found.rmse, found.rel_mse)
    };
    output::to_stdout(&text);
    // An error that is not a number is within no limit.
    let is_within = args.max.is_none_or(|max| found.rel_mse <= max);
    Ok(if is_within { Outcome::Done } else { Outcome::No })
}
