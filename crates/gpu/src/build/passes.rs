//! What each pass of a build takes.

use canted_lbvh::{Bits, Strategy};

use super::{Items, Run, STRATEGIES, StageTime, aabbs, codes, domain, obbs, sort, tree};
use crate::{Gpu, GpuError};

/// Milliseconds a pass: [`StageTime`] says by which clock. What a device has no room for is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Passes {
    /// Grids of the codes.
    pub domain: Option<f64>,
    /// Codes.
    pub codes: Option<f64>,
    /// Order of the codes.
    pub sort: Option<f64>,
    /// Nodes.
    pub tree: Option<f64>,
    /// Boxes by strategy, in the order of [`STRATEGIES`]: leaning ones without the axis-aligned boxes that they need besides.
    pub boxes: [Option<f64>; STRATEGIES.len()],
    /// The first refusal, if there is one.
    pub refused: Option<GpuError>,
}

impl Passes {
    /// The least of `runs` builds, after one in which drivers compile.
    ///
    /// # Errors
    /// A device that is lost.
    pub fn measure(gpu: &Gpu, items: &Items, bits: Bits, runs: usize) -> Result<Self, GpuError> {
        let first = Self::once(gpu, items, bits)?;
        let later = (0..runs).map(|_| Self::once(gpu, items, bits)).collect::<Result<Vec<_>, _>>()?;
        Ok(later.into_iter().reduce(|least, other| least.least(&other)).unwrap_or(first))
    }

    /// All passes of a build with volumes of one of [`STRATEGIES`]; `None` for others, and where one is missing.
    #[must_use]
    pub fn total(&self, strategy: Strategy) -> Option<f64> {
        let own = self.boxes[STRATEGIES.iter().position(|&known| known == strategy)?];
        let axis_aligned = if strategy == Strategy::Aabb { Some(0.0) } else { self.boxes[0] };
        [self.domain, self.codes, self.sort, self.tree, axis_aligned, own].into_iter().sum()
    }

    fn least(&self, other: &Self) -> Self {
        let min = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a.min(b));
        Self {
            domain: min(self.domain, other.domain),
            codes: min(self.codes, other.codes),
            sort: min(self.sort, other.sort),
            tree: min(self.tree, other.tree),
            boxes: std::array::from_fn(|k| min(self.boxes[k], other.boxes[k])),
            refused: self.refused.clone().or_else(|| other.refused.clone()),
        }
    }

    /// One build, as far as the device has room for it.
    fn once(gpu: &Gpu, items: &Items, bits: Bits) -> Result<Self, GpuError> {
        let mut passes = Self::default();
        match passes.fill(gpu, items, bits) {
            Err(error @ (GpuError::Limit { .. } | GpuError::OutOfMemory { .. })) => {
                passes.refused = Some(error);
                Ok(passes)
            }
            other => other.map(|()| passes),
        }
    }

    fn fill(&mut self, gpu: &Gpu, items: &Items, bits: Bits) -> Result<(), GpuError> {
        let mut run = Run::timed(gpu);
        let domains = domain(&mut run, items, bits)?;
        self.domain = Some(taken(&run, &["domain"]));
        let input = codes(&mut run, items, &domains, bits)?;
        self.codes = Some(taken(&run, &["codes"]));
        let sorted = sort(&mut run, items, &input)?;
        self.sort = Some(taken(&run, &["sort"]));
        let trees = tree(&mut run, items, &sorted.codes)?;
        self.tree = Some(taken(&run, &["tree"]));
        let axis_aligned = aabbs(&mut run, items, &sorted.leaves, &trees)?;
        self.boxes[0] = Some(taken(&run, &["aabb"]));
        for (boxes, strategy) in self.boxes.iter_mut().zip(STRATEGIES).skip(1) {
            let mut run = Run::timed(gpu);
            obbs(&mut run, items, &sorted.leaves, &trees, &axis_aligned, strategy)?;
            *boxes = Some(taken(&run, &["levels", "obb"]));
        }
        Ok(())
    }
}

/// Milliseconds of some stations together.
fn taken(run: &Run<'_>, stations: &[&str]) -> f64 {
    let of_these = |time: &&StageTime| stations.contains(&time.stage);
    run.times().iter().filter(of_these).map(|time| time.milliseconds).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_count_what_a_build_goes_through() {
        let boxes = [16.0, 32.0, 64.0, 128.0, 256.0].map(Some);
        let [domain, codes, sort, tree] = [1.0, 2.0, 4.0, 8.0].map(Some);
        let passes = Passes { domain, codes, sort, tree, boxes, refused: None };
        assert_eq!(passes.total(Strategy::Aabb), Some(31.0));
        assert_eq!(passes.total(Strategy::Dop), Some(31.0 + 256.0));
        assert_eq!(passes.total(Strategy::PcaUnbounded), None);
        let faster = Passes { sort: Some(3.0), boxes: [Some(17.0); 5], ..passes.clone() };
        let least = passes.least(&faster);
        assert_eq!((least.sort, least.boxes), (Some(3.0), [16.0, 17.0, 17.0, 17.0, 17.0].map(Some)));
        let refused = Passes { boxes: [Some(16.0), None, None, None, None], ..passes.clone() };
        assert_eq!((refused.total(Strategy::Aabb), refused.total(Strategy::Dop)), (Some(31.0), None));
        assert_eq!(passes.least(&refused).boxes, refused.boxes);
    }
}
