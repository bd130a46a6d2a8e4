use canted_obb::round::greatest;
use canted_trace::lanes::{SQRT_3, UNIT_ROUNDOFF as U};
use canted_trace::{MIN_DIRECTION, ReferencePoint, ScaledRay};

use crate::node::NodeKind;
use crate::simd::{Scalar, Simd};

/// Padding of box tests, relative to `|o|∞` on the side of the ray and to the reach of the content on that of the box, both from the
/// reference point; or the ray's part in units of the space. Derived in `traverse`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pads {
    /// In aligned nodes of the identity frame.
    pub(crate) aligned: f32,
    /// In aligned nodes of another frame.
    pub(crate) rotated: f32,
    /// In oriented nodes.
    pub(crate) oriented: f32,
}

impl Pads {
    /// Relative pads for hits that lie within `error·(|o|∞ + ρ∞)` of what the boxes bound, in each coordinate.
    pub(crate) const fn of(error: f32) -> Self {
        let error = error + ReferencePoint::ROUNDING;
        Self { aligned: error + 6.0 * U, rotated: SQRT_3 * (error + 9.0 * U), oriented: SQRT_3 * (error + 14.0 * U) }
    }

    /// The ray's part of relative pads, in units of the space; its origin is relative to the reference point.
    #[inline(always)]
    pub(crate) fn along(self, [x, y, z]: [f32; 3]) -> Self {
        let scale = greatest([x.abs(), y.abs(), z.abs()]);
        let pad = |relative: f32| relative * scale + f32::MIN_POSITIVE;
        Self { aligned: pad(self.aligned), rotated: pad(self.rotated), oriented: pad(self.oriented) }
    }

    /// Relative pads for hits that lie within `error·|o|∞` of what the boxes bound, with the origin relative to the reference point: those of
    /// [`Pads::within`] over `|o|∞`.
    ///
    /// The pad is `c·S` with `S = (1 + error)·|o|∞` for the roundings and `error·|o|∞` for the hit. This sum and its product with `|o|∞` have
    /// fewer than eight roundings of the part of the error; those of the other part are what pads have to spare.
    pub(crate) fn of_origin(error: f64) -> Self {
        let Self { aligned, rotated, oriented } = const { Self::of(0.0) };
        let pad = |roundings: f32, stretch: f32| {
            let (roundings, stretch) = (f64::from(roundings), f64::from(stretch));
            ((roundings * (1.0 + error) + stretch * error) * (1.0 + 8.0 * f64::from(U))) as f32
        };
        Self { aligned: pad(aligned, 1.0), rotated: pad(rotated, SQRT_3), oriented: pad(oriented, SQRT_3) }
    }

    /// The ray's part of the pads, in units of the space, for hits within `error` of what the boxes bound, in those units; its origin is
    /// relative to the reference point.
    ///
    /// The hit is farther by the error, so roundings are relative to `S + e` instead of `S`. Those here are fewer than eight of the part of
    /// the error, and those of the other part are what pads have to spare.
    #[inline(always)]
    pub(crate) fn within(error: f64, [x, y, z]: [f32; 3]) -> Self {
        let error = error as f32 * (1.0 + 8.0 * U);
        let scale = greatest([x.abs(), y.abs(), z.abs()]) + error;
        let Self { aligned, rotated, oriented } = const { Self::of(0.0) };
        let pad = |roundings: f32, stretch: f32| stretch * error + roundings * scale + f32::MIN_POSITIVE;
        Self { aligned: pad(aligned, 1.0), rotated: pad(rotated, SQRT_3), oriented: pad(oriented, SQRT_3) }
    }
}

/// The boxes' part of the padding: how far their planes move outward, relative to the reach of what is inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BoxPads {
    aligned: f64,
    oriented: f64,
}

impl BoxPads {
    /// For nodes in a mesh frame that is the identity or another.
    pub(crate) fn new(pads: Pads, is_identity: bool) -> Self {
        let aligned = if is_identity { pads.aligned } else { pads.rotated };
        Self { aligned: aligned.into(), oriented: pads.oriented.into() }
    }

    /// How far the planes of a box move in a node of this kind, if no coordinate of its content exceeds `reach`.
    #[inline]
    pub(crate) fn of(&self, kind: NodeKind, reach: f32) -> f64 {
        let relative = match kind {
            NodeKind::Aligned => self.aligned,
            NodeKind::Oriented => self.oriented,
        };
        relative * f64::from(reach)
    }
}

/// The coordinates that boxes are in: relative to a reference point, and for aligned nodes along rows across their planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeshFrame {
    pub(crate) rows: [[f32; 3]; 3],
    pub(crate) is_identity: bool,
    pub(crate) reference: ReferencePoint,
}

impl MeshFrame {
    pub(crate) fn new(rows: [[f32; 3]; 3], reference: ReferencePoint) -> Self {
        Self { rows, is_identity: rows == canted_obb::Obb::IDENTITY_FRAME, reference }
    }

    #[inline(always)]
    pub(crate) fn rotate(&self, v: [f32; 3]) -> [f32; 3] {
        [along(self.rows[0], v), along(self.rows[1], v), along(self.rows[2], v)]
    }
}

/// A coordinate along a row of the frame, computed in f64 and rounded once.
#[inline(always)]
fn along([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    (f64::from(a) * f64::from(x) + f64::from(b) * f64::from(y) + f64::from(c) * f64::from(z)) as f32
}

/// What node tests need of a ray.
#[derive(Clone, Copy)]
pub(crate) struct RayNumbers {
    /// Reciprocals of the direction in the mesh frame.
    pub(crate) recip: [f32; 3],
    /// `-o⁺·r` (`-o⁻·r` for negative directions): added to the near planes' products.
    pub(crate) near: [f32; 3],
    /// The same for far planes.
    pub(crate) far: [f32; 3],
    /// Where the near planes of an axis are: [`ROW`] for the upper ones, 0 for the lower.
    pub(crate) near_row: [usize; 3],
    pub(crate) t_min: f32,
    /// Origin, relative to the reference point, and direction in object space.
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    pub(crate) pad_oriented: f32,
}

impl RayNumbers {
    /// The numbers of `ray` from `moved`, its origin relative to the reference point, thickened by `pads` in units of the space. Axes are
    /// lanes.
    ///
    /// The origin is moved toward the near plane and away from the far one, so for a negative direction it is lowered for the near plane,
    /// which is the upper one.
    ///
    /// Not of a moved copy of the ray: what was just written number by number is not read as a whole before all of it has arrived.
    #[inline(always)]
    fn new<S: Simd>(simd: S, ray: &ScaledRay, moved: [f32; 3], frame: &MeshFrame, pads: &Pads) -> Self {
        let (origin, direction, pad) = if frame.is_identity {
            (moved, ray.direction, pads.aligned)
        } else {
            (frame.rotate(moved), frame.rotate(ray.direction), pads.rotated)
        };
        let (o, d) = (axes(simd, origin), axes(simd, direction));
        let (recip, toward) = reciprocal_and_toward(simd, d, simd.splat(pad));
        let [near, far] = moved_by(simd, o, toward, recip);
        let negative = simd.lt(recip, simd.splat(0.0));
        let near_row = [near_row(negative, 0), near_row(negative, 1), near_row(negative, 2)];
        let (recip, near, far) = (of_axes(simd, recip), of_axes(simd, near), of_axes(simd, far));
        let Pads { oriented: pad_oriented, .. } = *pads;
        let &ScaledRay { direction, t_min, .. } = ray;
        Self { recip, near, far, near_row, t_min, origin: moved, direction, pad_oriented }
    }

    /// The numbers of a ray with its part of these relative pads.
    #[inline(always)]
    pub(crate) fn relative<S: Simd>(simd: S, ray: &ScaledRay, frame: &MeshFrame, pads: Pads) -> Self {
        let moved = frame.reference.moved(ray.origin);
        Self::new(simd, ray, moved, frame, &pads.along(moved))
    }

    /// The numbers of a ray that enters boxes which lie within `error` of a hit, in units of the space.
    #[inline(always)]
    pub(crate) fn within<S: Simd>(simd: S, ray: &ScaledRay, frame: &MeshFrame, error: f64) -> Self {
        let moved = frame.reference.moved(ray.origin);
        Self::new(simd, ray, moved, frame, &Pads::within(error, moved))
    }
}

/// `1/d`, bounded, the same for both zeros; and how far the origin moves toward near planes.
#[inline(always)]
pub(super) fn reciprocal_and_toward<S: Simd>(simd: S, d: S::F, pad: S::F) -> (S::F, S::F) {
    // Adding zero makes -0.0 positive.
    let d = simd.add(d, simd.splat(0.0));
    let size = simd.max(simd.abs(d), simd.splat(MIN_DIRECTION));
    (simd.xor_sign(simd.div(simd.splat(1.0), size), d), simd.xor_sign(pad, d))
}

/// What is added to the products of near and of far planes. Negative, so that nothing is negated for each node.
#[inline(always)]
pub(super) fn moved_by<S: Simd>(simd: S, o: S::F, toward: S::F, recip: S::F) -> [S::F; 2] {
    let back = simd.xor_sign(recip, simd.splat(-1.0));
    [simd.mul(simd.add(o, toward), back), simd.mul(simd.sub(o, toward), back)]
}

/// A row of eight numbers in units of eight bytes, by which processors multiply an index without an instruction.
pub(super) const ROW: usize = 4;

/// Where near planes are, from the bits of negative directions: [`ROW`] if bit `i` is set, else 0.
#[inline(always)]
pub(super) fn near_row(negative: u32, i: usize) -> usize {
    ((negative * ROW as u32) >> i) as usize & ROW
}

/// A vector in the first three lanes; ones in the others.
#[inline(always)]
fn axes<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> S::F {
    simd.load(&[x, y, z, 1.0, 1.0, 1.0, 1.0, 1.0])
}

#[inline(always)]
fn of_axes<S: Simd>(simd: S, v: S::F) -> [f32; 3] {
    let [x, y, z, ..] = simd.store(v);
    [x, y, z]
}

/// A ray as the node tests use it: every number in all lanes.
#[derive(Clone, Copy)]
pub(crate) struct RayLanes<S: Simd> {
    pub(crate) recip: [S::F; 3],
    pub(crate) near: [S::F; 3],
    pub(crate) far: [S::F; 3],
    pub(crate) near_row: [usize; 3],
    pub(crate) t_min: S::F,
    pub(crate) origin: [S::F; 3],
    pub(crate) direction: [S::F; 3],
    pub(crate) pad_oriented: S::F,
    pub(crate) min_direction: S::F,
    pub(crate) one: S::F,
}

/// A ray that can be prepared for nodes, with its part of the pads.
///
/// Where the walk begins and not before: numbers that are read from memory early are kept in registers, which the walk needs, or taken apart from
/// vectors.
pub(crate) trait ThroughNodes: Copy {
    /// The ray, prepared.
    fn lanes<S: Simd>(self, simd: S) -> RayLanes<S>;
}

impl ThroughNodes for &RayNumbers {
    #[inline(always)]
    fn lanes<S: Simd>(self, simd: S) -> RayLanes<S> {
        RayLanes {
            recip: splat3(simd, self.recip),
            near: splat3(simd, self.near),
            far: splat3(simd, self.far),
            near_row: self.near_row,
            // Adding zero makes -0.0 positive: entries are ordered by their bits.
            t_min: simd.splat(self.t_min + 0.0),
            origin: splat3(simd, self.origin),
            direction: splat3(simd, self.direction),
            pad_oriented: simd.splat(self.pad_oriented),
            min_direction: simd.splat(MIN_DIRECTION),
            one: simd.splat(1.0),
        }
    }
}

/// A ray as traversal needs it: for leaves and for nodes.
#[derive(Clone, Copy)]
pub(crate) struct TracedRay {
    pub(crate) scaled: ScaledRay,
    pub(crate) numbers: RayNumbers,
}

impl TracedRay {
    /// A ray with its part of these relative pads.
    #[inline(always)]
    pub(crate) fn new(ray: &ScaledRay, frame: &MeshFrame, pads: Pads) -> Self {
        Self { scaled: *ray, numbers: RayNumbers::relative(Scalar, ray, frame, pads) }
    }

    /// A ray that enters boxes which lie within `error` of a hit, in units of the space.
    #[inline(always)]
    pub(crate) fn within(ray: &ScaledRay, frame: &MeshFrame, error: f64) -> Self {
        Self { scaled: *ray, numbers: RayNumbers::within(Scalar, ray, frame, error) }
    }
}

/// Three numbers, each in all lanes.
#[inline(always)]
pub(super) fn splat3<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [S::F; 3] {
    [simd.splat(x), simd.splat(y), simd.splat(z)]
}
