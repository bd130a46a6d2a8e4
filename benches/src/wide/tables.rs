//! The measurements as Markdown and as JSON lines.
//!
//! Reads: everything measured. Writes: two tables of speed (fast, watertight), one of differing hits, one of builds.
//! Holds: every ratio is taken within a round, and its median over rounds is shown.

use std::{
    fmt::Write,
    fs::{self, File},
    io::Write as _,
    path::PathBuf,
};

use anyhow::{Context, Result};
use serde_json::json;

use super::{
    engine::{Owner, Promise, cpu},
    subject::{Contestant, Measured, MeasuredSet, Verdict},
};
use crate::{
    models::Kind,
    options::Options,
    timing::{median, spread},
};

/// What was measured, scene by scene.
#[derive(Default)]
pub(crate) struct Tables {
    measured: Vec<Measured>,
    absent: Vec<String>,
}

/// A median over rounds, and half the distance between the least and the greatest, relative to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ratio {
    pub(crate) median: f64,
    pub(crate) spread: f64,
}

impl Ratio {
    fn of(values: &[f64]) -> Self {
        Self { median: median(values), spread: spread(values) }
    }
}

impl Measured {
    /// The engines in the table of a guarantee: all that give it, ours with a stronger one, and if no peer gives it,
    /// the fast peers.
    pub(crate) fn in_table(&self, promise: Promise) -> Vec<usize> {
        let is_peer = |c: &&Contestant| c.owner == Owner::Peer;
        let has_peer = self.contestants.iter().filter(is_peer).any(|c| c.promise == promise);
        let stands = |c: &Contestant| {
            let is_other = match c.owner {
                Owner::Ours => promise == Promise::Fast,
                Owner::Peer => !has_peer && c.promise == Promise::Fast,
            };
            c.promise == promise || is_other
        };
        (0..self.contestants.len()).filter(|&i| stands(&self.contestants[i])).collect()
    }

    /// Peers in the table of a guarantee.
    pub(crate) fn peers(&self, promise: Promise) -> Vec<usize> {
        let is_peer = |&i: &usize| self.contestants[i].owner == Owner::Peer;
        self.in_table(promise).into_iter().filter(is_peer).collect()
    }

    /// The modes of Embree with a guarantee.
    pub(crate) fn embree(&self, promise: Promise) -> Vec<usize> {
        let is_one = |c: &Contestant| c.owner == Owner::Peer && c.promise == promise && c.name.starts_with("Embree");
        (0..self.contestants.len()).filter(|&i| is_one(&self.contestants[i])).collect()
    }

    /// A progress line for each set and guarantee.
    pub(crate) fn summary(&self) -> String {
        let mut text = format!("{}, {} triangles\n", self.scene, self.n_triangles);
        for set in &self.sets {
            for promise in [Promise::Fast, Promise::Watertight] {
                let peers = self.peers(promise);
                let _ = write!(text, "  {:9} {promise:?}:", set.kind.name());
                for i in self.in_table(promise) {
                    let name = &self.contestants[i].name;
                    let _ = match set.ratio(i, &peers) {
                        Some(ratio) => write!(
                            text,
                            "  {name} {:.2} M/s {:.2} (±{:.0} %)",
                            set.rate(i),
                            ratio.median,
                            100.0 * ratio.spread
                        ),
                        None => write!(text, "  {name} {:.2} M/s", set.rate(i)),
                    };
                }
                text.push('\n');
            }
        }
        text
    }
}

impl MeasuredSet {
    /// Million rays per second of an engine, in processor time.
    pub(crate) fn rate(&self, i: usize) -> f64 {
        self.n_rays as f64 / median(&cpu(&self.seconds[i])) * 1e-6
    }

    /// Speed relative to the best of `peers` in the same round; `None` without peers.
    pub(crate) fn ratio(&self, i: usize, peers: &[usize]) -> Option<Ratio> {
        let best = |round: usize| peers.iter().map(|&peer| self.seconds[peer][round].cpu).reduce(f64::min);
        let ratios: Option<Vec<f64>> =
            self.seconds[i].iter().enumerate().map(|(round, ours)| Some(best(round)? / ours.cpu)).collect();
        Some(Ratio::of(&ratios?))
    }

    /// The fastest of `peers` by its median.
    fn best(&self, peers: &[usize]) -> Option<usize> {
        peers.iter().copied().max_by(|&a, &b| self.rate(a).total_cmp(&self.rate(b)))
    }
}

impl Tables {
    /// Adds a scene.
    pub(crate) fn add(&mut self, measured: Measured) {
        self.measured.push(measured);
    }

    /// Adds a scene that is not available.
    pub(crate) fn absent(&mut self, name: &str) {
        self.absent.push(name.to_owned());
    }

    /// Writes the section.
    pub(crate) fn write(&self, out: &mut String, options: &Options) {
        let _ = write!(
            out,
            "\n## WideBvh compared with peers\n\nOne thread. Engines take turns every 8,192 rays; {} rounds after a warm-up. Rays: \
             four views of {side}², one scattered ray per camera hit, one occlusion ray per camera hit (within a tenth of the \
             diagonal). Cells: camera / diffuse / occlusion. Ratios are relative to the fastest peer of the same round in thread \
             time, median over rounds, with half the range; above 1 is faster.{}\n",
            options.rounds,
            peers_note(),
            side = canted_fixtures::RESOLUTION / if options.is_quick { 2 } else { 1 },
        );
        for name in &self.absent {
            let _ = writeln!(out, "\nNot available: {name}.");
        }
        self.speed(out, Promise::Fast, "Compared with peers in their fastest modes");
        self.speed(out, Promise::Watertight, "Compared with peers in their most robust modes");
        self.differences(out);
        self.builds(out);
    }

    fn speed(&self, out: &mut String, promise: Promise, title: &str) {
        let columns = self.columns(|measured| measured.in_table(promise));
        let _ = write!(out, "\n### {title}\n\n| scene | triangles | fastest peer, M rays/s |");
        head(out, 3, &columns);
        for measured in &self.measured {
            let peers = measured.peers(promise);
            let _ = write!(out, "| {} | {} |", measured.scene, measured.n_triangles);
            let fastest = measured.triple(|set| match set.best(&peers) {
                Some(best) => format!("{:.2} {}", set.rate(best), measured.contestants[best].name),
                None => "none".to_owned(),
            });
            let _ = write!(out, " {fastest} |");
            measured.row(out, &columns, |i| {
                let is_ours = measured.contestants[i].owner == Owner::Ours;
                measured.triple(|set| match set.ratio(i, &peers) {
                    Some(ratio) if is_ours => format!("**{:.2}** (±{:.0} %)", ratio.median, 100.0 * ratio.spread),
                    Some(ratio) => format!("{:.2}", ratio.median),
                    None => format!("{:.2} M/s", set.rate(i)),
                })
            });
        }
    }

    fn differences(&self, out: &mut String) {
        out.push_str(
            "\n### Answers that differ from testing every triangle\n\nOf all camera and diffuse rays: hits lost + hits \
             invented + hits at another distance (by more than 1e-4 of it); of occlusion rays: lost + invented. \
             Engines with instances are compared with a BVH with instances.\n\n| scene | rays |",
        );
        let columns = self.columns(Measured::all);
        head(out, 2, &columns);
        for measured in &self.measured {
            let n_rays: usize = measured.sets.iter().map(|set| set.n_rays).sum();
            let _ = write!(out, "| {} | {n_rays} |", measured.scene);
            measured.row(out, &columns, |i| {
                let nearest = measured.verdict(i, |kind| kind != Kind::Occlusion);
                let occlusion = measured.verdict(i, |kind| kind == Kind::Occlusion);
                let Verdict { lost, invented, elsewhere } = nearest;
                format!("{lost} + {invented} + {elsewhere}; {} + {}", occlusion.lost, occlusion.invented)
            });
        }
    }

    fn builds(&self, out: &mut String) {
        out.push_str(
            "\n### Build and memory\n\nFrom indexed triangles to a BVH ready for rays: seconds on one thread, on two in brackets \
             (wall time, interleaved, median of three; a build longer than 2.5 s runs once, on one thread only); bytes per triangle. \
             `obvhs` builds on one thread here. Meshes that Embree reads in place are not counted.\n\n| scene |",
        );
        let columns = self.columns(Measured::all);
        head(out, 1, &columns);
        for measured in &self.measured {
            let _ = write!(out, "| {} |", measured.scene);
            measured.row(out, &columns, |i| {
                let built = &measured.contestants[i].built;
                let two = built.two_threads.map_or_else(String::new, |two| format!(" ({two:.3})"));
                let a_triangle = |n_bytes: usize| format!("{:.0} B", n_bytes as f64 / measured.n_triangles as f64);
                let bytes = built.n_bytes.map_or_else(|| "–".to_owned(), a_triangle);
                format!("{:.3}{two} s, {bytes}", built.one_thread)
            });
        }
    }

    /// Titles of all engines that a scene shows, in the order of their first scene.
    fn columns(&self, shown: impl Fn(&Measured) -> Vec<usize>) -> Vec<String> {
        let mut columns: Vec<String> = vec![];
        for measured in &self.measured {
            for i in shown(measured) {
                let title = titled(&measured.contestants[i]);
                if !columns.contains(&title) {
                    columns.push(title);
                }
            }
        }
        columns
    }
}

/// Ends a table's header that has `n_before` columns already.
fn head(out: &mut String, n_before: usize, columns: &[String]) {
    for column in columns {
        let _ = write!(out, " {column} |");
    }
    let _ = writeln!(out, "\n|{}", " --- |".repeat(n_before + columns.len()));
}

impl Measured {
    /// Ends a row: a cell for each column's engine, a dash where this scene lacks it.
    fn row(&self, out: &mut String, columns: &[String], cell: impl Fn(usize) -> String) {
        for column in columns {
            let engine = self.contestants.iter().position(|contestant| titled(contestant) == *column);
            let _ = write!(out, " {} |", engine.map_or_else(|| "–".to_owned(), &cell));
        }
        out.push('\n');
    }

    /// All engines.
    fn all(&self) -> Vec<usize> {
        (0..self.contestants.len()).collect()
    }

    /// An engine's differing answers over the sets of some kinds.
    fn verdict(&self, i: usize, counts: impl Fn(Kind) -> bool) -> Verdict {
        let sets = self.sets.iter().filter(|set| counts(set.kind));
        sets.map(|set| set.verdicts[i]).fold(Verdict::default(), |a, b| Verdict {
            lost: a.lost + b.lost,
            invented: a.invented + b.invented,
            elsewhere: a.elsewhere + b.elsewhere,
        })
    }

    /// A cell of three, one for each set.
    fn triple(&self, cell: impl Fn(&MeasuredSet) -> String) -> String {
        self.sets.iter().map(cell).collect::<Vec<_>>().join(" / ")
    }
}

/// A name with the triangle test, if ours.
fn named(name: &str, owner: Owner, promise: Promise) -> String {
    match (owner, promise) {
        (Owner::Ours, Promise::Fast) => format!("{name}, Möller-Trumbore"),
        (Owner::Ours, Promise::Watertight) => format!("{name}, watertight"),
        (Owner::Peer, _) => name.to_owned(),
    }
}

fn titled(contestant: &Contestant) -> String {
    named(&contestant.name, contestant.owner, contestant.promise)
}

/// How the peers of this build were compiled.
fn peers_note() -> String {
    let flags = if cfg!(target_feature = "avx2") {
        "Everything is compiled for processors with AVX2, `obvhs` too."
    } else {
        "`obvhs` is compiled without flags; Embree and ours select instructions at run time."
    };
    let peers = match (cfg!(feature = "peers"), cfg!(target_feature = "avx2")) {
        (true, true) => {
            "tinybvh's bindings have no any-hit query (closest-hit queries replace it) and do not report bytes; a dash means that it \
             crashed in a trial on that scene."
        }
        (true, false) => "tinybvh's bindings offer its wide BVH only if the compiler may assume AVX2.",
        (false, _) => {
            "Built without the feature `peers`: the only peer is `obvhs`, with Möller-Trumbore in both tables."
        }
    };
    format!(" {flags} {peers}")
}

/// A file of JSON lines in `target/bench`: one for each engine and set of rays, with the numbers of every round.
pub(crate) struct Record {
    file: File,
}

impl Record {
    /// Starts an empty file.
    pub(crate) fn create(name: &str) -> Result<Self> {
        let target = std::env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target")), PathBuf::from);
        let folder = target.join("bench");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let path = folder.join(name);
        Ok(Self { file: File::create(&path).with_context(|| format!("cannot write {}", path.display()))? })
    }

    /// Adds a line.
    pub(crate) fn line(&mut self, value: &serde_json::Value) -> Result<()> {
        Ok(writeln!(self.file, "{value}")?)
    }

    /// Adds a scene.
    pub(crate) fn add(&mut self, measured: &Measured) -> Result<()> {
        for (i, contestant) in measured.contestants.iter().enumerate() {
            let about = |more: serde_json::Value| {
                let mut line = json!({
                    "scene": measured.scene,
                    "triangles": measured.n_triangles,
                    "engine": contestant.name,
                    "owner": format!("{:?}", contestant.owner),
                    "promise": format!("{:?}", contestant.promise),
                });
                if let (Some(line), serde_json::Value::Object(more)) = (line.as_object_mut(), more) {
                    line.extend(more);
                }
                line
            };
            let built = &contestant.built;
            let build = json!({
                "bytes": built.n_bytes,
                "build_one_thread_s": built.one_thread,
                "build_two_threads_s": built.two_threads,
            });
            self.line(&about(build))?;
            for set in &measured.sets {
                let verdict = set.verdicts[i];
                let set = json!({
                    "set": set.kind.name(),
                    "rays": set.n_rays,
                    "cpu_s": cpu(&set.seconds[i]),
                    "wall_s": set.seconds[i].iter().map(|s| s.wall).collect::<Vec<_>>(),
                    "lost": verdict.lost,
                    "invented": verdict.invented,
                    "elsewhere": verdict.elsewhere,
                });
                self.line(&about(set))?;
            }
        }
        Ok(())
    }
}
