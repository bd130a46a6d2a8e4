use canted_trace::lanes::{SQRT_3, UNIT_ROUNDOFF as U, reciprocal};
use canted_trace::{MIN_DIRECTION, ScaledRay};

use crate::simd::Simd;

/// By how much a ray is thickened against boxes, in units of the space, or relative to `|o|∞ + ρ∞`; derived at `traverse`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pads {
    /// Against boxes along the coordinate axes.
    pub(crate) aligned: f32,
    /// Along the axes of a turned mesh frame.
    pub(crate) turned: f32,
    /// Against boxes with frames of their own.
    pub(crate) lean: f32,
}

impl Pads {
    /// Relative pads for hits that lie within `error·(|o|∞ + ρ∞)` of what the boxes bound, in each coordinate.
    pub(crate) const fn of(error: f32) -> Self {
        Self { aligned: error + 6.0 * U, turned: SQRT_3 * (error + 9.0 * U), lean: SQRT_3 * (error + 14.0 * U) }
    }

    /// Relative pads in units of the space, for a ray among boxes whose coordinates do not exceed `reach`.
    #[inline(always)]
    pub(crate) fn along(self, ray: &ScaledRay, reach: f32) -> Self {
        let [x, y, z] = ray.origin.map(f32::abs);
        let scale = x.max(y).max(z) + reach;
        let pad = |relative: f32| relative * scale + f32::MIN_POSITIVE;
        Self { aligned: pad(self.aligned), turned: pad(self.turned), lean: pad(self.lean) }
    }

    /// Pads in units of the space for hits within `error` of what the boxes bound, in those units.
    ///
    /// The way to the hit is longer by the error, so roundings are relative to `S + e` in place of `S`.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the step upward covers the rounding")]
    pub(crate) fn within(error: f64, ray: &ScaledRay, reach: f32) -> Self {
        let [x, y, z] = ray.origin.map(f32::abs);
        let scale = f64::from(x.max(y).max(z)) + f64::from(reach) + error;
        let Self { aligned, turned, lean } = const { Self::of(0.0) };
        let pad = |roundings: f32, stretch: f32| {
            ((f64::from(stretch) * error + f64::from(roundings) * scale) as f32).next_up() + f32::MIN_POSITIVE
        };
        Self { aligned: pad(aligned, 1.0), turned: pad(turned, SQRT_3), lean: pad(lean, SQRT_3) }
    }
}

/// The frame that box nodes stand in: rows across their planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeshFrame {
    pub(crate) rows: [[f32; 3]; 3],
    pub(crate) is_identity: bool,
}

impl MeshFrame {
    /// The axes as they are.
    pub(crate) const IDENTITY: Self = Self { rows: canted_obb::Obb::IDENTITY_FRAME, is_identity: true };

    pub(crate) fn new(rows: [[f32; 3]; 3]) -> Self {
        Self { rows, is_identity: rows == canted_obb::Obb::IDENTITY_FRAME }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the one rounding that the pad is for")]
    fn turned(&self, v: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = v.map(f64::from);
        self.rows.map(|row| {
            let [a, b, c] = row.map(f64::from);
            (a * x + b * y + c * z) as f32
        })
    }
}

/// A ray as the node tests want it: every number in all lanes, ready in memory.
#[derive(Clone, Copy)]
pub(crate) struct RayLanes<S: Simd> {
    /// Reciprocals of the direction in the mesh's frame.
    pub(crate) recip: [S::F; 3],
    /// `o⁺·r` (`o⁻·r` for negative directions): taken off the near planes' products.
    pub(crate) near: [S::F; 3],
    /// The same for far planes.
    pub(crate) far: [S::F; 3],
    /// Whether the near plane of an axis is the upper one.
    pub(crate) flipped: [bool; 3],
    pub(crate) t_min: S::F,
    /// Origin and direction in object space.
    pub(crate) origin: [S::F; 3],
    pub(crate) direction: [S::F; 3],
    pub(crate) pad_lean: S::F,
    pub(crate) min_direction: S::F,
    pub(crate) one: S::F,
}

impl<S: Simd> RayLanes<S> {
    /// The lanes of `ray`, thickened by `pads` in units of the space.
    #[inline(always)]
    pub(crate) fn new(simd: S, ray: &ScaledRay, frame: &MeshFrame, pads: &Pads) -> Self {
        let (origin, direction, pad) = if frame.is_identity {
            (ray.origin, ray.direction, pads.aligned)
        } else {
            (frame.turned(ray.origin), frame.turned(ray.direction), pads.turned)
        };
        let recip = direction.map(reciprocal);
        let flipped = recip.map(|r| r < 0.0);
        // Against a negative direction the near plane is the upper one, met from the lowered origin.
        let (mut near, mut far) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            let toward = pad.copysign(recip[k]);
            near[k] = (origin[k] + toward) * recip[k];
            far[k] = (origin[k] - toward) * recip[k];
        }
        Self {
            recip: splat3(simd, recip),
            near: splat3(simd, near),
            far: splat3(simd, far),
            flipped,
            // Adding zero makes -0.0 positive: entries are ordered by their bits.
            t_min: simd.splat(ray.t_min + 0.0),
            origin: splat3(simd, ray.origin),
            direction: splat3(simd, ray.direction),
            pad_lean: simd.splat(pads.lean),
            min_direction: simd.splat(MIN_DIRECTION),
            one: simd.splat(1.0),
        }
    }
}

/// Three numbers, each in all lanes.
#[inline(always)]
pub(super) fn splat3<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [S::F; 3] {
    [simd.splat(x), simd.splat(y), simd.splat(z)]
}
