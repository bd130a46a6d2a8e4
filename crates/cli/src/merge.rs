//! `canted merge`: parts of the samples of a picture, made apart, into one.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::{Aovs, Film, JoinError, Part, Record, read_part, write_film};
use serde_json::json;

use crate::{
    Outcome,
    output::{self, Named},
    render,
};

/// Options of `canted merge`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The parts, as `canted render --samples A..B -o PART.exr` writes them, in any order.
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// The whole, an EXR that can be merged again.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What a file holds.
struct Piece<'a> {
    path: &'a Path,
    film: Film,
    aovs: Aovs,
    record: Record,
}

/// Merges the parts.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    if !render::is_exr(&args.output) {
        return Err(anyhow!("{}: merged pictures end in .exr", args.output.display()));
    }
    let parts: Vec<Named> = args.parts.iter().map(|part| ("a part", part.as_path())).collect();
    output::check_distinct(&parts, &[("--output", &args.output)])?;
    output::probe(&args.output)?;
    let mut pieces = Vec::new();
    for path in &args.parts {
        let (film, aovs, record) = read_part(path)?;
        pieces.push(Piece { path, film, aovs, record });
    }
    let [first, others @ ..] = &pieces[..] else { return Err(anyhow!("there is no part to merge")) };
    others.iter().try_for_each(|other| same_picture(first, other))?;
    let (width, height, aovs, record) = (first.film.width(), first.film.height(), first.aovs, first.record.clone());

    let parts: Vec<Part> = pieces.iter().filter_map(|piece| piece.film.part().cloned()).collect();
    let ranges: Vec<(&Path, Range<u32>)> =
        pieces.iter().map(|piece| piece.path).zip(parts.iter().map(Part::range)).collect();
    let whole = Part::join(parts).map_err(|error| named(&error, &ranges))?;
    let film = Film::of_part(width, height, whole, 0);
    write_film(&args.output, &film, aovs, &record)?;
    report(args, &film)?;
    Ok(Outcome::Done)
}

/// Refuses parts of two pictures, by what differs.
fn same_picture(a: &Piece, b: &Piece) -> Result<()> {
    let own = |piece: &Piece| -> Record {
        let aovs = ("aovs".to_owned(), piece.aovs.to_string());
        let pixels = ("pixels".to_owned(), format!("{} x {}", piece.film.width(), piece.film.height()));
        [aovs, pixels].into_iter().chain(piece.record.iter().cloned()).collect()
    };
    match render::difference(&own(a), &own(b)) {
        Some((name, of_a, of_b)) => {
            let (a, b) = (a.path.display(), b.path.display());
            Err(anyhow!("{a} and {b} are parts of two pictures: their {name} is {of_a} and {of_b}"))
        }
        None => Ok(()),
    }
}

/// The error, with the files between which it is.
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
    let text = if args.json {
        let size = [film.width(), film.height()];
        let (picture, parts) = (args.output.display().to_string(), args.parts.len());
        json!({ "picture": picture, "size": size, "parts": parts, "samples": samples, "dropped_samples": film.n_dropped() })
            .to_string()
    } else {
        let dropped = match film.n_dropped() {
            0 => String::new(),
            n => format!("; {n} of its pixels' samples were not finite and were dropped"),
        };
        format!("{}: samples {samples} of {} parts{dropped}", args.output.display(), args.parts.len())
    };
    output::to_stdout(&text)
}
