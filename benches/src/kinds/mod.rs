//! The generated kinds of scenes: every preset compared with Embree, and its hits with a loop over all triangles.
//!
//! ```text
//! kind, size, seed -> subject (model, rays) -> entries -> built, traced in turn -> checked (loop) -> tables, JSON lines
//! ```

mod checked;
mod subject;
mod tables;

use std::io::Write;

use anyhow::{Result, bail};
use canted_fixtures::kinds::{self, Family, Kind};

use crate::{options::Options, wide::Record};
use {subject::Subject, tables::Tables};

/// Triangles of kinds that are not ordinary, and with `--quick`.
const SIZE: [usize; 2] = [100_000, 10_000];
/// Least and greatest number of triangles of ordinary kinds; the sizes between are in geometric progression.
const ORDINARY_SIZES: [f64; 2] = [40_000.0, 1_000_000.0];

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let mut record = Record::create("kinds.jsonl")?;
    let mut tables = Tables::default();
    for (kind, size) in chosen(options)? {
        let subject = Subject::new(kind, size, options)?;
        // A pool of one thread builds and traces everything on one thread.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let measured = one.install(|| subject.measure(options))?;
        let measured = measured.check(&subject);
        subject::add_record(&mut record, &measured, options.seed)?;
        std::io::stderr().write_all(tables::summary(&measured).as_bytes())?;
        tables.add(measured);
    }
    tables.write(out, options);
    Ok(())
}

/// The kinds to measure with their sizes: all, or those that `--scenes` names by themselves or by their family.
fn chosen(options: &Options) -> Result<Vec<(&'static Kind, usize)>> {
    let words = options.scenes(&[]);
    let is_known = |word: &str| kinds::named(word).is_some() || Family::ALL.iter().any(|family| family.name() == word);
    if let Some(unknown) = words.iter().find(|word| !is_known(word)) {
        bail!("there is no kind or family '{unknown}'");
    }
    let is_chosen = |kind: &Kind| words.is_empty() || words.iter().any(|w| w == kind.name || w == kind.family.name());
    let sized = kinds::all().iter().map(|kind| (kind, size(kind, options.is_quick)));
    Ok(sized.filter(|(kind, _)| is_chosen(kind)).collect())
}

/// The number of triangles asked of a kind.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most a million")]
#[expect(clippy::cast_precision_loss, reason = "a place among fifty")]
fn size(kind: &Kind, is_quick: bool) -> usize {
    if is_quick {
        return SIZE[1];
    }
    let ordinary: Vec<&str> =
        kinds::all().iter().filter(|kind| kind.family == Family::Ordinary).map(|kind| kind.name).collect();
    // Steps of seven, coprime to their number, so that neighbors of one kind of geometry differ in size.
    let place = ordinary.iter().position(|name| *name == kind.name).map(|place| place * 7 % ordinary.len());
    place.map_or(SIZE[0], |place| {
        let fraction = place as f64 / (ordinary.len() - 1) as f64;
        let [least, greatest] = ORDINARY_SIZES;
        (least * (greatest / least).powf(fraction)).round() as usize
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(args: &str) -> Options {
        Options::read(args.split_whitespace().map(str::to_owned)).unwrap()
    }

    #[test]
    fn kinds_are_chosen_by_name_and_by_family() {
        let names =
            |args: &str| -> Vec<&str> { chosen(&options(args)).unwrap().iter().map(|(kind, _)| kind.name).collect() };
        assert_eq!(names("kinds").len(), 50);
        assert_eq!(names("kinds --scenes gears,far"), ["gears", "far_1e4", "far_1e6", "far_1e7"]);
        assert!(chosen(&options("kinds --scenes gears,sponza")).unwrap_err().to_string().contains("'sponza'"));
    }

    #[test]
    fn ordinary_sizes_cover_the_range_once_each() {
        let all = chosen(&options("kinds --scenes ordinary")).unwrap();
        let mut sizes: Vec<usize> = all.iter().map(|&(_, size)| size).collect();
        sizes.sort_unstable();
        assert_eq!((sizes[0], sizes[sizes.len() - 1]), (40_000, 1_000_000));
        assert!(sizes.windows(2).all(|pair| pair[0] < pair[1]), "{sizes:?}");
        assert!(chosen(&options("kinds --quick")).unwrap().iter().all(|&(_, size)| size == SIZE[1]));
    }
}
