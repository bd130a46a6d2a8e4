//! Curves of every kind as kernels read them: `shared/curve` has the layout.

use bytemuck::{Pod, cast_slice, pod_collect_to_vec};
use canted_obb::Aabb;
use canted_trace::{BezierPatch, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment, Sphere};
use canted_wide::{Moves, Moving, RawBvh, SavedPrimitive, WideBvh};

use super::layout::Quad;
use super::leaf_triangles::LeafTriangle;

/// Which kernels a scene needs for its curves: what comes later tests all before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum CurveKernels {
    /// There are none.
    #[default]
    None,
    /// Round segments.
    Segments,
    /// Curves of any kind.
    Kinds,
    /// Curves of any kind, and patches.
    Patches,
}

/// Which curves the BVHs of a scene are over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct CurveKinds {
    pub(super) kernels: CurveKernels,
    /// Whether some have points that move.
    pub(super) moves: bool,
}

impl CurveKinds {
    pub(super) const SEGMENTS: Self = Self { kernels: CurveKernels::Segments, moves: false };

    /// Of two BVHs.
    pub(super) fn and(self, other: Self) -> Self {
        Self { kernels: self.kernels.max(other.kernels), moves: self.moves || other.moves }
    }

    pub(super) fn any(self) -> bool {
        self.kernels != CurveKernels::None
    }
}

/// Bits of a kind, as in `shared/curve`.
const CUBIC: u32 = 1;
const RIBBON: u32 = 2;
const MOVING: u32 = 4;
const SWEPT: u32 = 8;
const BALL: u32 = 16;

/// As in `shared/patch`.
const SHEET: u32 = 32;

/// What a device traces a BVH of, apart from triangles and round segments: spheres, round cubic curves, ribbons and patches, and these and segments with points and radii that move
/// ([`Moving`]).
pub trait DeviceCurve: SavedPrimitive + kind::Kind {}

impl<P: SavedPrimitive + kind::Kind> DeviceCurve for P {}

mod kind {
    /// The number of a kind.
    pub trait Kind {
        /// Bits of `shared/curve`.
        const KIND: u32;
    }
}

impl kind::Kind for Sphere {
    const KIND: u32 = SWEPT | BALL;
}

impl kind::Kind for RoundCubic {
    const KIND: u32 = SWEPT | CUBIC;
}

impl kind::Kind for RibbonSegment {
    const KIND: u32 = SWEPT | RIBBON;
}

impl kind::Kind for RibbonCubic {
    const KIND: u32 = SWEPT | RIBBON | CUBIC;
}

impl kind::Kind for BezierPatch {
    const KIND: u32 = SWEPT | SHEET;
}

impl kind::Kind for Moving<RoundSegment> {
    const KIND: u32 = SWEPT | MOVING;
}

/// A still curve of a kind that may move, apart from segments, whose still form is another.
trait MovingKind: kind::Kind + Moves {}

impl MovingKind for Sphere {}

impl MovingKind for RoundCubic {}

impl MovingKind for RibbonSegment {}

impl MovingKind for RibbonCubic {}

impl MovingKind for BezierPatch {}

impl<P: MovingKind> kind::Kind for Moving<P> {
    const KIND: u32 = P::KIND | MOVING;
}

/// A BVH of the CPU over curves of one kind.
#[derive(Clone, Copy)]
pub struct HostCurves<'a>(&'a dyn CurveBvh);

impl<'a, P: DeviceCurve> From<&'a WideBvh<P>> for HostCurves<'a> {
    fn from(bvh: &'a WideBvh<P>) -> Self {
        Self(bvh)
    }
}

impl<'a> HostCurves<'a> {
    pub(super) fn raw(self) -> RawBvh<'a> {
        self.0.raw_words()
    }

    pub(super) fn aabb(self) -> Aabb {
        self.0.bounds_object()
    }

    pub(super) fn kinds(self) -> CurveKinds {
        let kernels = if self.0.kind() & SHEET != 0 { CurveKernels::Patches } else { CurveKernels::Kinds };
        CurveKinds { kernels, moves: self.0.kind() & MOVING != 0 }
    }

    /// A place for each curve in the order of leaves, then the rows of all, with as many zeros as make places of them.
    pub(super) fn records(self, words: &RawBvh<'_>) -> Vec<LeafTriangle> {
        let rows = self.0.rows(words);
        let n = words.order.len();
        let n_rows = rows.len() / n.max(1);
        let place = |(i, id): (usize, &canted_obb::PrimId)| {
            let first = (3 * n + i * n_rows) as u32;
            [[0, 0, 0, id.0], [0, 0, 0, self.0.kind()], [0, 0, 0, first]]
        };
        let mut records: Vec<LeafTriangle> = words.order.iter().enumerate().map(place).collect();
        let chunk = |chunk: &[Quad]| std::array::from_fn(|k| chunk.get(k).copied().unwrap_or_default());
        records.extend(rows.chunks(3).map(chunk));
        records
    }
}

/// A BVH over curves of a kind that is not known here.
trait CurveBvh {
    fn raw_words(&self) -> RawBvh<'_>;
    fn bounds_object(&self) -> Aabb;
    fn kind(&self) -> u32;
    /// The rows of each curve, one after another in the order of leaves.
    fn rows(&self, words: &RawBvh<'_>) -> Vec<Quad>;
}

impl<P: DeviceCurve> CurveBvh for WideBvh<P> {
    fn raw_words(&self) -> RawBvh<'_> {
        self.raw()
    }

    fn bounds_object(&self) -> Aabb {
        self.aabb()
    }

    fn kind(&self) -> u32 {
        P::KIND
    }

    fn rows(&self, words: &RawBvh<'_>) -> Vec<Quad> {
        let primitives = self.primitives();
        let all: Vec<P::Data> = words.order.iter().map(|id| primitives[id.index()].to_data()).collect();
        quads(&all)
    }
}

/// The numbers of primitives, a whole number of quads each.
fn quads<T: Pod>(all: &[T]) -> Vec<Quad> {
    let words: &[u32] = cast_slice(all);
    pod_collect_to_vec(words)
}

#[cfg(test)]
mod tests {
    use canted_wide::Config;

    use super::*;

    #[test]
    fn rows_follow_the_places_that_name_them() {
        let curve = |x: f32| RibbonCubic {
            points: [0.0, 1.0, 2.0, 3.0].map(|y| [x, y, 0.5]),
            radii: [0.1, 0.2, 0.3, 0.4],
            next: [x, 4.0, 0.0],
        };
        let moving = |x: f32| Moving { open: curve(x), close: curve(x + 0.5) };
        let bvh = WideBvh::over_with((0..5_u8).map(|i| moving(f32::from(i))).collect(), Config::default()).unwrap();
        let curves = HostCurves::from(&bvh);
        let words = curves.raw();
        let records = curves.records(&words);
        let flat = records.as_flattened();
        for (i, id) in words.order.iter().enumerate() {
            let [[.., number], [.., kind], [.., first]] = records[i];
            assert_eq!((number, kind), (id.0, SWEPT | MOVING | RIBBON | CUBIC));
            let [open, close]: [[[f32; 4]; 5]; 2] = moving(id.0 as f32).to_data();
            let expected = [open, close].as_flattened().iter().map(|row| row.map(f32::to_bits)).collect::<Vec<_>>();
            assert_eq!(flat[first as usize..first as usize + 10], expected);
        }
        // Ten rows each, in places of three.
        assert_eq!(records.len(), 5 + 17);
        assert_eq!(curves.kinds(), CurveKinds { kernels: CurveKernels::Kinds, moves: true });
    }

    #[test]
    fn patches_have_twelve_rows() {
        let points = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| [i as f32, j as f32, 0.25]));
        let bvh = WideBvh::over(vec![BezierPatch { points }]).unwrap();
        let curves = HostCurves::from(&bvh);
        let records = curves.records(&curves.raw());
        let [[.., number], [.., kind], [.., first]] = records[0];
        assert_eq!((number, kind, first, records.len()), (0, SWEPT | SHEET, 3, 5));
        let numbers: Vec<f32> =
            records.as_flattened().as_flattened()[12..60].iter().map(|x| f32::from_bits(*x)).collect();
        assert_eq!(numbers, points.as_flattened().as_flattened());
        assert_eq!(curves.kinds(), CurveKinds { kernels: CurveKernels::Patches, moves: false });
    }
}
