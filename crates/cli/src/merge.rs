//! `canted merge`: joins pictures of separate sample ranges.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::{Aovs, Film, JoinError, Part, Picture, Record, read_part, write_film_as};
use serde_json::json;

use crate::{
    output::{self, Named},
    render,
};

/// Options of `canted merge`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  canted merge a.exr b.exr -o whole.exr\n  canted merge part_*.exr -o whole.exr --json"
)]
pub(crate) struct Args {
    /// Parts written by `canted render --samples A..B -o PART.exr`, in any order.
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Output image, .exr. It can be merged again.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Remove noise from the picture with a filter guided by albedo, normals and depth. The parts need channels, e.g. of --aovs albedo;
    /// their sums are not filtered, so the output can be merged again.
    #[arg(long)]
    denoise: bool,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// The content of a part's file.
struct Input<'a> {
    path: &'a Path,
    film: Film,
    aovs: Aovs,
    record: Record,
}

/// Merges the parts.
pub(crate) fn run(args: &Args) -> Result<()> {
    if !output::has_extension(&args.output, "exr") {
        return Err(output::unsupported(&args.output, ".exr"));
    }
    let parts: Vec<Named> = args.parts.iter().map(|part| ("PART", part.as_path())).collect();
    output::check_distinct(&parts, &[("--output", &args.output)])?;
    output::probe(&args.output)?;
    let mut inputs = Vec::new();
    for path in &args.parts {
        let (film, aovs, record) = read_part(path)?;
        inputs.push(Input { path, film, aovs, record });
    }
    let [first, others @ ..] = &inputs[..] else { return Err(anyhow!("no parts to merge")) };
    others.iter().try_for_each(|other| check_same_picture(first, other))?;
    let (width, height) = (first.film.width(), first.film.height());
    let parts: Vec<Part> = inputs.iter().filter_map(|input| input.film.part().cloned()).collect();
    let ranges: Vec<(&Path, Range<u32>)> =
        inputs.iter().map(|input| input.path).zip(parts.iter().map(Part::range)).collect();
    let joined = Part::join(parts).map_err(|error| named(&error, &ranges))?;
    let film = Film::of_part(width, height, joined, 0);
    let picture = if args.denoise { denoised(&film, first.path)? } else { film.picture() };
    write_film_as(&args.output, &picture, None, &film, first.aovs, &first.record)?;
    report(args, &film)
}

fn denoised(film: &Film, first: &Path) -> Result<Picture> {
    if film.guides().is_empty() {
        return Err(anyhow!(
            "{}: --denoise requires parts with channels; render them with --aovs albedo",
            first.display()
        ));
    }
    render::denoised_film(film, None)
}

/// Rejects parts of different pictures and states the difference.
fn check_same_picture(a: &Input, b: &Input) -> Result<()> {
    let record = |input: &Input| -> Record {
        let aovs = ("aovs".to_owned(), input.aovs.to_string());
        let pixels = ("pixels".to_owned(), format!("{} x {}", input.film.width(), input.film.height()));
        [aovs, pixels].into_iter().chain(input.record.iter().cloned()).collect()
    };
    match render::difference(&record(a), &record(b)) {
        Some((name, of_a, of_b)) => {
            let (a, b) = (a.path.display(), b.path.display());
            Err(anyhow!("{a} and {b} are parts of different pictures: {name} is {of_a} and {of_b}"))
        }
        None => Ok(()),
    }
}

/// Adds the names of the files to an error.
fn named(error: &JoinError, ranges: &[(&Path, Range<u32>)]) -> anyhow::Error {
    let between = match error {
        JoinError::Overlap { before, after } | JoinError::Gap { before, after } => [before, after],
        JoinError::Empty => return anyhow!("{error}"),
    };
    let files: Vec<String> = ranges
        .iter()
        .filter(|(_, range)| between.contains(&range))
        .map(|(path, _)| path.display().to_string())
        .collect();
    anyhow!("{}: {error}", files.join(" and "))
}

fn report(args: &Args, film: &Film) -> Result<()> {
    let samples = film.part().map(|part| format!("{:?}", part.range())).unwrap_or_default();
    let (picture, n_parts, n_dropped) = (args.output.display().to_string(), args.parts.len(), film.n_dropped());
    if args.json {
        let size = [film.width(), film.height()];
        let report = json!({
            "picture": picture, "size": size, "parts": n_parts, "samples": samples, "dropped_samples": n_dropped
        });
        return output::to_stdout(&report.to_string());
    }
    let dropped = match n_dropped {
        0 => String::new(),
        n => format!("; dropped {n} samples that were not finite"),
    };
    output::to_stdout(&format!("{picture}: samples {samples} from {n_parts} parts{dropped}"))
}
