//! A surface of two parameters, cubic in each.

use canted_obb::vector::{Vector, cross, to_f64, unit};

use crate::patch_part::{Crossing, MAX_LEVEL, Net};
use crate::rounding::nearest;
use crate::triangle::Axis;
use crate::{ScaledRay, Side};

/// A bicubic Bézier patch: a surface without thickness. Its front is the side from which `∂u × ∂v` points to the viewer.
///
/// ```
/// use canted_trace::{BezierPatch, Ray, ScaledRay, Side};
///
/// // A dome over the square from 0 to 3.
/// let height = |i: usize, j: usize| if (1..3).contains(&i) && (1..3).contains(&j) { 4.0 } else { 0.0 };
/// let points = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| [i as f32, j as f32, height(i, j)]));
/// let ray = ScaledRay::new(&Ray::new([1.5, 1.5, 5.0], [0.0, 0.0, -1.0])).expect("a valid ray");
/// let hit = BezierPatch { points }.first_scaled(&ray, f32::INFINITY).expect("the ray hits the top");
/// assert_eq!((hit.t, hit.u, hit.v, hit.side), (2.75, 0.5, 0.5, Side::Front));
/// ```
///
/// # Guarantee
/// Patches that share the four control points of an edge, in either order, are watertight there: a ray does not pass between them.
/// If each edge of a set of patches is shared by two of them, or is one point (a collapsed edge), a line has as many hits from the
/// front as from the back: exactly, whatever the roundings, at every scale and distance. The sum is that of all hits, those that
/// share a `t` included; see below.
///
/// What that means at silhouettes: two hits cancel, and both are missed, where seen along the ray the surface around them is in a
/// strip whose width is 2^-24 of the extent of the patch. A patch that the ray sees edge-on, flat patches in its plane included, is
/// not hit.
///
/// A patch may intersect itself, may be folded, and its control points may coincide. A ray hits it up to 18 times. Hits at the same
/// `t` are reported one rounding of `f32` apart, the sixth and later ones not at all.
///
/// # Error
/// Each coordinate of `o + t·d` is within 10·2^-24 of the greatest `|x - o|∞` over all control points `x`,
/// mostly within two: half a rounding of `t`, four roundings where hits share a `t`, and less than 2^-24 for the smallest parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BezierPatch {
    /// Control points, in the space of the rays: `points[i][j]` with `i` along `u` and `j` along `v`.
    pub points: [[[f32; 3]; 4]; 4],
}

/// Where a ray hits a [`BezierPatch`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchPoint {
    /// Distance in units of the direction.
    pub t: f32,
    /// First parameter of the patch, 0..=1.
    pub u: f32,
    /// Second parameter.
    pub v: f32,
    /// The side that is hit.
    pub side: Side,
}

/// Parts within a strip of this width, relative to the extent of the patch, are decided by their winding: 2^-24.
const THIN: f64 = 1.0 / (1 << 24) as f64;

/// How far Newton's steps may end from the line, relative to the extent of the patch.
const NEAR: f64 = 1.0 / (1 << 28) as f64;

/// Parts of this extent, relative to that of the patch, are a point.
const POINT: f64 = 1.0 / (1 << 28) as f64;

/// Hits that are kept: a line meets the surface 18 times at most, so others are due to roundings.
const MAX_HITS: usize = 24;

/// Roundings by which a hit is moved from those before it with the same `t`.
const MAX_MOVES: u32 = 4;

/// Hits farther before the interval than this part of `t` do not move those in it: 24 hits, each with [`MAX_MOVES`] roundings of 2^-23.
const BEFORE: f64 = 1.0 / (1 << 16) as f64;

/// A hit before its `t` is rounded.
#[derive(Clone, Copy)]
struct Found {
    along: f64,
    at: [f64; 2],
    is_counter_clockwise: bool,
}

impl Found {
    /// The order of hits, which does not depend on the order in which they are found.
    fn is_before(&self, other: &Self) -> bool {
        (self.along, self.at, self.is_counter_clockwise) < (other.along, other.at, other.is_counter_clockwise)
    }
}

/// A part of the patch.
#[derive(Clone, Copy)]
struct Part {
    net: Net,
    /// Where its parameters begin.
    from: [f64; 2],
    /// How often each parameter has been halved.
    levels: [u32; 2],
}

impl Part {
    /// Both halves along the parameter with the longer steps across the first axes, if it can be halved, else along the other.
    /// `None` for the smallest parts.
    fn halves(&self, n_axes: usize) -> Option<[Self; 2]> {
        let [of_u, of_v] = self.net.steps(n_axes);
        let k = usize::from(of_v > of_u);
        let k = if self.levels[k] < MAX_LEVEL { k } else { 1 - k };
        if self.levels[k] == MAX_LEVEL {
            return None;
        }
        let [low, high] = if k == 0 { self.net.halves_of_u() } else { self.net.halves_of_v() };
        let mut halves = [Self { net: low, ..*self }, Self { net: high, ..*self }];
        for half in &mut halves {
            half.levels[k] += 1;
        }
        halves[1].from[k] += halves[1].size(k);
        Some(halves)
    }

    /// The length of its interval of a parameter.
    fn size(&self, k: usize) -> f64 {
        1.0 / f64::from(1_u32 << self.levels[k])
    }

    /// Parameters of the patch.
    fn parameters(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.from[k] + self.size(k) * at[k])
    }
}

/// A ray through the parts of a patch.
struct Walk {
    /// Positions along the line that matter.
    limits: [f64; 2],
    t_min: f32,
    /// The extent of the patch in the frame of the ray.
    extent: f64,
    hits: [Found; MAX_HITS],
    n_hits: usize,
}

impl BezierPatch {
    /// The first hit in `ray.t_min..=t_max`.
    ///
    /// # Method
    /// All in f64, from differences of control points and origin, sheared so that the line is an axis. A part that the line passes
    /// on one side of its control points is skipped. In others the line is counted by the winding of the boundary: see
    /// `patch_part`. Parts that lines parallel to the ray pass at most once are solved by Newton's method, parts that are too thin
    /// to be seen are decided by the winding alone, all else is halved.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn first_scaled(&self, ray: &ScaledRay, t_max: f32) -> Option<PatchPoint> {
        let net = self.net(ray);
        if net.is_beside() {
            return None;
        }
        first(&net, ray, t_max)
    }

    /// The control points in the frame of the ray.
    #[inline(always)]
    fn net(&self, ray: &ScaledRay) -> Net {
        let [i_x, i_y, i_z] = Axis::from_greatest(ray.direction, f32::abs).indices();
        let d_z = f64::from(ray.direction[i_z]);
        let (s_x, s_y, per_z) = (f64::from(ray.direction[i_x]) / d_z, f64::from(ray.direction[i_y]) / d_z, 1.0 / d_z);
        let mut net = Net { axes: [[[0.0; 4]; 4]; 3] };
        for i in 0..4 {
            for j in 0..4 {
                let point = &self.points[i][j];
                let from_origin = |k: usize| f64::from(point[k]) - f64::from(ray.origin[k]);
                let z = from_origin(i_z);
                net.axes[0][i][j] = from_origin(i_x) - s_x * z;
                net.axes[1][i][j] = from_origin(i_y) - s_y * z;
                net.axes[2][i][j] = per_z * z;
            }
        }
        net
    }

    /// Position and derivatives by `u` and `v` at parameters in 0..=1.
    #[must_use]
    pub fn at(&self, [u, v]: [f64; 2]) -> [Vector; 3] {
        let weights = |s: f64| {
            let r = 1.0 - s;
            let value = [r * r * r, 3.0 * s * r * r, 3.0 * s * s * r, s * s * s];
            (value, [-3.0 * r * r, 3.0 * r * (1.0 - 3.0 * s), 3.0 * s * (2.0 - 3.0 * s), 3.0 * s * s])
        };
        let ((value_u, slope_u), (value_v, slope_v)) = (weights(u), weights(v));
        let mut all = [[0.0; 3]; 3];
        for i in 0..4 {
            for j in 0..4 {
                let point = to_f64(self.points[i][j]);
                let weights = [value_u[i] * value_v[j], slope_u[i] * value_v[j], value_u[i] * slope_v[j]];
                for (sum, weight) in all.iter_mut().zip(weights) {
                    for k in 0..3 {
                        sum[k] += weight * point[k];
                    }
                }
            }
        }
        all
    }

    /// The unit normal of the front at parameters in 0..=1. Where the surface has none, at a collapsed edge or a cusp, that a
    /// little nearer to the middle of the patch; `None` where it has none there either.
    #[must_use]
    pub fn normal(&self, at: [f64; 2]) -> Option<Vector> {
        // Each step to the middle is sixteen times as long as the one before, at first below the precision of parameters.
        (0..7).find_map(|step| {
            let share = if step == 0 { 0.0 } else { f64::from(1_u32 << (4 * (step - 1))) / f64::from(1 << 24) };
            let [_, by_u, by_v] = self.at(at.map(|x| x + share * (0.5 - x)));
            let normal = cross(by_u, by_v);
            let least = 1e-12 * longest(by_u) * longest(by_v);
            if longest(normal) > least { unit(normal) } else { None }
        })
    }
}

fn longest(v: Vector) -> f64 {
    v.into_iter().fold(0.0, |longest, x| longest.max(x.abs()))
}

/// The first hit of a ray that comes near the patch.
#[inline(never)]
fn first(net: &Net, ray: &ScaledRay, t_max: f32) -> Option<PatchPoint> {
    let extent = net.extent(3);
    // Control points that are not finite bound nothing.
    if !net.axes.as_flattened().as_flattened().iter().all(|x| x.is_finite()) || !extent.is_finite() {
        return None;
    }
    let [t_min, end] = [ray.t_min, t_max.next_up()].map(f64::from);
    let low = t_min - BEFORE * t_min - 256.0 * f64::from(f32::from_bits(1));
    let none = Found { along: 0.0, at: [0.0; 2], is_counter_clockwise: false };
    let mut walk = Walk { limits: [low, end], t_min: ray.t_min, extent, hits: [none; MAX_HITS], n_hits: 0 };
    walk.visit(&Part { net: *net, from: [0.0; 2], levels: [0; 2] });
    let runs_along = ray.direction[Axis::from_greatest(ray.direction, f32::abs).index()] > 0.0;
    let mut last = f32::NEG_INFINITY;
    for hit in &walk.hits[..walk.n_hits] {
        let own = nearest(hit.along);
        let t = if own > last { own } else { last.next_up() };
        if t > (0..MAX_MOVES).fold(own, |t, _| t.next_up()) {
            continue;
        }
        last = t;
        if t >= ray.t_min {
            // The third axis of the frame runs along the ray: a patch that is counter-clockwise there has its normal along the ray.
            let side = if hit.is_counter_clockwise == runs_along { Side::Back } else { Side::Front };
            return (t <= t_max).then(|| PatchPoint { t, u: hit.at[0] as f32, v: hit.at[1] as f32, side });
        }
    }
    None
}

impl Walk {
    /// Finds all hits in a part, nearer halves first.
    fn visit(&mut self, part: &Part) {
        if part.net.is_beside() {
            return;
        }
        let along = part.net.interval(2);
        if along[1] < self.limits[0] || along[0] > self.limits[1] {
            return;
        }
        if part.net.is_simple() {
            let winding = part.net.winding(part.levels);
            if winding == 0 {
                return;
            }
            if let Some(Crossing { at, along: position }) = part.net.crossing(NEAR * self.extent) {
                self.add(part.parameters(at), position.clamp(along[0], along[1]), winding);
                return;
            }
        } else if part.net.is_thin(THIN * self.extent) {
            self.locate(part);
            return;
        }
        let Some(mut halves) = part.halves(2) else {
            self.locate(part);
            return;
        };
        if halves[1].net.interval(2)[0] < halves[0].net.interval(2)[0] {
            halves.reverse();
        }
        halves.iter().for_each(|half| self.visit(half));
    }

    /// The hit of a part by its winding alone: in halves that have a winding, down to a point.
    #[inline(never)]
    fn locate(&mut self, part: &Part) {
        let winding = part.net.winding(part.levels);
        if winding == 0 {
            return;
        }
        let (mut part, mut rest) = (*part, winding);
        while part.net.extent(3) > POINT * self.extent
            && let Some([low, high]) = part.halves(3)
        {
            let of_low = low.net.winding(low.levels);
            // The numbers of both halves sum to that of the part, so one of them has its sign.
            (part, rest) = if of_low.signum() == rest.signum() { (low, of_low) } else { (high, rest - of_low) };
        }
        let [low, high] = part.net.interval(2);
        self.add(part.parameters([0.5; 2]), 0.5 * (low + high), winding);
    }

    /// Adds hits at a position, one for each time that the boundary winds around it.
    fn add(&mut self, at: [f64; 2], along: f64, winding: i32) {
        let found = Found { along, at, is_counter_clockwise: winding > 0 };
        // What comes after a hit in the interval is not the first.
        if nearest(along) >= self.t_min {
            self.limits[1] = self.limits[1].min(along);
        }
        for _ in 0..winding.unsigned_abs().min(MAX_MOVES + 1) {
            let place = self.hits[..self.n_hits].iter().take_while(|hit| !found.is_before(hit)).count();
            if place == MAX_HITS {
                return;
            }
            // Where there is no room left, the last one goes.
            self.n_hits = (self.n_hits + 1).min(MAX_HITS);
            self.hits.copy_within(place..self.n_hits - 1, place + 1);
            self.hits[place] = found;
        }
    }
}
