//! What each pass of a build takes.

use canted_lbvh::{Bits, Strategy};

use super::{Items, Run, STRATEGIES, StationTime, aabbs, codes, domain, obbs, sort, tree};
use crate::{Gpu, GpuError};

/// Milliseconds a pass: [`StationTime`] says by which clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passes {
    /// Grids of the codes.
    pub domain: f64,
    /// Codes.
    pub codes: f64,
    /// Order of the codes.
    pub sort: f64,
    /// Nodes.
    pub tree: f64,
    /// Boxes by strategy, in the order of [`STRATEGIES`]: leaning ones without the axis-aligned boxes that they need besides.
    pub boxes: [f64; STRATEGIES.len()],
}

impl Passes {
    /// The least of `runs` builds, after one in which drivers compile.
    ///
    /// # Errors
    /// A device that lacks the memory, or is lost.
    pub fn measure(gpu: &Gpu, items: &Items, bits: Bits, runs: usize) -> Result<Self, GpuError> {
        once(gpu, items, bits)?;
        let never = Self {
            domain: f64::MAX,
            codes: f64::MAX,
            sort: f64::MAX,
            tree: f64::MAX,
            boxes: [f64::MAX; STRATEGIES.len()],
        };
        (0..runs).try_fold(never, |least, _| Ok(least.least(&once(gpu, items, bits)?)))
    }

    /// All passes of a build with volumes of one of [`STRATEGIES`]; `None` for others.
    #[must_use]
    pub fn total(&self, strategy: Strategy) -> Option<f64> {
        let own = self.boxes[STRATEGIES.iter().position(|&known| known == strategy)?];
        let axis_aligned = if strategy == Strategy::Aabb { 0.0 } else { self.boxes[0] };
        Some(self.domain + self.codes + self.sort + self.tree + axis_aligned + own)
    }

    fn least(&self, other: &Self) -> Self {
        Self {
            domain: self.domain.min(other.domain),
            codes: self.codes.min(other.codes),
            sort: self.sort.min(other.sort),
            tree: self.tree.min(other.tree),
            boxes: std::array::from_fn(|k| self.boxes[k].min(other.boxes[k])),
        }
    }
}

fn once(gpu: &Gpu, items: &Items, bits: Bits) -> Result<Passes, GpuError> {
    let mut run = Run::timed(gpu);
    let domains = domain(&mut run, items, bits)?;
    let input = codes(&mut run, items, &domains, bits)?;
    let sorted = sort(&mut run, items, &input)?;
    let trees = tree(&mut run, items, &sorted.codes)?;
    let axis_aligned = aabbs(&mut run, items, &sorted.leaves, &trees)?;
    let mut boxes = [taken(&run, &["aabb"]); STRATEGIES.len()];
    for (taken_by, strategy) in boxes.iter_mut().zip(STRATEGIES).skip(1) {
        let mut run = Run::timed(gpu);
        obbs(&mut run, items, &sorted.leaves, &trees, &axis_aligned, strategy)?;
        *taken_by = taken(&run, &["levels", "obb"]);
    }
    Ok(Passes {
        domain: taken(&run, &["domain"]),
        codes: taken(&run, &["codes"]),
        sort: taken(&run, &["sort"]),
        tree: taken(&run, &["tree"]),
        boxes,
    })
}

/// Milliseconds of some stations together.
fn taken(run: &Run<'_>, stations: &[&str]) -> f64 {
    let of_these = |time: &&StationTime| stations.contains(&time.station);
    run.times().iter().filter(of_these).map(|time| time.milliseconds).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_count_what_a_build_goes_through() {
        let passes = Passes { domain: 1.0, codes: 2.0, sort: 4.0, tree: 8.0, boxes: [16.0, 32.0, 64.0, 128.0, 256.0] };
        assert_eq!(passes.total(Strategy::Aabb), Some(31.0));
        assert_eq!(passes.total(Strategy::Dop), Some(31.0 + 256.0));
        assert_eq!(passes.total(Strategy::PcaUnbounded), None);
        let faster = Passes { sort: 3.0, boxes: [17.0; 5], ..passes };
        let least = passes.least(&faster);
        assert_eq!((least.sort, least.boxes), (3.0, [16.0, 17.0, 17.0, 17.0, 17.0]));
    }
}
