//! Parts of a round cubic curve in the frame of a ray: the line of the ray is the third axis.
//!
//! The ball at the parameter `u` has the center `(p(u), z(u))`, with `p` in the plane across the line, and the radius `r(u)`. The line passes through it
//! where `q(u) = |p|² - r² <= 0`, from `z - w` to `z + w` with `w² = -q`. So the line enters a part at the least `z - w`, and leaves it at the
//! greatest `z + w`.

use canted_obb::vector::{Vector, sqrt, sub};

use crate::round_segment::span;
use crate::rounding::nearest;

/// Control balls of a part: the center in the frame of the ray, and the radius.
pub(crate) type Control = [[f64; 4]; 4];

// Four numbers at once, of a ball or of four balls. Written out, as calls within what a SIMD path inlines lose its instructions.

#[inline(always)]
fn add(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
fn difference(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

#[inline(always)]
fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}

#[inline(always)]
fn times(a: [f64; 4], x: f64) -> [f64; 4] {
    product(a, [x; 4])
}

/// Rows from columns.
#[inline(always)]
fn transposed([a, b, c, d]: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    [[a[0], b[0], c[0], d[0]], [a[1], b[1], c[1], d[1]], [a[2], b[2], c[2], d[2]], [a[3], b[3], c[3], d[3]]]
}

/// The lesser of two numbers that are not NaN: one instruction.
#[inline(always)]
fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN: one instruction.
#[inline(always)]
fn max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Where a line enters and leaves a part: the position along the line, and the parameter within the part.
pub(crate) type Ends = [(f64, f64); 2];

/// Three orthogonal vectors of equal length, the last of which has the direction of a ray. Coordinates and radii are in units of that length.
pub(crate) struct RayFrame {
    axes: [Vector; 3],
    /// The length of each.
    scale: f64,
    origin: [f32; 3],
    /// The position along the line at `t = 1`.
    pub(crate) length: f64,
    /// One over it.
    recip: f64,
}

impl RayFrame {
    /// The axes are those of Duff et al. 2017 times `|d|·(|d| + |z|)`, which needs no division. Their roundings are some 2^-52 of their length.
    #[inline(always)]
    pub(crate) fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let [x, y, z] = direction;
        let [x, y, z] = [f64::from(x), f64::from(y), f64::from(z)];
        let length = sqrt(x * x + y * y + z * z);
        let sign = if z < 0.0 { -1.0 } else { 1.0 };
        let along = length + z.abs();
        let scale = length * along;
        let axes = [
            [scale - x * x, -x * y, -sign * x * along],
            [-sign * x * y, sign * (scale - y * y), -y * along],
            [x * along, y * along, z * along],
        ];
        let length = scale * length;
        Self { axes, scale, origin, length, recip: 1.0 / length }
    }

    /// The `t` of a position along the line.
    #[inline(always)]
    pub(crate) fn t(&self, z: f64) -> f32 {
        nearest(z * self.recip)
    }

    /// A control ball in this frame.
    #[inline(always)]
    pub(crate) fn ball(&self, center: [f32; 3], radius: f32) -> [f64; 4] {
        self.balls(&[center; 4], &[radius; 4])[0]
    }

    /// Four control balls in this frame.
    #[inline(always)]
    pub(crate) fn balls(&self, [a, b, c, d]: &[[f32; 3]; 4], &[r0, r1, r2, r3]: &[f32; 4]) -> Control {
        let from_origin = |k: usize| {
            let origin = f64::from(self.origin[k]);
            let [a, b, c, d] = [f64::from(a[k]), f64::from(b[k]), f64::from(c[k]), f64::from(d[k])];
            difference([a, b, c, d], [origin; 4])
        };
        let (x, y, z) = (from_origin(0), from_origin(1), from_origin(2));
        let along = |axis: Vector| add(add(times(x, axis[0]), times(y, axis[1])), times(z, axis[2]));
        let radii = [f64::from(r0), f64::from(r1), f64::from(r2), f64::from(r3)];
        transposed(&[along(self.axes[0]), along(self.axes[1]), along(self.axes[2]), times(radii, self.scale)])
    }
}

/// Bounds of derivatives of a curve. Those of its halves are quarters of the second ones, and halves of the first.
#[derive(Clone, Copy)]
pub(crate) struct Bends {
    /// At least the length of second derivatives of the center across the line.
    across: f64,
    /// Along the line.
    along: f64,
    /// Of the radius.
    radius: f64,
    /// At least the first derivative of the radius.
    slope: f64,
}

impl Bends {
    /// Those of a curve, whose derivatives are in the hulls of their own control values.
    #[inline(always)]
    pub(crate) fn new(part: &Control) -> Self {
        let ([ab, bc, cd], [a, b]) = differences(part);
        let (p, q) = (product(a, a), product(b, b));
        Self {
            across: 6.0 * sqrt(max(p[0] + p[1], q[0] + q[1])),
            along: 6.0 * max(a[2].abs(), b[2].abs()),
            radius: 6.0 * max(a[3].abs(), b[3].abs()),
            slope: 3.0 * max(max(ab[3].abs(), bc[3].abs()), cd[3].abs()),
        }
    }

    /// Those of the parts after so many halvings.
    pub(crate) fn of_parts(&self, n_halvings: u32) -> Self {
        let first = 1.0 / f64::from(1_u32 << n_halvings);
        let second = first * first;
        let Self { across, along, radius, slope } = self;
        Self { across: second * across, along: second * along, radius: second * radius, slope: first * slope }
    }

    /// How far the curve is from its chord, and its radius from the linear one, at most: an eighth of the second derivatives.
    pub(crate) fn deviation(&self) -> f64 {
        0.125 * (self.across + self.along + self.radius)
    }
}

/// The first and second differences of control balls.
#[inline(always)]
fn differences(&[a, b, c, d]: &Control) -> ([[f64; 4]; 3], [[f64; 4]; 2]) {
    let (ab, bc, cd) = (difference(b, a), difference(c, b), difference(d, c));
    ([ab, bc, cd], [difference(bc, ab), difference(cd, bc)])
}

/// De Casteljau's halves.
#[inline]
pub(crate) fn halves(&[a, b, c, d]: &Control) -> [Control; 2] {
    let mid = |a: [f64; 4], b: [f64; 4]| times(add(a, b), 0.5);
    let [ab, bc, cd] = [mid(a, b), mid(b, c), mid(c, d)];
    let [abc, bcd] = [mid(ab, bc), mid(bc, cd)];
    let middle = mid(abc, bcd);
    [[a, ab, abc, middle], [middle, bcd, cd, d]]
}

/// What a line may meet of a part.
pub(crate) enum Meeting {
    /// The line passes the part.
    None,
    /// The balls that the line meets are those of one interval of parameters; see [`SinglePart`].
    Single(SinglePart),
    /// Anything.
    Any,
}

/// A part of which the line meets the balls of one interval of parameters, if any, where `z - w` is convex and `z + w` is concave.
pub(crate) struct SinglePart {
    /// The coefficients of the powers of the parameter.
    powers: Control,
    /// About the parameters of the entry and of the exit.
    starts: [f64; 2],
    /// About the position between both.
    middle: f64,
    /// The chord across the line.
    chord: [f64; 2],
    /// Its square.
    chord_squared: f64,
    /// The greatest control value of the radius.
    radius: f64,
    /// At most half of the second derivative of `q` minus `radius·|z''|` wherever that counts; see [`meeting`].
    convexity: f64,
}

/// Decides whether a line meets a part, and whether in one interval of parameters.
///
/// # Method
/// Let `x` be the coordinate of `p` along the part's chord across the line, `y` the one across, `X` the least control value of `x'`, positive, and `Y` the
/// greatest of `|y'|`, at most `X/2`. Let `R` be the greatest radius, `B` and `S` bounds of the second and first derivative of `r`, and `C` and `Z` those of `|p''|` and
/// `|z''|`. Let `u` be a parameter with `|x| <= R`, and let the line meet the ball at `v`, so `|p(v)| <= R`. As `x` is monotone, `|x| <= R` between both,
/// and `|y| <= R + 2R·Y/X <= 2R`, so `|p| <= sqrt(5)·R` there. So
///
/// `q''/2 = |p'|² + p·p'' - r'² - r·r'' >= X² - S² - R·(sqrt(5)·C + B)`.
///
/// Where this exceeds `R·Z`, which is at least `w·|z''|`, `q` is convex, so the line meets all balls between two that it meets, and
/// `(z - w)'' = z'' + q''/(2w) + q'²/(4w³)` is positive. The difference is [`SinglePart::convexity`]. It must be
/// a fifth of `X²`, so that the search for the least value ends soon. `x` and `y` are scaled by the length of the chord here.
///
/// The line passes the part where all points of the curve are on one side, by more than the radius: across the chord by Bernstein polynomials, of which
/// the inner two have a sum of at most 3/4, or along it.
#[inline(always)]
pub(crate) fn meeting(part: &Control, bends: &Bends) -> Meeting {
    let [x, y, _, radii] = transposed(part);
    let chord = [x[3] - x[0], y[3] - y[0]];
    let chord_squared = chord[0] * chord[0] + chord[1] * chord[1];
    let radius = max(max(radii[0], radii[1]), max(radii[2], radii[3]));
    let reach = radius * radius * chord_squared;
    let across = difference(times(y, chord[0]), times(x, chord[1]));
    let at = add(times(x, chord[0]), times(y, chord[1]));
    let offset = across[0];
    let bulges = [across[1] - offset, across[2] - offset];
    let low = offset + 0.75 * min(min(bulges[0], bulges[1]), 0.0);
    let high = offset + 0.75 * max(max(bulges[0], bulges[1]), 0.0);
    // How far all is on one side, at least.
    let aside = max(max(low, -high), 0.0);
    let (first, last) = (min(min(at[0], at[1]), min(at[2], at[3])), max(max(at[0], at[1]), max(at[2], at[3])));
    let beyond = max(max(first, -last), 0.0);
    if max(aside * aside, beyond * beyond) > reach {
        return Meeting::None;
    }

    let least = 3.0 * min(min(at[1] - at[0], at[2] - at[1]), at[3] - at[2]);
    // The last is the negative of the second, as the chord has no extent across itself.
    let most = 3.0 * max(max(bulges[0].abs(), (bulges[1] - bulges[0]).abs()), bulges[1].abs());
    let [a, .., d] = part;
    let size = |p: &[f64; 4]| p[0].abs() + p[1].abs() + p[2].abs();
    let rounding = ROUNDINGS * (size(a) + size(d));
    let bend =
        bends.slope * bends.slope + radius * (2.25 * bends.across + bends.along + bends.radius) + rounding * rounding;
    if !(least > 0.0 && 2.0 * most <= least && least * least > 1.25 * chord_squared * bend) {
        return Meeting::Any;
    }
    let recip = 1.0 / chord_squared;
    let convexity = least * least * recip - bend;
    let ([ab, ..], [abc, bcd]) = differences(part);
    let powers = [*a, times(ab, 3.0), times(abc, 3.0), difference(bcd, abc)];

    // About where the curve is nearest to the line: one step from where the chord is. Coordinates are along and across the chord, which has the length 1.
    let u = min(max(-at[0] * recip, 0.0), 1.0);
    let v = 1.0 - u;
    // How far the inner control values are from those of the chord.
    let [leads, bulges] = [
        [(at[1] - at[0]) * recip - 1.0 / 3.0, (at[2] - at[0]) * recip - 2.0 / 3.0],
        [bulges[0] * recip, bulges[1] * recip],
    ];
    // Bernstein polynomials and their derivatives.
    let (both, rates) = (3.0 * u * v, [3.0 * v * (1.0 - 3.0 * u), 3.0 * u * (2.0 - 3.0 * u)]);
    let along = at[0] * recip + u + both * (v * leads[0] + u * leads[1]);
    let aside = offset * recip + both * (v * bulges[0] + u * bulges[1]);
    let along_rate = 1.0 + rates[0] * leads[0] + rates[1] * leads[1];
    let aside_rate = rates[0] * bulges[0] + rates[1] * bulges[1];
    let step = along * along_rate + aside * aside_rate;
    let (u, aside) = (u - step, (aside - step * aside_rate) * chord_squared);
    // Where the cone of the chord is entered, moved there.
    let slope = d[2] - a[2];
    let depth = max(reach - aside * aside, 0.0);
    let shift = slope * recip * sqrt(1.0 / (chord_squared + slope * slope)) * sqrt(depth);
    Meeting::Single(SinglePart {
        powers,
        chord,
        chord_squared,
        radius,
        convexity,
        starts: [u - shift, u + shift],
        middle: a[2] + u * slope,
    })
}

/// A speed across the line below this part of the coordinates may come from roundings.
const ROUNDINGS: f64 = 1.0 / (1_u64 << 36) as f64;

/// The search ends within this part of the distance from the ray's origin.
const TOLERANCE: f64 = 1.0 / (1_u64 << 30) as f64;

/// Steps by the local cone. Later ones halve the interval.
const CONE_STEPS: u32 = 8;

/// Enough for the interval to end at the roundings of a parameter.
const MAX_STEPS: u32 = CONE_STEPS + 56;

impl SinglePart {
    /// Where the line enters the part; `None` for a miss. An entry outside of the interval need not be exact, nor one beyond it found.
    #[inline(always)]
    pub(crate) fn entry(&self, limits: [f64; 2]) -> Option<(f64, f64)> {
        self.least(1.0, self.starts[0], limits)
    }

    /// Whether the line probably leaves the part before this position.
    #[inline(always)]
    pub(crate) fn is_before(&self, z: f64) -> bool {
        self.middle < z
    }

    /// Where the line leaves the part. An exit outside of the interval need not be exact, nor one before it found.
    #[inline(always)]
    pub(crate) fn exit(&self, [low, high]: [f64; 2]) -> Option<(f64, f64)> {
        self.least(-1.0, self.starts[1], [-high, -low]).map(|(z, u)| (-z, u))
    }

    /// Both, exact.
    pub(crate) fn ends(&self) -> Option<Ends> {
        let everything = [f64::NEG_INFINITY, f64::INFINITY];
        Some([self.entry(everything)?, self.exit(everything)?])
    }

    /// The least `sign·z - w` and its parameter. Any value below `low` will do, and none above `high` is needed.
    ///
    /// # Method
    /// A bracket contains the parameter: where the line meets the ball at `u`, the sign of the derivative decides the side, elsewhere that of `q'`
    /// or, where `|x|` exceeds the radius, that of `x`. The next parameter is the one that is best for
    /// `q + 2g·δ + h·δ²` and linear `z`, which is exact for a cone, with `g = q'/2` and `h = q''/2`.
    ///
    /// # Error
    /// With a second derivative of at least `m/R`, where `m` is the convexity, a value exceeds the least one by at most `(z - w)'²·R/(2m)`: the search ends
    /// where this is below [`TOLERANCE`] of the position. Likewise `q` exceeds its least value by at most `g²/m`, so the line passes a part where `q`
    /// exceeds that, and where `|p|` exceeds `sqrt(5)·R` while `|x| <= R`. Roundings are those of f64, relative to the distance from the ray's origin.
    #[inline(always)]
    fn least(&self, sign: f64, start: f64, [enough, limit]: [f64; 2]) -> Option<(f64, f64)> {
        let Self { powers: [c0, c1, c2, c3], chord, chord_squared, radius, convexity, .. } = self;
        let (slope_powers, bend_power) = (times(*c3, 3.0), times(*c2, 2.0));
        let (mut low, mut high, mut u) = (-1.0, 2.0, min(max(start, 0.0), 1.0));
        let mut best = None;
        for step in 0..MAX_STEPS {
            let value = add(times(add(times(add(times(*c3, u), *c2), u), *c1), u), *c0);
            let bend = times(slope_powers, u);
            let first = add(times(add(bend, bend_power), u), *c1);
            let second = add(add(bend, bend), bend_power);
            // Products of the centers less that of the radii.
            let form = |a: [f64; 4]| a[0] + a[1] - a[3];
            let (q, g) = (form(product(value, value)), form(product(value, first)));
            let h = form(add(product(first, first), product(value, second)));
            let (z, slope) = (sign * value[2], sign * first[2]);
            let (is_before, mut next);
            let along = chord[0] * value[0] + chord[1] * value[1];
            if q <= 0.0 {
                let w = sqrt(-q);
                // The derivative times `w`.
                let rate = slope * w + g;
                best = Some((z - w, u));
                let tolerance = TOLERANCE * (z.abs() + radius);
                // By how much the value exceeds the least one, times this.
                let (gap, scale) = (rate * rate * radius, -2.0 * convexity * q);
                if gap < (z - w - tolerance - limit) * scale {
                    return None;
                }
                if gap <= tolerance * scale
                    || z - w + tolerance < enough
                    || (u == 0.0 && rate >= 0.0)
                    || (u == 1.0 && rate <= 0.0)
                {
                    return best;
                }
                is_before = rate > 0.0;
                next = u - (g + slope * sqrt((g * g - q * h) / (h + slope * slope))) / h;
            } else {
                let is_beside = along * along <= radius * radius * chord_squared;
                if is_beside {
                    if value[0] * value[0] + value[1] * value[1] > 5.0 * radius * radius || q * convexity > g * g {
                        return None;
                    }
                    is_before = g > 0.0;
                    let depth = max(g * g - q * h, 0.0);
                    next = u - (g + slope * sqrt(depth / (h + slope * slope))) / h;
                } else {
                    is_before = along > 0.0;
                    next = u - along / (chord[0] * first[0] + chord[1] * first[1]);
                }
                if (u == 0.0 && is_before) || (u == 1.0 && !is_before) {
                    return best;
                }
            }
            if is_before {
                high = u
            } else {
                low = u
            }
            next = min(max(next, 0.0), 1.0);
            if step >= CONE_STEPS || !(low < next && next < high) {
                next = 0.5 * (max(low, 0.0) + min(high, 1.0));
            }
            if next == u {
                break;
            }
            u = next;
        }
        best
    }
}

/// Where the line enters and leaves the round segment of a part's ends.
pub(crate) fn segment_ends(part: &Control) -> Option<Ends> {
    let [p0, .., p1] = part;
    let [a, b] = [p0, p1].map(|[x, y, z, _]| [*x, *y, *z]);
    span([-a[0], -a[1], -a[2]], [0.0, 0.0, 1.0], sub(b, a), [p0[3], p1[3]], f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in 0..1 (SplitMix64).
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut x = state;
            x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((x ^ x >> 31) >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    const EVERYTHING: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    /// Parts of many forms near the line, in its frame.
    fn parts(n: usize) -> impl Iterator<Item = Control> {
        let mut random = random(5);
        (0..n).map(move |i| {
            let radius = [0.3, 0.02, 1e-3, 1.0][i % 4];
            let change = [0.0, 0.1, 1.0][i / 4 % 3];
            let bend = [0.02, 0.1, 0.5, 0.0, 2.0][i / 12 % 5];
            let steepness = [0.2, 1.0, 8.0][i / 60 % 3];
            let mut number = || 2.0 * random() - 1.0;
            // Along a chord that passes the line about as far away as the radius.
            let aside = 1.5 * radius * number();
            let at = 0.5 + 0.6 * number();
            core::array::from_fn(|i| {
                let s = i as f64 / 3.0 - at;
                let [x, y, z] = [s, aside, 7.0 + steepness * s].map(|x| x + bend * number());
                [x, y, z, radius * (1.0 + change * number()).max(0.0)]
            })
        })
    }

    /// The least `sign·z - w` over balls that the line meets, by many parameters and then by smaller steps around the best of these.
    fn least_of_balls(part: &Control, sign: f64) -> Option<(f64, f64)> {
        let value = |u: f64| {
            let v = 1.0 - u;
            let weights = [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u];
            let [x, y, z, r]: [f64; 4] = core::array::from_fn(|k| (0..4).map(|i| weights[i] * part[i][k]).sum());
            let squared = r * r - x * x - y * y;
            (squared >= 0.0).then(|| sign * z - sqrt(squared))
        };
        let best_of = |low: f64, high: f64| {
            let at = |i: i32| (low + (high - low) * f64::from(i) / 400.0).clamp(0.0, 1.0);
            let found = (0..=400).filter_map(|i| Some((value(at(i))?, at(i))));
            found.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut best = best_of(0.0, 1.0)?;
        let mut step = 1.0 / 400.0;
        for _ in 0..6 {
            best = best_of(best.1 - step, best.1 + step)?;
            step /= 100.0;
        }
        Some(best)
    }

    /// By how much the axes of a frame differ from orthogonal ones of its scale, of which the last has the direction, relative to that.
    fn error_of(frame: &RayFrame, direction: [f32; 3]) -> f64 {
        let dot = |a: Vector, b: Vector| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let [a, b, c] = frame.axes.map(|axis| axis.map(|x| x / frame.scale));
        let d = direction.map(f64::from);
        let length = sqrt(dot(d, d));
        let third = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let of_position = frame.length / (frame.scale * length) - 1.0;
        let of_axes = [dot(a, b), dot(a, c), dot(b, c), dot(a, a) - 1.0, dot(b, b) - 1.0, of_position];
        let of_third = (0..3).flat_map(|k| [third[k] - c[k], d[k] / length - c[k]]);
        of_axes.into_iter().chain(of_third).fold(0.0, |greatest, error| max(greatest, error.abs()))
    }

    #[test]
    fn frames_are_orthogonal_and_right_handed() {
        let mut random = random(8);
        let (mut n_wrong, mut n) = (0, 0);
        for i in 0..20_000 {
            // Also along axes, and almost so.
            let mut number = |k: usize| match i >> (2 * k) & 3 {
                0 => 0.0,
                1 => (1e-6 * (random() - 0.5)) as f32,
                _ => (2.0 * random() - 1.0) as f32,
            };
            let direction = [number(0), number(1), number(2)];
            if direction == [0.0; 3] {
                continue;
            }
            let frame = RayFrame::new([0.0; 3], direction);
            let error = error_of(&frame, direction);
            assert!(error < 16.0 / (1_u64 << 53) as f64, "{direction:?}: {error:e}");
            // Of a frame of another direction it is greater.
            let near = direction.map(|x| x.next_up());
            n_wrong += usize::from(error_of(&frame, near) > 1e-9);
            n += 1;
        }
        assert!(n > 15_000 && n_wrong > n / 2, "{n_wrong} of {n}");
    }

    /// The greatest error of the ends of single parts, relative to their size; lost hits; the number of single parts and of their hits.
    fn errors(bends: impl Fn(&Control) -> Bends, n: usize) -> (f64, usize, [usize; 2]) {
        let (mut greatest, mut n_lost, mut n_single, mut n_hits) = (0.0_f64, 0, 0, 0);
        for part in parts(n) {
            let Meeting::Single(single) = meeting(&part, &bends(&part)) else { continue };
            n_single += 1;
            for (sign, end) in [(1.0, single.entry(EVERYTHING)), (-1.0, single.exit(EVERYTHING))] {
                match (least_of_balls(&part, sign), end) {
                    (Some((want, _)), Some((z, u))) => {
                        n_hits += 1;
                        assert!((0.0..=1.0).contains(&u));
                        greatest = greatest.max((sign * z - want) / (z.abs() + 1.0));
                    }
                    (Some(_), None) => n_lost += 1,
                    // The balls of the oracle may all be beside a line that touches one between them.
                    (None, _) => (),
                }
            }
        }
        (greatest, n_lost, [n_single, n_hits])
    }

    #[test]
    fn ends_of_single_parts_are_those_of_their_balls() {
        let (error, n_lost, [n_single, n_hits]) = errors(Bends::new, 30_000);
        assert!(error < 2.0 * TOLERANCE && n_lost == 0, "off by {error:e}, {n_lost} lost");
        assert!(n_single > 7000 && n_hits > 8000, "{n_single} single parts, {n_hits} hits");
    }

    #[test]
    fn parts_that_bend_more_than_stated_have_other_ends() {
        let straight = |_: &Control| Bends { across: 0.0, along: 0.0, radius: 0.0, slope: 0.0 };
        let (error, n_lost, _) = errors(straight, 30_000);
        assert!(error > 1e-3 && n_lost > 0, "off by {error:e}, {n_lost} lost");
    }

    /// What a line passes has no ball that it meets.
    #[test]
    fn lines_pass_what_they_miss() {
        let (mut n_passed, mut n_missed) = (0, 0);
        for part in parts(30_000) {
            let meets = least_of_balls(&part, 1.0).is_some();
            n_missed += usize::from(!meets);
            if let Meeting::None = meeting(&part, &Bends::new(&part)) {
                n_passed += 1;
                assert!(!meets, "{part:?}");
            }
        }
        assert!(4 * n_passed > n_missed, "{n_passed} of {n_missed}");
    }

    /// Another interval hides an end but does not change it.
    #[test]
    fn ends_do_not_depend_on_the_interval() {
        let mut random = random(6);
        let mut n_hidden = 0;
        for part in parts(30_000) {
            let Meeting::Single(single) = meeting(&part, &Bends::new(&part)) else { continue };
            let Some([entry, exit]) = single.ends() else { continue };
            for _ in 0..4 {
                let near = if random() < 0.5 { entry.0 } else { exit.0 } + 1e-3 * (random() - 0.5);
                let [low, high] = if random() < 0.5 { [near, near + random()] } else { [near - random(), near] };
                let (found, found_exit) = (single.entry([low, high]), single.exit([low, high]));
                match found {
                    Some(found) if found.0 >= low => assert_eq!(found, entry),
                    Some(_) => assert!(entry.0 < low),
                    None => assert!(entry.0 > high),
                }
                match found_exit {
                    Some(found) if found.0 <= high => assert_eq!(found, exit),
                    Some(_) => assert!(exit.0 > high),
                    None => assert!(exit.0 < low),
                }
                n_hidden += usize::from(found.is_none() || found_exit.is_none());
            }
        }
        assert!(n_hidden > 1000, "{n_hidden}");
    }
}
