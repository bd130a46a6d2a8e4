//! Command line options.

use std::{
    path::PathBuf,
    time::{SystemTime, UNIX_EPOCH},
};

use anyhow::{Result, anyhow};
use canted_gpu::Choice;

/// The section that this program runs in a separate process, to check whether tinybvh survives a scene.
pub(crate) const TRIAL: &str = "tinybvh-trial";

/// The section that compares README with a measurement; measured only if it is named.
pub(crate) const CLAIMS: &str = "claims";

/// The section that measures stores of tiles, which takes gigabytes of disk; measured only if it is named.
pub(crate) const TILES: &str = "tiles";

/// The section that compares our trees and our loop with Embree's, which needs the feature `peers`; measured only if it is named.
pub(crate) const TREES: &str = "trees";

/// The sections, in the order of the report.
const SECTIONS: [&str; 10] = ["nodes", "kinds", "wide", "motion", "picture", "bodies", "curves", TREES, TILES, CLAIMS];

/// Those that are measured only if they are named.
const NAMED: [&str; 3] = [TREES, TILES, CLAIMS];

/// The options of the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Options {
    sections: Vec<String>,
    /// Measured rounds of each comparison.
    pub(crate) rounds: usize,
    scenes: Vec<String>,
    engines: Vec<String>,
    /// The measured device, alone unless sections are named: `gpu` is the best, other values are part of an adapter's
    /// name.
    pub(crate) device: Option<Choice>,
    /// The chapters of a device that are measured; all where none is named.
    pub(crate) chapters: Vec<String>,
    /// A quarter of the rays, and each BVH built once.
    pub(crate) is_quick: bool,
    /// Seed of the generated kinds of scenes and their rays.
    pub(crate) seed: u64,
    /// Kinds whose forms follow from the seed, in place of the fifty.
    pub(crate) is_fresh: bool,
    /// A folder whose files are measured as kinds are.
    pub(crate) models: Option<PathBuf>,
    /// Triangles of the store of tiles.
    pub(crate) triangles: usize,
}

impl Options {
    /// Reads the arguments, without the program's name.
    pub(crate) fn read(args: impl Iterator<Item = String>) -> Result<Self> {
        let mut options = Self {
            sections: vec![],
            rounds: 5,
            scenes: vec![],
            engines: vec![],
            device: None,
            chapters: vec![],
            is_quick: false,
            seed: 1,
            is_fresh: false,
            models: None,
            triangles: 10_000_000,
        };
        let mut args = args.peekable();
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| anyhow!("{arg} needs a value"));
            match arg.as_str() {
                "--rounds" => {
                    let value = value()?;
                    let rounds = value.parse().ok().filter(|&rounds| rounds > 0);
                    options.rounds = rounds.ok_or_else(|| anyhow!("--rounds '{value}' is not a number of rounds"))?;
                }
                "--seed" => {
                    let value = value()?;
                    options.seed = value.parse().map_err(|_| anyhow!("--seed '{value}' is not a whole number"))?;
                }
                "--fresh" => {
                    options.is_fresh = true;
                    options.seed = match args.next_if(|word| word.bytes().all(|byte| byte.is_ascii_digit())) {
                        Some(seed) => seed.parse().map_err(|_| anyhow!("--fresh '{seed}' is not a seed below 2^64"))?,
                        None => drawn_seed(),
                    };
                }
                "--triangles" => {
                    let value = value()?;
                    let n = value.parse::<f64>().ok().filter(|n| (1.0..=1e10).contains(n));
                    options.triangles =
                        n.ok_or_else(|| anyhow!("--triangles '{value}' is not a number of triangles"))? as usize;
                }
                "--models" => options.models = Some(value()?.into()),
                "--scenes" => options.scenes = list(&value()?),
                "--engines" => options.engines = list(&value()?),
                "--device" => {
                    let name = value()?;
                    options.device = Some(if name == "gpu" { Choice::Best } else { Choice::Named(name) });
                }
                "--chapters" => options.chapters = list(&value()?),
                "--quick" => options.is_quick = true,
                section if SECTIONS.contains(&section) || section == TRIAL => options.sections.push(arg),
                _ => {
                    let sections = SECTIONS.join(", ");
                    return Err(anyhow!(
                        "unknown argument '{arg}'; use {sections}, --rounds N, --scenes A,B, --engines A,B, --device gpu|NAME, \
                         --chapters A,B, --quick, --seed N, --fresh [SEED], --models FOLDER, --triangles N"
                    ));
                }
            }
        }
        Ok(options)
    }

    /// Whether a section is measured: all are if neither a section nor a device is named.
    pub(crate) fn wants(&self, section: &str) -> bool {
        (self.sections.is_empty() && self.device.is_none() && !NAMED.contains(&section))
            || self.sections.iter().any(|wanted| wanted == section)
    }

    /// Whether this process is the trial of a peer.
    pub(crate) fn is_trial(&self) -> bool {
        self.sections == [TRIAL]
    }

    /// The named scenes, or the default ones.
    pub(crate) fn scenes(&self, default: &[&str]) -> Vec<String> {
        if self.scenes.is_empty() { default.iter().map(|&name| name.to_owned()).collect() } else { self.scenes.clone() }
    }

    /// Adds what was selected to the titles of sections, so that a run of some scenes does not replace a run of all.
    pub(crate) fn titled(&self, sections: &str) -> String {
        let fresh = self.is_fresh.then(|| "fresh kinds".to_owned());
        let models = self.models.is_some().then(|| "models".to_owned());
        let selected: Vec<String> = fresh.into_iter().chain(models).chain(self.scenes.iter().cloned()).collect();
        if selected.is_empty() {
            return sections.to_owned();
        }
        let of_scenes = format!(": {}", selected.join(", "));
        let title = |line: &str| if line.starts_with("## ") || line.starts_with("### ") { &of_scenes[..] } else { "" };
        sections.lines().map(|line| format!("{line}{}\n", title(line))).collect()
    }

    /// Whether an engine is measured: its name contains one of the words of `--engines`.
    pub(crate) fn wants_engine(&self, name: &str) -> bool {
        let name = name.to_lowercase();
        self.engines.is_empty() || self.engines.iter().any(|word| name.contains(&word.to_lowercase()))
    }
}

/// A seed that no earlier run had: the time in nanoseconds, below 10^9 so that it can be typed again.
fn drawn_seed() -> u64 {
    let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (time.as_secs() ^ u64::from(time.subsec_nanos())) % 1_000_000_000
}

fn list(value: &str) -> Vec<String> {
    value.split(',').map(|item| item.trim().to_owned()).filter(|item| !item.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(args: &str) -> Result<Options> {
        Options::read(args.split_whitespace().map(str::to_owned))
    }

    #[test]
    fn options_are_read() {
        let options = read("wide --rounds 3 --scenes truss,bunny --engines ours,embree --quick").unwrap();
        assert_eq!((options.rounds, options.is_quick), (3, true));
        assert_eq!(options.scenes(&["grid"]), ["truss", "bunny"]);
        assert_eq!((options.seed, read("kinds --seed 7").unwrap().seed), (1, 7));
        let fresh = read("kinds --fresh 12 --quick").unwrap();
        assert_eq!((fresh.is_fresh, fresh.seed, fresh.is_quick), (true, 12, true));
        let drawn = read("kinds --fresh --models cars").unwrap();
        assert!(drawn.is_fresh && drawn.is_quick != fresh.is_quick && drawn.models == Some("cars".into()));
        assert!(options.wants("wide") && !options.wants("kinds"));
        assert!(options.wants_engine("Embree 4.4 high") && !options.wants_engine("obvhs BVH2"));
    }

    #[test]
    fn titles_name_the_selected_scenes() {
        let sections = "\n## Trees\n\nText.\n\n### Table\n| a |\n";
        assert_eq!(read("wide").unwrap().titled(sections), sections);
        assert_eq!(read("kinds --fresh 3").unwrap().titled("## Kinds\n"), "## Kinds: fresh kinds\n");
        let titled = read("wide --scenes truss,grid").unwrap().titled(sections);
        assert_eq!(titled, "\n## Trees: truss, grid\n\nText.\n\n### Table: truss, grid\n| a |\n");
    }

    #[test]
    fn everything_is_measured_by_default() {
        let options = read("").unwrap();
        assert!(
            SECTIONS.iter().all(|&section| options.wants(section) != NAMED.contains(&section))
                && options.wants_engine("obvhs")
        );
        assert_eq!(options.scenes(&["grid"]), ["grid"]);
    }

    #[test]
    fn a_device_is_measured_alone() {
        let options = read("--device gpu --rounds 2").unwrap();
        assert_eq!(options.device, Some(Choice::Best));
        assert!(SECTIONS.iter().all(|section| !options.wants(section)));
        let options = read("kinds --device llvmpipe").unwrap();
        assert_eq!(options.device, Some(Choice::Named("llvmpipe".to_owned())));
        assert!(options.wants("kinds") && !options.wants("wide"));
    }

    #[test]
    fn a_wrong_argument_is_named() {
        for (args, word) in [
            ("wild", "wild"),
            ("--rounds x", "x"),
            ("--rounds 0", "0"),
            ("--scenes", "--scenes"),
            ("--device", "--device"),
            ("kinds --seed -1", "-1"),
            ("tiles --triangles many", "many"),
        ] {
            assert!(read(args).unwrap_err().to_string().contains(word));
        }
    }
}
