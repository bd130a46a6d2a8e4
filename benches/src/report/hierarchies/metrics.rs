//! Metrics of our binary BVHs without tracing, and counted tests of their rays.

use anyhow::Result;
use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{Corners, Costs, Tree, Volumes, in_leaf_order, tree_cost};
use canted_obb::Aabb;
use canted_trace::{Counts, InstanceId, Ray, Watertight};

use super::overlap::end_point_overlap;

/// Metrics of one BVH, NaN where unknown; lengths are in units of the scene's extent.
pub(super) struct Metrics {
    pub(super) sah: f64,
    pub(super) overlap: f64,
    pub(super) area: f64,
    pub(super) volume: f64,
    pub(super) boxes: f64,
    pub(super) triangles: f64,
}

/// The first metrics are known without tracing.
pub(super) const N_KNOWN: usize = 4;

/// Reads a metric.
type Read = fn(&Metrics) -> f64;

/// Names of the metrics, and how to read them.
pub(super) const METRICS: [(&str, Read); 7] = [
    ("SAH cost", |m| m.sah),
    ("end-point overlap", |m| m.overlap),
    ("area sum", |m| m.area),
    ("volume sum", |m| m.volume),
    ("box tests per ray", |m| m.boxes),
    ("triangle tests per ray", |m| m.triangles),
    ("tests per ray", |m| m.boxes + m.triangles),
];

/// Sampled triangles of the overlap.
const OVERLAP_TRIANGLES: usize = 4096;

impl Metrics {
    /// All metrics unknown.
    pub(super) const UNKNOWN: Self = Self {
        sah: f64::NAN,
        overlap: f64::NAN,
        area: f64::NAN,
        volume: f64::NAN,
        boxes: f64::NAN,
        triangles: f64::NAN,
    };

    /// The overlap is defined for BVHs that contain each triangle once, and NaN otherwise.
    #[expect(clippy::cast_precision_loss, reason = "counts of rays")]
    pub(super) fn of(tree: Tree, volumes: &Volumes, corners: &[Corners], bounds: &Aabb, rays: &[Ray]) -> Result<Self> {
        let sorted = in_leaf_order(corners, &tree.leaves);
        let unit = bounds.extent().into_iter().fold(f64::MIN_POSITIVE, f64::max);
        let sums = tree_cost(&tree, volumes, &sorted, &Costs::default(), unit);
        let stride = (corners.len() / OVERLAP_TRIANGLES).max(1);
        let is_split = sorted.len() > corners.len();
        let overlap = if is_split { f64::NAN } else { end_point_overlap(&tree, volumes, &sorted, stride) };
        let blas = Bvh2::<Watertight>::new(tree, volumes, sorted, bounds, PairOrder::DepthFirst);
        let mut counts = Counts::default();
        for ray in rays {
            blas.closest_hit_with(ray, InstanceId(0), &mut counts);
        }
        let each = |n: u64| n as f64 / rays.len() as f64;
        Ok(Self {
            sah: sums.sah,
            overlap,
            area: sums.area,
            volume: sums.volume,
            boxes: each(counts.boxes),
            triangles: each(counts.triangles),
        })
    }
}
