use crate::round::{U, magnitude_up};
use crate::vector::{self, Vector, cross};
use crate::{Aabb, Affine, Obb, frame};

/// Tightest box aligned with `frame` that contains every point of `points` *exactly*, as [`Obb::contains`] decides.
///
/// The frame may be skewed. A frame that is singular, or too close to singular for `f64`, is replaced by the identity.
/// No points give a box of extent zero at the origin. The points must be finite. [`Enclosure`] derives the error bound.
#[inline]
#[must_use]
pub fn bound(frame: [[f32; 3]; 3], points: impl IntoIterator<Item = impl Into<[f32; 3]>>) -> Obb {
    let mut points = points.into_iter();
    let mut enclosure = Enclosure::new(frame, points.next().map_or([0.0; 3], Into::into));
    enclosure.add_origin();
    for point in points {
        enclosure.add_point(point);
    }
    enclosure.finish()
}

/// Tightest box aligned with `frame` that contains every box of `boxes`, with their exact corners. Frames are
/// treated as in [`bound`].
#[inline]
#[must_use]
pub fn bound_boxes<'a>(frame: [[f32; 3]; 3], boxes: impl IntoIterator<Item = &'a Obb>) -> Obb {
    let mut boxes = boxes.into_iter().peekable();
    let origin = boxes.peek().map_or([0.0; 3], |first| first.center);
    let mut enclosure = Enclosure::new(frame, origin);
    for child in boxes {
        enclosure.add_box(child);
    }
    enclosure.finish()
}

/// Builds the tightest box along fixed axes that contains the points and boxes added to it.
///
/// # Derivation of the padding
///
/// With `R = frame⁻¹`, a point `p` has the coordinates `q = R·(p − o)`, `o` the origin given. Everything is computed in
/// `f64` (`u = 2⁻⁵³`) from the *rounded* `f32` frame, so the stored box differs from real arithmetic by these roundings
/// only:
///
/// - A cofactor is a difference of two products of `f32`, which `f64` holds exactly: one rounding. The determinant is
///   a sum of three further products: four roundings, relative to the sum `K·|det|` of its absolute terms. The
///   reciprocal and the last product add two. An entry of `R` has the relative error `(3 + 4K)u`; `K` is 1 for
///   rotations and does not change when rows or columns are scaled.
/// - A point's coordinate takes a difference, a product and two sums: `4u`. A box's support, `|R·side|` summed over
///   its three exact sides `axis · half`, takes `6u`, its sum with the center one more: `7u`.
/// - The half-extent takes a difference and the sum with the padding: `2u`.
/// - One more `u` covers the roundings of the padding itself.
///
/// So `q` errs by at most `t·ρ·D` with `t = (13 + 4K)u`, `ρ` the absolute sum of the row of `R`, and `D` the greatest
/// coordinate difference to `o` of content and center. `D` is not measured point by point:
/// `p − o = frame·q` bounds it by the extents found, up to a factor `1/(1 − t·κ)` with `κ = Σ ρ·|axis|∞`; frames
/// with `t·κ > 2⁻¹⁰` are rejected. This factor and the second-order terms are then below `1 + 2⁻⁸`, by which the
/// padding is multiplied. A single point has `D = 0`: its box is exact.
#[derive(Clone, Debug)]
pub struct Enclosure {
    frame: [[f32; 3]; 3],
    /// Columns of the inverse; the fourth lane is zero padding for SIMD.
    inverse: [[f64; 4]; 3],
    origin: Vector,
    low: [f64; 4],
    high: [f64; 4],
    /// Absolute error of the content's coordinates, zero for what is stored exactly.
    slack: f64,
    /// `t` of the derivation.
    relative_error: f64,
}

/// Bound on `t·κ`: keeps second-order terms below a thousandth of the padding.
const GREATEST_RELATIVE_ERROR: f64 = 1.0 / 1024.0;

/// Covers `1/(1 − t·κ)`, the products of errors and the rounding of `K`: three factors of about `1 + 2⁻¹⁰`.
const SECOND_ORDER: f64 = 1.0 + 1.0 / 256.0;

impl Enclosure {
    /// An empty enclosure aligned with `frame`. Coordinates are measured from `origin`; choose a point of the
    /// content.
    #[inline]
    #[must_use]
    pub fn new(frame: [[f32; 3]; 3], origin: impl Into<[f32; 3]>) -> Self {
        let (frame, inverse, relative_error) = match invert(frame) {
            Some((inverse, error)) => (frame, inverse, error),
            None => (frame::IDENTITY, IDENTITY_INVERSE, error_of_condition(1.0)),
        };
        Self {
            frame,
            inverse,
            origin: vector::to_f64(origin.into()),
            low: [f64::MAX; 4],
            high: [f64::MIN; 4],
            slack: 0.0,
            relative_error,
        }
    }

    /// Adds the origin given to [`Enclosure::new`].
    #[inline]
    pub(crate) fn add_origin(&mut self) {
        self.widen([0.0; 4], [0.0; 4]);
    }

    /// Adds a point.
    #[inline]
    pub fn add_point(&mut self, point: impl Into<[f32; 3]>) {
        let q = self.coordinates(vector::sub(vector::to_f64(point.into()), self.origin));
        self.widen(q, q);
    }

    /// Adds a box: its exact corners, not rounded ones.
    #[inline]
    pub fn add_box(&mut self, content: &Obb) {
        // A product of two f32 is exact in f64.
        let sides = core::array::from_fn(|a| {
            vector::scale(vector::to_f64(content.frame[a]), f64::from(content.half_extents[a]))
        });
        self.add_parallelepiped(vector::to_f64(content.center), sides, 0.0);
    }

    /// Adds an axis-aligned box; an empty box changes nothing.
    #[inline]
    pub fn add_aabb(&mut self, content: &Aabb) {
        if content.is_empty() {
            return;
        }
        let [x, y, z] = content.extent().map(|e| 0.5 * e);
        // Center and half-extent are each rounded once in f64, relative to at most the greatest coordinate.
        let slack = 2.0 * U * f64::from(content.reach());
        self.add_parallelepiped(content.center(), [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]], slack);
    }

    /// Adds all `center ± sides[0] ± sides[1] ± sides[2]`, known up to `slack` per coordinate.
    #[inline]
    pub(crate) fn add_parallelepiped(&mut self, center: Vector, sides: [Vector; 3], slack: f64) {
        let q = self.coordinates(vector::sub(center, self.origin));
        let [s, t, r] = sides.map(|side| self.coordinates(side));
        let support: [f64; 4] = core::array::from_fn(|k| s[k].abs() + t[k].abs() + r[k].abs());
        self.widen(core::array::from_fn(|k| q[k] - support[k]), core::array::from_fn(|k| q[k] + support[k]));
        self.slack = greatest(self.slack, slack);
    }

    /// The box of everything added; a point at the origin if nothing was.
    #[inline]
    #[must_use]
    pub fn finish(&self) -> Obb {
        if self.low[0] > self.high[0] {
            return Obb { center: vector::to_f32(self.origin), frame: self.frame, half_extents: [0.0; 3] };
        }
        let axes = self.frame.map(vector::to_f64);
        let mut shift = [0.0; 3];
        let mut content_reach = 0.0;
        for (k, &axis) in axes.iter().enumerate() {
            shift = vector::add(shift, vector::scale(axis, 0.5 * (self.low[k] + self.high[k])));
            content_reach += vector::reach(axis) * greatest(self.low[k].abs(), self.high[k].abs());
        }
        // Any center is valid, since the half-extents are measured from it as stored.
        let limit = f64::from(f32::MAX);
        let center = vector::to_f32(vector::add(self.origin, shift).map(|x| x.clamp(-limit, limit)));
        let offset = vector::sub(vector::to_f64(center), self.origin);
        let q = self.coordinates(offset);
        let error = SECOND_ORDER * (self.relative_error * (content_reach + vector::reach(offset)) + self.slack);
        let row = |k: usize| self.inverse[0][k].abs() + self.inverse[1][k].abs() + self.inverse[2][k].abs();
        let half: [f64; 3] =
            core::array::from_fn(|k| greatest(self.high[k] - q[k], q[k] - self.low[k]) + row(k) * error);
        in_range(center, self.frame, half)
    }

    #[inline]
    fn widen(&mut self, low: [f64; 4], high: [f64; 4]) {
        self.low = core::array::from_fn(|k| least(self.low[k], low[k]));
        self.high = core::array::from_fn(|k| greatest(self.high[k], high[k]));
    }

    /// `inverse · difference`, the fourth lane zero.
    #[inline]
    fn coordinates(&self, difference: Vector) -> [f64; 4] {
        let [x, y, z] = &self.inverse;
        core::array::from_fn(|k| x[k] * difference[0] + y[k] * difference[1] + z[k] * difference[2])
    }
}

impl Obb {
    /// A box that contains the exact image of this one; its axes are the images of the axes, skewed where the map
    /// shears.
    ///
    /// The axes have lengths between one and four. An axis that the map flattens to a point is replaced by one
    /// perpendicular to the others. Where the map makes the axes dependent, the axis-aligned box of the image is returned.
    #[must_use]
    pub fn transformed(&self, to_from_self: &Affine) -> Self {
        let center = to_from_self.point_f64(vector::to_f64(self.center));
        let directions = self.frame.map(|axis| to_from_self.vector_f64(vector::to_f64(axis)));
        let sides: [Vector; 3] =
            core::array::from_fn(|a| vector::scale(directions[a], f64::from(self.half_extents[a])));
        // Products of two f32 are exact in f64. A coordinate of the center then takes three roundings, one of a side
        // two and a third for its half-extent, each relative to the sum of absolute terms; the fourth unit covers the
        // sum itself.
        let reach: Vector = core::array::from_fn(|k| {
            let sides = (0..3).map(|a| f64::from(self.frame[a][k].abs()) * f64::from(self.half_extents[a]));
            f64::from(self.center[k].abs()) + sides.sum::<f64>()
        });
        let magnitude: Vector = core::array::from_fn(|k| {
            let linear = (0..3).map(|j| f64::from(to_from_self.columns[j][k].abs()) * reach[j]);
            f64::from(to_from_self.columns[3][k].abs()) + linear.sum::<f64>()
        });
        let limit = f64::from(f32::MAX);
        let origin = vector::to_f32(center.map(|x| x.clamp(-limit, limit)));
        let mut enclosure = Enclosure::new(frame::complete(directions), origin);
        enclosure.add_parallelepiped(center, sides, 4.0 * U * vector::reach(magnitude));
        enclosure.finish()
    }

    /// A box with these axes that contains every point that is within `distance` of a point of this one in each coordinate.
    ///
    /// Axes too close to dependent are replaced by those of the coordinates.
    #[must_use]
    pub fn grown(&self, distance: f64) -> Self {
        let mut enclosure = Enclosure::new(self.frame, self.center);
        let sides = core::array::from_fn(|a| {
            // A product of two f32 is exact in f64.
            vector::scale(vector::to_f64(self.frame[a]), f64::from(self.half_extents[a]))
        });
        enclosure.add_parallelepiped(vector::to_f64(self.center), sides, distance);
        enclosure.finish()
    }
}

/// The box with its half-extents rounded up. A half-extent beyond the range of `f32` is halved and its axis doubled.
#[inline]
fn in_range(center: [f32; 3], mut frame: [[f32; 3]; 3], mut half: [f64; 3]) -> Obb {
    for (axis, half) in frame.iter_mut().zip(&mut half) {
        while *half > f64::from(f32::MAX) {
            *half *= 0.5;
            *axis = axis.map(|x| 2.0 * x);
        }
    }
    Obb { center, frame, half_extents: half.map(magnitude_up) }
}

const IDENTITY_INVERSE: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// `t` of the derivation for a determinant whose absolute terms sum to `k` times its value.
#[inline]
fn error_of_condition(k: f64) -> f64 {
    (13.0 + 4.0 * k) * U
}

/// Columns of the inverse, and `t`; `None` for a frame too close to singular.
///
/// Cofactors cost about as much as a test for orthonormality, and are exact for every frame.
#[inline]
fn invert(frame: [[f32; 3]; 3]) -> Option<([[f64; 4]; 3], f64)> {
    let [x, y, z] = frame.map(vector::to_f64);
    let cofactors = [cross(y, z), cross(z, x), cross(x, y)];
    let terms = [x[0] * cofactors[0][0], x[1] * cofactors[0][1], x[2] * cofactors[0][2]];
    let reciprocal = 1.0 / (terms[0] + terms[1] + terms[2]);
    let inverse: [[f64; 4]; 3] = core::array::from_fn(|j| {
        [cofactors[0][j] * reciprocal, cofactors[1][j] * reciprocal, cofactors[2][j] * reciprocal, 0.0]
    });
    let error = error_of_condition((terms[0].abs() + terms[1].abs() + terms[2].abs()) * reciprocal.abs());
    let condition: f64 = [x, y, z]
        .iter()
        .enumerate()
        .map(|(k, &axis)| vector::reach(axis) * (inverse[0][k].abs() + inverse[1][k].abs() + inverse[2][k].abs()))
        .sum();
    // Also false for NaN.
    (error * condition <= GREATEST_RELATIVE_ERROR).then_some((inverse, error))
}

/// The minimum in one machine instruction: unlike `f64::min`, without NaN handling.
#[inline]
fn least(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The maximum, as [`least`].
#[inline]
fn greatest(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}
