//! Stores of tiles: how long writing and opening take, and what rays cost beside a BVH in memory.
//!
//! ```text
//! heights, a row at a time -> TileWriter -> TiledBvh under a limit, TiledBvh that holds all, TriangleBvh -> seconds
//! ```

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use canted_fixtures::SplitMix64;
use canted_tiles::{OpenOptions, TileWriter, TiledBvh, WriteOptions};
use canted_trace::{Hit, Intersect, Ray};
use canted_wide::TriangleBvh;

use crate::options::Options;
use crate::timing::{Seconds, median, time_all};

/// Most triangles of the BVH in memory: more take as much memory to build as a store is there to save.
const MOST_IN_MEMORY: usize = 20_000_000;

/// Rays of each kind.
const RAYS: usize = 1_000_000;

/// Waves that make the heights.
const WAVES: usize = 6;

/// A height field of `side * side` squares of two triangles.
struct Field {
    side: usize,
    seed: u64,
    /// Of each wave: direction and frequency, phase, and height.
    waves: [([f64; 2], f64, f64); WAVES],
}

impl Field {
    fn new(n_triangles: usize, seed: u64) -> Self {
        let side = ((n_triangles as f64 / 2.0).sqrt().ceil() as usize).max(1);
        let mut random = SplitMix64::new(seed);
        let waves = std::array::from_fn(|_| {
            let direction = [0, 1].map(|_| 0.002 + 0.05 * random.unit());
            (direction, 7.0 * random.unit(), 1.5 / direction[0].max(direction[1]))
        });
        Self { side, seed, waves }
    }

    /// Vertices along one row.
    fn row(&self, y: usize) -> Vec<[f32; 3]> {
        let mut random = SplitMix64::new(self.seed + 1 + y as u64);
        let height = |x: f64| {
            let waves = self.waves.iter().map(|([a, b], phase, height)| height * (a * x + b * y as f64 + phase).sin());
            waves.sum::<f64>()
        };
        (0..=self.side).map(|x| [x as f32, y as f32, (height(x as f64) + 0.3 * random.signed()) as f32]).collect()
    }

    /// Calls `take` with the triangles of each row.
    fn each_row(&self, mut take: impl FnMut(&[[[f32; 3]; 3]]) -> Result<()>) -> Result<()> {
        let (mut low, mut triangles) = (self.row(0), vec![]);
        for y in 1..=self.side {
            let high = self.row(y);
            triangles.clear();
            for (low, high) in low.windows(2).zip(high.windows(2)) {
                triangles.extend([[low[0], low[1], high[0]], [high[0], low[1], high[1]]]);
            }
            take(&triangles)?;
            low = high;
        }
        Ok(())
    }

    /// Rays of a camera that sees a large part of the field, row by row; rays from above towards random places.
    fn rays(&self) -> [(&'static str, Vec<Ray>); 2] {
        let (side, n) = (self.side as f64, (RAYS as f64).sqrt() as usize);
        let eye = [0.5 * side, -0.2 * side, 0.15 * side].map(|x| x as f32);
        let at = |i: usize, range: f64| (2.0 * i as f64 / (n - 1) as f64 - 1.0) * range;
        let coherent =
            (0..n * n).map(|i| Ray::new(eye, [at(i % n, 0.5) as f32, 1.0, (at(i / n, 0.25) - 0.3) as f32])).collect();
        let mut random = SplitMix64::new(self.seed);
        let mut place = || [0, 1].map(|_| side * random.unit());
        let incoherent = (0..RAYS)
            .map(|_| {
                let ([a, b], [c, d]) = (place(), place());
                Ray::new([a as f32, b as f32, 2000.0], [(c - a) as f32, (d - b) as f32, -2000.0])
            })
            .collect();
        [("coherent", coherent), ("incoherent", incoherent)]
    }

    fn in_memory(&self) -> Result<TriangleBvh> {
        let mut corners = vec![];
        self.each_row(|triangles| {
            corners.extend_from_slice(triangles.as_flattened());
            Ok(())
        })?;
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Ok(TriangleBvh::build(&corners, &triangles)?)
    }
}

/// The most memory that this process held so far, in bytes; none where the system does not say.
fn most_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

/// Writes a store in a temporary folder, and measures it.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let field = Field::new(options.triangles, options.seed);
    let n_triangles = 2 * field.side * field.side;
    writeln!(out, "\n## Tiles\n")?;
    writeln!(
        out,
        "A height field of {:.2e} triangles, on {} threads; seconds of the wall and of the processor.\n",
        n_triangles as f64,
        rayon::current_num_threads()
    )?;
    let path = folder.path().join("field.tiles");
    write_store(out, &field, &path)?;
    let start = Instant::now();
    let opened = TiledBvh::open(&path, OpenOptions::default())?;
    let seconds = start.elapsed().as_secs_f64();
    let n_bytes = opened.n_file_bytes();
    writeln!(out, "Opened in {seconds:.2} s: {} tiles of {} MiB together.\n", opened.n_tiles(), n_bytes >> 20)?;
    drop(opened);
    let single = if n_triangles <= MOST_IN_MEMORY { Some(field.in_memory()?) } else { None };
    let open = |memory: u64| TiledBvh::open(&path, OpenOptions { memory, ..OpenOptions::default() });
    writeln!(
        out,
        "| rays | BVH | seconds | processor | of the first | tiles read |\n| --- | --- | --- | --- | --- | --- |"
    )?;
    for (kind, rays) in field.rays() {
        let mut first = None;
        let mut row = |name: &str, times: &[Seconds], hits: Vec<Option<Hit>>, reads: u64| -> Result<()> {
            let [wall, cpu] = [|s: &Seconds| s.wall, |s: &Seconds| s.cpu]
                .map(|part| median(&times.iter().map(part).collect::<Vec<_>>()));
            let (seconds, expected) = first.get_or_insert((cpu, hits.clone()));
            anyhow::ensure!(*expected == hits, "{name}: the hits are others");
            writeln!(out, "| {kind} | {name} | {wall:.2} | {cpu:.2} | {:.2} | {reads} |", cpu / *seconds)?;
            Ok(())
        };
        if let Some(bvh) = &single {
            let (times, hits) = timed(options.rounds, &rays, |rays, hits| bvh.par_closest_hits(rays, hits));
            row("one in memory", &times, hits, 0)?;
        }
        for (name, memory) in [("tiles, all held", u64::MAX), ("tiles, a tenth held", n_bytes / 10)] {
            let bvh = open(memory)?;
            // Once before: boxes of a tile are checked when it is first read.
            bvh.par_closest_hits(&rays, &mut vec![None; rays.len()]);
            let before = bvh.counts().reads;
            let (times, hits) = timed(options.rounds, &rays, |rays, hits| bvh.par_closest_hits(rays, hits));
            row(name, &times, hits, (bvh.counts().reads - before) / options.rounds as u64)?;
        }
    }
    Ok(())
}

fn write_store(out: &mut String, field: &Field, path: &Path) -> Result<()> {
    let mut writer = TileWriter::create(path, WriteOptions::default())?;
    let (written, seconds) = time_all(|| {
        field.each_row(|triangles| Ok(writer.push(triangles)?))?;
        anyhow::Ok(writer.finish(&mut |_| ())?)
    });
    written?;
    let memory = most_memory().map_or_else(|| "unknown".to_owned(), |bytes| format!("{} MiB", bytes >> 20));
    let Seconds { wall, cpu } = seconds;
    writeln!(out, "Written in {wall:.1} s, {cpu:.1} s of the processor, with {memory} of memory.")?;
    Ok(())
}

/// Times of some rounds, and the hits.
fn timed(
    n_rounds: usize,
    rays: &[Ray],
    trace: impl Fn(&[Ray], &mut [Option<Hit>]),
) -> (Vec<Seconds>, Vec<Option<Hit>>) {
    let mut hits = vec![None; rays.len()];
    let times = (0..n_rounds).map(|_| time_all(|| trace(rays, &mut hits)).1).collect();
    (times, hits)
}
