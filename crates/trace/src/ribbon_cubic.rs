//! A flat ribbon along a cubic curve that faces the ray; which points a ray hits is stated in `ribbon`.

use crate::ScaledRay;
use crate::cubic_part::{Control, RayFrame};
use crate::ribbon::{Across, Center, RibbonPoint, across, between, dot, hit_at, is_before_next};

/// A flat ribbon along a Bézier curve that faces every ray.
///
/// Which points a ray hits is stated at [`RibbonSegment`](crate::RibbonSegment); a ray may hit a cubic ribbon up to three times. A curve of
/// which the ray sees one point only is a disk at its start.
///
/// ```
/// use canted_trace::{Ray, RibbonCubic, ScaledRay};
///
/// let arch = [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [4.0, 2.0, 0.0], [4.0, 0.0, 0.0]];
/// let ribbon = RibbonCubic { points: arch, radii: [0.25; 4], next: arch[3] };
/// let ray = ScaledRay::new(&Ray::new([2.0, 1.5, 5.0], [0.0, 0.0, -1.0])).expect("a valid ray");
/// let hit = ribbon.point_scaled(&ray, f32::INFINITY).expect("the ray hits the middle");
/// assert_eq!((hit.t, hit.u, hit.v), (5.0, 0.5, 0.5));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RibbonCubic {
    /// Control points of the center line, in the space of the rays.
    pub points: [[f32; 3]; 4],
    /// Control values of half the width, at least 0.
    pub radii: [f32; 4],
    /// A point towards which the next ribbon leads from the last control point; that point itself where none follows.
    pub next: [f32; 3],
}

/// Half the derivative of the squared distance between line and curve, by its Bernstein coefficients: a polynomial of degree five.
type Slope = [f64; 6];

/// Most halvings. Two roots within 2^-20 of the parameter, a minimum and a maximum that cancel, need not be separated.
const MAX_DEPTH: u32 = 20;

/// Searches begin at least this part of an interval away from its ends.
const MARGIN: f64 = 1.0 / 16.0;

/// Newton's steps; later ones halve the interval.
const NEWTON_STEPS: u32 = 12;

/// Enough for the interval to end at the roundings of a parameter.
const MAX_STEPS: u32 = NEWTON_STEPS + 53;

/// Roots are searched up to this. A derivative is at most 9 times the extent of the curve (Markov), so `t` is off by less than 2^-44 of the extent, much
/// less than by its own rounding.
const TOLERANCE: f64 = 1.0 / (1_u64 << 48) as f64;

impl RibbonCubic {
    /// The first point in `ray.t_min..=t_max` at which the ray hits the ribbon.
    ///
    /// # Method
    /// In f64, in the frame of the ray. Minima of the distance are the roots at which the derivative of its square, a polynomial of degree five, rises
    /// through zero. Bernstein coefficients of one sign have no root between the ends, those with one change of sign have one
    /// (Descartes' rule); others are halved. A root is found by Newton's steps within an interval that contains it. Whatever the
    /// roundings of a root, the distance at the parameter that is reported is at most half the width there.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn point_scaled(&self, ray: &ScaledRay, t_max: f32) -> Option<RibbonPoint> {
        let frame = RayFrame::new(ray.origin, ray.direction);
        let whole = frame.balls(&self.points, &self.radii);
        if is_beside(&whole) {
            return None;
        }
        self.first(&whole, &frame, [ray.t_min, t_max])
    }

    /// The first hit of a ray that comes near the curve.
    #[inline(never)]
    fn first(&self, whole: &Control, frame: &RayFrame, [t_min, t_max]: [f32; 2]) -> Option<RibbonPoint> {
        let curve = Curve::new(whole);
        let mut first: Option<RibbonPoint> = None;
        let mut add = |center: &Center, tangent: Across, u: f64| {
            if let Some(hit) = hit_at(center, tangent, u, frame)
                && t_min <= hit.t
                && hit.t <= t_max
                && first.is_none_or(|first| hit.t < first.t)
            {
                first = Some(hit);
            }
        };
        let [a, b, c, d] = whole;
        let edges = [between(a, b), between(b, c), between(c, d)];
        if edges == [[0.0; 2]; 3] {
            add(a, [0.0; 2], 0.0);
            return first;
        }
        curve.minima(|u| {
            let (center, tangent, _) = curve.at(u);
            add(&center, tangent, u);
        });
        // Of edges without length, the one before counts.
        let ending = edges.into_iter().rev().find(|&edge| edge != [0.0; 2]).unwrap_or_default();
        if self.next != self.points[3] && dot(across(d), ending) < 0.0 {
            let next = between(d, &frame.ball(self.next, 0.0));
            if is_before_next(d, next) {
                add(d, ending, 1.0);
            }
        }
        first
    }
}

/// Whether the line passes all control points on one side, by more than the greatest radius: across the chord or along it.
#[inline(always)]
fn is_beside(part: &Control) -> bool {
    let [a, b, c, d] = part;
    let chord = between(a, d);
    let radius = a[3].max(b[3]).max(c[3]).max(d[3]);
    let reach = radius * radius * dot(chord, chord);
    let is_beyond = |[p, q, r, s]: [f64; 4]| {
        let (low, high) = (p.min(q).min(r).min(s), p.max(q).max(r).max(s));
        (low > 0.0 && low * low > reach) || (high < 0.0 && high * high > reach)
    };
    let aside = |p: &Center| chord[0] * p[1] - chord[1] * p[0];
    let along = |p: &Center| chord[0] * p[0] + chord[1] * p[1];
    is_beyond([aside(a), aside(b), aside(c), aside(d)]) || is_beyond([along(a), along(b), along(c), along(d)])
}

/// A curve in the frame of a ray.
struct Curve {
    /// Coefficients of the powers of the parameter.
    powers: Control,
    slope: Slope,
    /// Whether the curve has a direction at each end: where it has none, a root there is no minimum.
    leads: [bool; 2],
}

/// A part of the parameters, with the polynomial there.
#[derive(Clone, Copy)]
struct Part {
    slope: Slope,
    from: f64,
    level: u32,
}

impl Curve {
    fn new([a, b, c, d]: &Control) -> Self {
        let [i, j, k] = [between(a, b), between(b, c), between(c, d)];
        let [p, q, r, s] = [across(a), across(b), across(c), across(d)];
        let powers = [
            *a,
            [0, 1, 2, 3].map(|n| 3.0 * (b[n] - a[n])),
            [0, 1, 2, 3].map(|n| 3.0 * (a[n] - 2.0 * b[n] + c[n])),
            [0, 1, 2, 3].map(|n| d[n] - a[n] + 3.0 * (b[n] - c[n])),
        ];
        // The product of a cubic curve and a third of its derivative, of degree two.
        let slope = [
            dot(p, i),
            (2.0 * dot(p, j) + 3.0 * dot(q, i)) / 5.0,
            (dot(p, k) + 6.0 * dot(q, j) + 3.0 * dot(r, i)) / 10.0,
            (3.0 * dot(q, k) + 6.0 * dot(r, j) + dot(s, i)) / 10.0,
            (3.0 * dot(r, k) + 2.0 * dot(s, j)) / 5.0,
            dot(s, k),
        ];
        Self { powers, slope, leads: [i != [0.0; 2], k != [0.0; 2]] }
    }

    /// The center at a parameter, and the first and second derivative across the line.
    fn at(&self, u: f64) -> (Center, Across, Across) {
        let [c0, c1, c2, c3] = &self.powers;
        let center = [0, 1, 2, 3].map(|k| ((c3[k] * u + c2[k]) * u + c1[k]) * u + c0[k]);
        let first = [0, 1].map(|k| (3.0 * c3[k] * u + 2.0 * c2[k]) * u + c1[k]);
        let second = [0, 1].map(|k| 6.0 * c3[k] * u + 2.0 * c2[k]);
        (center, first, second)
    }

    /// Calls `visit` with each parameter at which the distance has a local minimum.
    fn minima(&self, mut visit: impl FnMut(f64)) {
        if self.leads[0] && self.slope[0] == 0.0 && first_sign(self.slope.iter()) > 0.0 {
            visit(0.0);
        }
        if self.leads[1] && self.slope[5] == 0.0 && first_sign(self.slope.iter().rev()) < 0.0 {
            visit(1.0);
        }
        let mut stack = [Part { slope: self.slope, from: 0.0, level: 0 }; MAX_DEPTH as usize + 1];
        let mut n_waiting = 1;
        while n_waiting > 0 {
            n_waiting -= 1;
            let Part { slope, from, level } = stack[n_waiting];
            let n_changes = changes(&slope);
            if n_changes == 0 {
                continue;
            }
            let size = 1.0 / f64::from(1_u32 << level);
            if n_changes == 1 || level == MAX_DEPTH {
                if first_sign(slope.iter()) < 0.0 && first_sign(slope.iter().rev()) > 0.0 {
                    visit(self.root(from, from + size, &slope));
                }
                continue;
            }
            let [low, high] = halves(&slope);
            let middle = from + 0.5 * size;
            // A root at the middle is in the interior of neither half.
            if low[5] == 0.0 && first_sign(low.iter().rev()) < 0.0 && first_sign(high.iter()) > 0.0 {
                visit(middle);
            }
            stack[n_waiting] = Part { slope: low, from, level: level + 1 };
            stack[n_waiting + 1] = Part { slope: high, from: middle, level: level + 1 };
            n_waiting += 2;
        }
    }

    /// The root in an interval at whose start the polynomial is negative, and at whose end it is positive.
    fn root(&self, mut low: f64, mut high: f64, slope: &Slope) -> f64 {
        // Not next to an end: a maximum may be there, but for roundings, where the sign of the polynomial is not known.
        let linear = slope[0] / (slope[0] - slope[5]);
        let guess = if slope[0] < slope[5] { linear.clamp(MARGIN, 1.0 - MARGIN) } else { 0.5 };
        let mut u = low + (high - low) * guess;
        for step in 0..MAX_STEPS {
            let (center, first, second) = self.at(u);
            let value = dot(across(&center), first);
            let derivative = dot(first, first) + dot(across(&center), second);
            let is_rising = derivative > 0.0;
            if high - low <= TOLERANCE || (value == 0.0 && is_rising) {
                break;
            }
            if value < 0.0 {
                low = u;
            } else {
                high = u;
            }
            let newton = u - value / derivative;
            let is_usable = step < NEWTON_STEPS && is_rising && low <= newton && newton <= high;
            let next = if is_usable { newton } else { 0.5 * (low + high) };
            if is_usable && (next - u).abs() <= TOLERANCE {
                return next;
            }
            u = next;
        }
        u
    }
}

/// The first coefficient that is not zero; zero where all are.
fn first_sign<'a>(coefficients: impl Iterator<Item = &'a f64>) -> f64 {
    coefficients.copied().find(|&x| x != 0.0).unwrap_or(0.0)
}

/// How often the sign of the coefficients changes, zeros skipped: the roots between the ends are as many, or fewer by an even number.
fn changes(slope: &Slope) -> u32 {
    let (mut n, mut last) = (0, 0.0);
    for &x in slope {
        if x != 0.0 {
            n += u32::from(last != 0.0 && (x < 0.0) != (last < 0.0));
            last = x;
        }
    }
    n
}

/// De Casteljau's halves, which share the value in the middle.
fn halves(slope: &Slope) -> [Slope; 2] {
    let (mut low, mut high, mut row) = ([0.0; 6], [0.0; 6], *slope);
    for level in 0..6 {
        low[level] = row[0];
        high[5 - level] = row[5 - level];
        for i in 0..5 - level {
            row[i] = 0.5 * (row[i] + row[i + 1]);
        }
    }
    [low, high]
}
