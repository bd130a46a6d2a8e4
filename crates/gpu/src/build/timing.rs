//! Timing of build stages.

use canted_lbvh::{Bits, Strategy};

use super::stages::{Grids, codes_and_counts, domain, sort_counted, tree};
use super::volumes::{aabbs, obbs};
use super::{BuildEncoder, Primitives, STRATEGIES, StageTime};
use crate::{Gpu, GpuError};

/// Milliseconds per stage, measured as described at [`StageTime`]. `None` for a stage that does not fit into the device memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Passes {
    /// Grids of the Morton codes.
    pub domain: Option<f64>,
    /// Morton codes.
    pub codes: Option<f64>,
    /// Sorting of the codes.
    pub sort: Option<f64>,
    /// Topology.
    pub tree: Option<f64>,
    /// Volumes by strategy, in the order of [`STRATEGIES`]. Oriented boxes exclude the axis-aligned boxes that they also need.
    pub boxes: [Option<f64>; STRATEGIES.len()],
    /// The first error, if any.
    pub error: Option<GpuError>,
}

impl Passes {
    /// The fastest of `runs` builds, after one warm-up build in which drivers compile.
    ///
    /// # Errors
    /// The device is lost.
    pub async fn measure(gpu: &Gpu, primitives: &Primitives, bits: Bits, runs: usize) -> Result<Self, GpuError> {
        let first = Self::once(gpu, primitives, bits).await?;
        let mut least: Option<Self> = None;
        for _ in 0..runs {
            let run = Self::once(gpu, primitives, bits).await?;
            least = Some(least.map_or_else(|| run.clone(), |least| least.least(&run)));
        }
        Ok(least.unwrap_or(first))
    }

    /// Total time of a build with this strategy; `None` if it is not one of [`STRATEGIES`] or a stage is missing.
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
            error: self.error.clone().or_else(|| other.error.clone()),
        }
    }

    /// One build, as far as it fits into the device memory.
    async fn once(gpu: &Gpu, primitives: &Primitives, bits: Bits) -> Result<Self, GpuError> {
        let mut passes = Self::default();
        match passes.fill(gpu, primitives, bits).await {
            Err(error @ (GpuError::Limit { .. } | GpuError::OutOfMemory { .. })) => {
                passes.error = Some(error);
                Ok(passes)
            }
            other => other.map(|()| passes),
        }
    }

    async fn fill(&mut self, gpu: &Gpu, primitives: &Primitives, bits: Bits) -> Result<(), GpuError> {
        let mut build = BuildEncoder::timed(gpu);
        let domains = domain(&mut build, primitives, bits)?;
        self.domain = Some(taken(&build, &["domain"]));
        let (input, beside) = codes_and_counts(&mut build, primitives, Grids::Given(&domains), bits)?;
        self.codes = Some(taken(&build, &["codes"]));
        let sorted = sort_counted(&mut build, primitives, &input, beside)?;
        self.sort = Some(taken(&build, &["sort"]));
        let trees = tree(&mut build, primitives, &sorted.codes)?;
        self.tree = Some(taken(&build, &["tree"]));
        let axis_aligned = aabbs(&mut build, primitives, &sorted.leaves, &trees)?;
        self.boxes[0] = Some(taken(&build, &["aabb"]));
        for (boxes, strategy) in self.boxes.iter_mut().zip(STRATEGIES).skip(1) {
            let mut build = BuildEncoder::timed(gpu);
            obbs(&mut build, primitives, &sorted.leaves, &trees, &axis_aligned, strategy)?;
            *boxes = Some(taken(&build, &["levels", "obb"]));
        }
        Ok(())
    }
}

/// Total milliseconds of some stages.
fn taken(build: &BuildEncoder<'_>, stages: &[&str]) -> f64 {
    let of_these = |time: &&StageTime| stages.contains(&time.stage);
    build.times().iter().filter(of_these).map(|time| time.milliseconds).sum()
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn totals_include_all_stages_of_a_build() {
        let boxes = [16.0, 32.0, 64.0, 128.0, 256.0, 512.0].map(Some);
        let [domain, codes, sort, tree] = [1.0, 2.0, 4.0, 8.0].map(Some);
        let passes = Passes { domain, codes, sort, tree, boxes, error: None };
        assert_eq!(passes.total(Strategy::Aabb), Some(31.0));
        assert_eq!(passes.total(Strategy::Dop), Some(31.0 + 512.0));
        assert_eq!(passes.total(Strategy::PcaUnbounded), Some(31.0 + 32.0));
        let faster = Passes { sort: Some(3.0), boxes: [Some(17.0); 6], ..passes.clone() };
        let least = passes.least(&faster);
        assert_eq!((least.sort, least.boxes), (Some(3.0), [16.0, 17.0, 17.0, 17.0, 17.0, 17.0].map(Some)));
        let incomplete = Passes { boxes: [Some(16.0), None, None, None, None, None], ..passes.clone() };
        assert_eq!((incomplete.total(Strategy::Aabb), incomplete.total(Strategy::Dop)), (Some(31.0), None));
        assert_eq!(passes.least(&incomplete).boxes, incomplete.boxes);
    }
}
