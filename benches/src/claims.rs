//! Whether README's table of speed holds on this machine, in about ten minutes.
//!
//! ```text
//! README.md -> rows of scenes with ratios -> `wide` measured on each -> stated and found, side by side
//! ```

use std::{fmt::Write, io::Write as _, path::Path};

use anyhow::{Context, Result, bail, ensure};

use crate::{
    curves, models,
    options::Options,
    wide::{Measured, Promise, Subject},
};

/// How much a stated figure may exceed what is found, relative to it.
const TOLERANCE: f64 = 0.05;

/// Head of the table, and the guarantee of the peers of each column.
const HEAD: &str = "| scene | Embree robust mode |";
const COLUMNS: [Promise; 2] = [Promise::Watertight, Promise::Fast];

/// README's names of scenes, by their first words, and the scenes of this program.
const SCENES: [(&str, &str); 9] = [
    ("trusses and lattice towers", "truss"),
    ("poles", "poles"),
    ("Sponza, rotated", "sponza_rotated"),
    ("Eiffel Tower", "eiffel"),
    ("Sponza", "sponza"),
    ("kitchen", "country_kitchen"),
    ("bunny scan", "bunny"),
    ("2.3 M triangles in 401 instances", "tower_field"),
    ("hair of round segments", HAIR),
];

/// The scene of curves.
const HAIR: &str = "hair";

/// A row of the table: rays a second relative to the peers of each column, for each kind of rays.
#[derive(Clone, Debug, PartialEq)]
struct Claim {
    scene: &'static str,
    ratios: [[f64; 3]; 2],
}

/// Measures what the table states, writes both side by side, and fails where a stated figure is too high.
pub(crate) fn section(out: &mut String) -> Result<()> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md"));
    let readme = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    // A quarter of the rays, and the engines of the table.
    let words = ["wide", "--quick", "--rounds", "5", "--engines", "quality,embree"];
    let options = Options::read(words.map(str::to_owned).into_iter())?;
    let _ = write!(
        out,
        "\n## README's table\n\nStated figures, and in brackets what this run found; camera / diffuse / occlusion rays.\n\n{HEAD} Embree \
         default mode |\n| --- | --- | --- |\n"
    );
    let mut exaggerated = vec![];
    for claim in claims(&readme)? {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let found = if claim.scene == HAIR {
            let ratios = one.install(|| curves::of_hair(&options))?;
            ratios.context("Embree is not found: see `CANTED_EMBREE` in CONTRIBUTING.md")?
        } else {
            let Some(model) = models::load(claim.scene)? else {
                let _ = writeln!(out, "| {} | not available here | |", claim.scene);
                continue;
            };
            let subject = Subject::new(claim.scene.to_owned(), model, &options)?;
            found(&one.install(|| subject.measure(&options))?)?
        };
        let row = row(&claim, &found);
        std::io::stderr().write_all(row.as_bytes())?;
        out.push_str(&row);
        exaggerated.extend(too_high(&claim, &found));
    }
    ensure_none(out, &exaggerated)
}

fn ensure_none(out: &str, exaggerated: &[String]) -> Result<()> {
    if exaggerated.is_empty() {
        return Ok(());
    }
    std::io::stdout().write_all(out.as_bytes())?;
    bail!("README.md states more than this machine shows: {}", exaggerated.join("; "));
}

/// The rows of the table.
fn claims(readme: &str) -> Result<Vec<Claim>> {
    let rows =
        readme.lines().skip_while(|line| !line.starts_with(HEAD)).skip(2).take_while(|line| line.starts_with('|'));
    let claims = rows.map(claim).collect::<Result<Vec<_>>>()?;
    ensure!(!claims.is_empty(), "README.md has no table that starts with '{HEAD}'");
    Ok(claims)
}

fn claim(row: &str) -> Result<Claim> {
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    let [_, name, robust, default, _] = cells[..] else {
        bail!("README.md: the row '{row}' does not have three cells")
    };
    let scene = SCENES.iter().find(|(words, _)| name.starts_with(words));
    let (_, scene) = scene.with_context(|| format!("README.md: no scene is known as '{name}'"))?;
    Ok(Claim { scene, ratios: [triple(robust)?, triple(default)?] })
}

fn triple(cell: &str) -> Result<[f64; 3]> {
    let numbers: Option<Vec<f64>> = cell.split('/').map(|number| number.trim().parse().ok()).collect();
    numbers.and_then(|all| all.try_into().ok()).with_context(|| format!("README.md: '{cell}' is not three numbers"))
}

/// The same ratios as measured.
fn found(measured: &Measured) -> Result<[[f64; 3]; 2]> {
    let ours = measured.contestants.iter().position(|c| c.name.contains("quality") && c.promise == Promise::Watertight);
    let ours = ours.context("the engines have the preset 'quality'")?;
    let mut found = [[0.0; 3]; 2];
    for (column, promise) in found.iter_mut().zip(COLUMNS) {
        let peers = measured.embree(promise);
        for (ratio, set) in column.iter_mut().zip(&measured.sets) {
            let of_set =
                set.ratio(ours, &peers).context("Embree is not found: see `CANTED_EMBREE` in CONTRIBUTING.md")?;
            *ratio = of_set.median;
        }
    }
    Ok(found)
}

fn row(claim: &Claim, found: &[[f64; 3]; 2]) -> String {
    let cell = |column: usize| {
        let pairs = claim.ratios[column].iter().zip(found[column]);
        pairs.map(|(stated, found)| format!("{stated:.2} ({found:.2})")).collect::<Vec<_>>().join(" / ")
    };
    format!("| {} | {} | {} |\n", claim.scene, cell(0), cell(1))
}

/// What is stated too high.
fn too_high(claim: &Claim, found: &[[f64; 3]; 2]) -> Vec<String> {
    let all = claim.ratios.as_flattened().iter().zip(found.as_flattened());
    let high = all.filter(|(stated, found)| **stated > (1.0 + TOLERANCE) * **found);
    high.map(|(stated, found)| format!("{} {stated:.2}, found {found:.2}", claim.scene)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_the_readme_is_read() {
        let claims = claims(include_str!("../../README.md")).unwrap();
        assert!(claims.len() >= 8 && claims.iter().all(|claim| claim.ratios.as_flattened().iter().all(|r| *r > 0.0)));
    }

    #[test]
    fn a_figure_that_is_too_high_is_named() {
        let stated = claim("| Sponza, 1 M | 1.20 / 1.10 / 1.00 | 0.90 / 0.80 / 0.70 |").unwrap();
        assert_eq!(stated.scene, "sponza");
        assert_eq!(too_high(&stated, &[[1.15, 1.2, 1.0], [0.9, 0.8, 0.7]]), [""; 0]);
        assert_eq!(
            too_high(&stated, &[[1.14, 1.2, 1.0], [0.9, 0.8, 0.66]]),
            ["sponza 1.20, found 1.14", "sponza 0.70, found 0.66"]
        );
        assert!(claim("| nowhere | 1 / 1 / 1 | 1 / 1 / 1 |").unwrap_err().to_string().contains("'nowhere'"));
        assert!(claim("| poles | 1 / x / 1 | 1 / 1 / 1 |").unwrap_err().to_string().contains("three numbers"));
    }
}
