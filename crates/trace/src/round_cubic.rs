//! A cubic curve with a thickness: all points of the balls whose center and radius are cubic polynomials.

use canted_obb::vector::{Vector, dot, length, sqrt, sub, to_f64};

use crate::ScaledRay;
use crate::round_segment::{passes, size, span};
use crate::rounding::nearest;

/// A round cubic curve: the tube that a ball sweeps along a Bézier curve, with its ends. It is solid.
///
/// ```
/// use canted_trace::{Ray, RoundCubic, ScaledRay};
///
/// let arch = [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [4.0, 2.0, 0.0], [4.0, 0.0, 0.0]];
/// let curve = RoundCubic { points: arch, radii: [0.25; 4] };
/// let ray = ScaledRay::new(&Ray::new([2.0, 1.5, 5.0], [0.0, 0.0, -1.0])).expect("a valid ray");
/// let hit = curve.event_scaled(&ray, f32::INFINITY).expect("the ray passes through the middle");
/// assert_eq!((hit.t, hit.u, hit.is_entry), (4.75, 0.5, true));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundCubic {
    /// Control points, in the space of the rays; the curve begins at the first and ends at the last.
    pub points: [[f32; 3]; 4],
    /// Control values of the radius, at least 0.
    pub radii: [f32; 4],
}

/// Where a ray enters or leaves a [`RoundCubic`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Distance in units of the direction.
    pub t: f32,
    /// Parameter of the curve, 0..=1: of the ball that touches the surface there.
    pub u: f32,
    /// Whether the ray enters the curve.
    pub is_entry: bool,
}

/// The solid is made of round segments that deviate from the curve by at most this part of its size, 2.4e-7.
const TOLERANCE: f64 = 1.0 / (1 << 22) as f64;

/// Most halvings. Control values are at most some ten times as large as the curve, so more are not needed: `0.75·80·2^22 < 4^14`.
const MAX_DEPTH: u32 = 14;

/// Spans of a ray that are kept apart. A line enters the tube of a cubic at most a few times.
const MAX_SPANS: usize = 8;

/// A part of the curve: center and radius.
type Control = [[f64; 4]; 4];

impl RoundCubic {
    /// The first point in `ray.t_min..=t_max` at which the ray enters or leaves the curve.
    ///
    /// # Method
    /// The curve is halved until it deviates from its chord, and the radius from a linear one, by less than a part of 2^-22 of the size of the
    /// curve; the depth is known beforehand from its second differences (Wang 1984). Parts whose bounding ball the ray misses, or reaches after an entry that is known, are
    /// skipped. The others are [`RoundSegment`](crate::RoundSegment)s, of which neighbors share a ball, so there are no gaps. The union of
    /// their spans is the span of the solid. All in f64, relative to the ray's origin.
    #[doc(hidden)]
    #[must_use]
    pub fn event_scaled(&self, ray: &ScaledRay, t_max: f32) -> Option<CurvePoint> {
        let (origin, d) = (to_f64(ray.origin), to_f64(ray.direction));
        let whole: Control = core::array::from_fn(|i| {
            let [x, y, z] = sub(to_f64(self.points[i]), origin);
            [x, y, z, f64::from(self.radii[i])]
        });
        let (depth, bend) = halvings(&whole);
        let walk = Walk { d, depth, bend, interval: [f64::from(ray.t_min), f64::from(t_max)] };
        let mut spans = walk.spans(&whole, true);
        // Where the ray starts inside, entries into other parts are inside as well, and what comes after them counts.
        if spans.contain(walk.interval[0], walk.interval[0]) {
            spans = walk.spans(&whole, false);
        }
        spans.first_event(ray.t_min, t_max)
    }

    /// The four quarters of the curve, center and radius of their control balls in f64: their convex hull is tighter than that of the
    /// curve's own.
    #[doc(hidden)]
    #[must_use]
    pub fn quarters(&self) -> [[[f64; 4]; 4]; 4] {
        let whole = core::array::from_fn(|i| {
            let [x, y, z] = to_f64(self.points[i]);
            [x, y, z, f64::from(self.radii[i])]
        });
        let [a, b] = halves(&whole);
        let [[a, b], [c, d]] = [halves(&a), halves(&b)];
        [a, b, c, d]
    }

    /// Center and radius of the ball at a parameter in 0..=1, and the derivatives of both.
    #[doc(hidden)]
    #[must_use]
    pub fn ball(&self, u: f64) -> ([f64; 4], [f64; 4]) {
        let v = 1.0 - u;
        let value = |i: usize, k: usize| f64::from(if k == 3 { self.radii[i] } else { self.points[i][k] });
        let at = |k: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| value(i, k));
            v * v * v * a + 3.0 * u * v * (v * b + u * c) + u * u * u * d
        };
        let slope = |k: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| value(i, k));
            3.0 * (v * v * (b - a) + 2.0 * u * v * (c - b) + u * u * (d - c))
        };
        (core::array::from_fn(at), core::array::from_fn(slope))
    }
}

/// A ray through the parts of a curve.
struct Walk {
    /// Direction; parts are relative to the origin.
    d: Vector,
    depth: u32,
    /// The greatest length of a second difference of the control points.
    bend: f64,
    interval: [f64; 2],
}

impl Walk {
    /// The spans of the parts that overlap the interval; with `to_entry`, up to the first entry of any part.
    fn spans(&self, whole: &Control, to_entry: bool) -> Spans {
        let (d, [t_min, mut t_end]) = (self.d, self.interval);
        let mut spans = Spans { list: [Span::EMPTY; MAX_SPANS], n: 0 };
        let d_squared = dot(d, d);
        // Parts that wait, each with its interval, the number of its level and its place in it.
        let mut stack = [(*whole, [0.0; 2], 0_u32, 0_u32); MAX_DEPTH as usize + 1];
        let mut n_waiting = usize::from(interval(whole, self.bend, d, d_squared).is_some_and(|interval| {
            stack[0].1 = interval;
            true
        }));
        while n_waiting > 0 {
            n_waiting -= 1;
            let (part, [start, end], level, place) = stack[n_waiting];
            if end < t_min || start > t_end || spans.contain(start.max(t_min), end) {
                continue;
            }
            if level == self.depth {
                let [p0, .., p1] = part;
                let [a, b] = [p0, p1].map(|[x, y, z, _]| [x, y, z]);
                if let Some([entry, exit]) = span([-a[0], -a[1], -a[2]], d, sub(b, a), [p0[3], p1[3]]) {
                    let parameter = |u: f64| (f64::from(place) + u) / f64::from(1_u32 << self.depth);
                    spans.add(Span { ends: [entry, exit].map(|(t, u)| (t, parameter(u))) });
                    // What begins after an entry does not come before it.
                    if to_entry && entry.0 >= t_min {
                        t_end = t_end.min(entry.0);
                    }
                }
                continue;
            }
            let mut next = [0, 1].map(|half| (half, 2 * place + half as u32));
            // Those of a half are a quarter.
            let bend = self.bend / f64::from(1_u32 << (2 * level + 2));
            let both = halves(&part).map(|half| (half, interval(&half, bend, d, d_squared)));
            // The half that begins first is taken first.
            let begin = |half: usize| both[half].1.map_or(f64::INFINITY, |[start, _]| start);
            if begin(0) < begin(1) {
                next.reverse();
            }
            for (half, place) in next {
                if let (part, Some(interval)) = both[half] {
                    stack[n_waiting] = (part, interval, level + 1, place);
                    n_waiting += 1;
                }
            }
        }
        spans
    }
}

/// Halvings after which parts are as good as straight, and the greatest second difference, of the radii as well.
fn halvings(whole: &Control) -> (u32, f64) {
    let (mut size, mut bend) = (0.0_f64, 0.0_f64);
    // Of the curve, not of its control points: by balls at four parameters.
    let [a, b, c, d] = whole;
    for weights in [[8.0, 12.0, 6.0, 1.0], [1.0, 6.0, 12.0, 8.0], [0.0, 0.0, 0.0, 27.0]] {
        let at = |k: usize| (weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k] + weights[3] * d[k]) / 27.0;
        size = (0..3).fold(size.max(at(3)), |size, k| size.max((at(k) - a[k]).abs()));
    }
    size = size.max(a[3]);
    for i in 0..2 {
        let second: [f64; 4] = core::array::from_fn(|k| whole[i][k] - 2.0 * whole[i + 1][k] + whole[i + 2][k]);
        bend = bend.max(length([second[0], second[1], second[2]]) + second[3].abs());
    }
    let mut depth = 0;
    let mut deviation = 0.75 * bend;
    while deviation > TOLERANCE * size && depth < MAX_DEPTH {
        deviation *= 0.25;
        depth += 1;
    }
    (depth, bend)
}

/// De Casteljau's halves.
fn halves(part: &Control) -> [Control; 2] {
    let mid = |a: &[f64; 4], b: &[f64; 4]| -> [f64; 4] { core::array::from_fn(|k| 0.5 * (a[k] + b[k])) };
    let [a, b, c, d] = part;
    let [ab, bc, cd] = [mid(a, b), mid(b, c), mid(c, d)];
    let [abc, bcd] = [mid(&ab, &bc), mid(&bc, &cd)];
    let middle = mid(&abc, &bcd);
    [[*a, ab, abc, middle], [middle, bcd, cd, *d]]
}

/// The interval in which the ray passes through a ball around a part and its chord. `None` where it misses that, or the tube around the chord that contains the part.
///
/// The inner control points are within `bend`, the greatest length of a second difference, of the points at a third and two thirds of the chord, whose difference
/// is `(2·D0 + D1)/3` or `(D0 + 2·D1)/3` of both second differences.
fn interval(part: &Control, bend: f64, d: Vector, d_squared: f64) -> Option<[f64; 2]> {
    let [p0, p3] = [part[0], part[3]].map(|[x, y, z, _]| [x, y, z]);
    let chord = sub(p3, p0);
    let radius = part[1..].iter().fold(part[0][3], |radius, ball| radius.max(ball[3]));
    let center: Vector = core::array::from_fn(|k| 0.5 * (p0[k] + p3[k]));
    // Far more than the roundings of f64.
    let margin = 1e-12 * (bend + radius + size(p0) + size(p3));
    let around = bend + radius + margin;
    if passes(p0, d, chord, around) {
        return None;
    }
    let reach = 0.5 * length(chord) + around;
    let closest = dot(center, d) / d_squared;
    let off: Vector = core::array::from_fn(|k| center[k] - closest * d[k]);
    let squared = reach * reach - dot(off, off);
    let half = sqrt(squared.max(0.0) / d_squared);
    let margin = 1e-12 * (closest.abs() + half);
    (squared >= 0.0).then_some([closest - half - margin, closest + half + margin])
}

/// An interval of the ray inside of the curve: `t` and the parameter, at its start and at its end.
#[derive(Clone, Copy)]
struct Span {
    ends: [(f64, f64); 2],
}

impl Span {
    const EMPTY: Self = Self { ends: [(f64::INFINITY, 0.0), (f64::NEG_INFINITY, 0.0)] };

    /// Extends this span by one that overlaps it.
    fn join(&mut self, other: &Self) {
        if other.ends[0].0 < self.ends[0].0 {
            self.ends[0] = other.ends[0];
        }
        if other.ends[1].0 > self.ends[1].0 {
            self.ends[1] = other.ends[1];
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        other.ends[0].0 <= self.ends[1].0 && self.ends[0].0 <= other.ends[1].0
    }
}

/// Spans that do not overlap.
struct Spans {
    list: [Span; MAX_SPANS],
    n: usize,
}

impl Spans {
    /// Adds a span, and joins it with those that it overlaps. Where there is no room left, it is joined with the last.
    fn add(&mut self, mut span: Span) {
        let mut i = 0;
        while i < self.n {
            if self.list[i].overlaps(&span) {
                span.join(&self.list[i]);
                self.n -= 1;
                self.list[i] = self.list[self.n];
                // It may overlap those before now.
                i = 0;
            } else {
                i += 1;
            }
        }
        if self.n == MAX_SPANS {
            self.n -= 1;
            span.join(&self.list[self.n]);
        }
        self.list[self.n] = span;
        self.n += 1;
    }

    /// Whether an interval is within one span.
    fn contain(&self, start: f64, end: f64) -> bool {
        self.list[..self.n].iter().any(|span| span.ends[0].0 <= start && end <= span.ends[1].0)
    }

    /// The first end of a span in an interval.
    fn first_event(&self, t_min: f32, t_max: f32) -> Option<CurvePoint> {
        let ends = self.list[..self.n].iter().flat_map(|span| {
            let point = |(t, u): (f64, f64), is_entry| CurvePoint { t: nearest(t), u: u as f32, is_entry };
            [point(span.ends[0], true), point(span.ends[1], false)]
        });
        ends.filter(|end| t_min <= end.t && end.t <= t_max).min_by(|a, b| a.t.total_cmp(&b.t))
    }
}
