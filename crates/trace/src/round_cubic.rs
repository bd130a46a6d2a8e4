//! A cubic curve with a thickness: all points of the balls whose center and radius are cubic polynomials.

use canted_obb::vector::sqrt;

use crate::ScaledRay;
use crate::cubic_part::{Bends, Control, Ends, Meeting, RayFrame, halves, meeting, segment_ends};

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

/// Round segments that replace parts deviate from them by at most this part of the size of the curve, 2.4e-7,
const TOLERANCE: f64 = 1.0 / (1 << 22) as f64;

/// or by this part of the distance from the ray's origin: that of a rounding of `t`.
const DISTANT: f64 = 1.0 / (1 << 24) as f64;

/// Most halvings. Control values are at most some ten times as large as the curve, so more are not needed: `0.75·80·2^22 < 4^14`.
const MAX_DEPTH: u32 = 14;

/// Spans of a ray that are kept apart. A line enters the tube of a cubic at most a few times.
const MAX_SPANS: usize = 8;

impl RoundCubic {
    /// The first point in `ray.t_min..=t_max` at which the ray enters or leaves the curve.
    ///
    /// # Method
    /// All in f64, in the frame of the ray. Of most curves the line meets the balls of one interval of parameters, where its entries into balls are
    /// a convex function: its least value, found by a few steps with a proven error, is the entry into the curve. Others are
    /// halved; parts that the ray passes, or reaches after an entry that is known, are
    /// skipped. What deviates from its chord, and in its radius from a linear one, by less than a part of 2^-22 of the size of the
    /// curve, or 2^-24 of the distance of the ray's origin, is a [`RoundSegment`](crate::RoundSegment); the depth is known beforehand from the second derivatives (Wang 1984).
    /// Neighbors share a ball, so there are no gaps. The union of the spans of all parts is the span of the solid.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn event_scaled(&self, ray: &ScaledRay, t_max: f32) -> Option<CurvePoint> {
        let frame = RayFrame::new(ray.origin, ray.direction);
        let whole = frame.balls(&self.points, &self.radii);
        let bends = Bends::new(&whole);
        let point = |(z, u): (f64, f64), is_entry| CurvePoint { t: frame.t(z), u: u as f32, is_entry };
        let is_within = |point: &CurvePoint| ray.t_min <= point.t && point.t <= t_max;
        match meeting(&whole, &bends) {
            Meeting::None => None,
            Meeting::Single(part) => {
                let limits = limits([ray.t_min, t_max], frame.length);
                // A part that the ray leaves before it starts needs no entry.
                let exit = if part.is_before(limits[0]) { Some(part.exit(limits)?) } else { None };
                let entry = point(part.entry(limits)?, true);
                if entry.t >= ray.t_min {
                    return Some(entry).filter(is_within);
                }
                let exit = match exit {
                    Some(exit) => exit,
                    None => part.exit(limits)?,
                };
                Some(point(exit, false)).filter(is_within)
            }
            Meeting::Any => {
                let limits = limits([ray.t_min, t_max], frame.length);
                first_event(&whole, bends, limits, &frame, [ray.t_min, t_max])
            }
        }
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

/// The first event of a curve that a line may meet in several intervals of parameters.
#[inline(never)]
fn first_event(
    whole: &Control,
    bends: Bends,
    limits: [f64; 2],
    frame: &RayFrame,
    [t_min, t_max]: [f32; 2],
) -> Option<CurvePoint> {
    let walk = Walk { bends, depth: halvings(whole, &bends), limits };
    let mut spans = walk.spans(whole, true);
    let at = |z: f64| frame.t(z);
    // Where the ray starts inside, entries into other parts are inside as well, and what comes after them counts.
    if spans.all().any(|[entry, exit]| at(entry.0) < t_min && t_min <= at(exit.0)) {
        spans = walk.spans(whole, false);
    }
    let events = spans.all().flat_map(|[entry, exit]| [(entry, true), (exit, false)]);
    let within = events.filter(|&((z, _), _)| (t_min..=t_max).contains(&at(z)));
    // By the position, of which others may round to the same `t`.
    let ((z, u), is_entry) = within.min_by(|((a, _), _), ((b, _), _)| a.total_cmp(b))?;
    Some(CurvePoint { t: at(z), u: u as f32, is_entry })
}

/// A part that the walk has not reached.
#[derive(Clone, Copy)]
struct Waiting {
    part: Control,
    /// Where the line may meet it.
    extent: [f64; 2],
    /// The number of halvings.
    level: u32,
    /// Its number among the parts of its level.
    place: u32,
}

/// A ray through the parts of a curve.
struct Walk {
    bends: Bends,
    depth: u32,
    /// See [`limits`].
    limits: [f64; 2],
}

/// Positions that round to a `t` outside of the interval are outside of these.
#[inline]
fn limits([t_min, t_max]: [f32; 2], length: f64) -> [f64; 2] {
    let [low, high] = [t_min.next_down(), t_max.next_up()].map(|t| f64::from(t) * length);
    [low - MARGIN * low.abs(), high + MARGIN * high.abs()]
}

impl Walk {
    /// The spans of the parts that overlap the interval; with `to_entry`, up to the first entry of any part.
    fn spans(&self, whole: &Control, to_entry: bool) -> Spans {
        let [low, mut high] = self.limits;
        let mut spans = Spans { list: [Spans::EMPTY; MAX_SPANS], n: 0 };
        let Some(first) = extent(whole) else { return spans };
        let mut stack = [Waiting { part: *whole, extent: first, level: 0, place: 0 }; MAX_DEPTH as usize + 1];
        let mut n_waiting = 1;
        while n_waiting > 0 {
            n_waiting -= 1;
            let Waiting { part, extent: [start, end], level, place } = stack[n_waiting];
            if end < low || start > high || spans.contain(start.max(low), end) {
                continue;
            }
            let ends = match meeting(&part, &self.bends.of_parts(level)) {
                Meeting::None => continue,
                Meeting::Single(part) => part.ends(),
                Meeting::Any if level == self.depth => segment_ends(&part),
                Meeting::Any => {
                    let [a, b] = halves(&part);
                    let waiting = |part: Control, place: u32| {
                        Some(Waiting { part, extent: extent(&part)?, level: level + 1, place })
                    };
                    let mut both = [waiting(a, 2 * place), waiting(b, 2 * place + 1)];
                    // The half that begins first is taken first.
                    if let [Some(a), Some(b)] = &both
                        && a.extent[0] < b.extent[0]
                    {
                        both.reverse();
                    }
                    for half in both.into_iter().flatten() {
                        stack[n_waiting] = half;
                        n_waiting += 1;
                    }
                    continue;
                }
            };
            if let Some([entry, exit]) = ends {
                let parameter = |u: f64| (f64::from(place) + u) / f64::from(1_u32 << level);
                spans.add([entry, exit].map(|(z, u)| (z, parameter(u))));
                // What begins after an entry does not come before it.
                if to_entry && entry.0 >= low {
                    high = high.min(entry.0);
                }
            }
        }
        spans
    }
}

/// Halvings after which parts are as good as straight.
fn halvings(whole: &Control, bends: &Bends) -> u32 {
    // Of the curve, not of its control points: by balls at four parameters.
    let mut size = 0.0_f64;
    let [a, b, c, d] = whole;
    for weights in [[8.0, 12.0, 6.0, 1.0], [1.0, 6.0, 12.0, 8.0], [0.0, 0.0, 0.0, 27.0]] {
        let at = |k: usize| (weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k] + weights[3] * d[k]) / 27.0;
        size = (0..3).fold(size.max(at(3)), |size, k| size.max((at(k) - a[k]).abs()));
    }
    size = size.max(a[3]);
    let distance = a[2].abs().max(d[2].abs());
    let tolerance = (TOLERANCE * size).max(DISTANT * distance);
    let mut depth = 0;
    let mut deviation = bends.deviation();
    while deviation > tolerance && depth < MAX_DEPTH {
        deviation *= 0.25;
        depth += 1;
    }
    depth
}

/// More than all roundings of a position, relative to the sizes.
const MARGIN: f64 = 1e-13;

/// An interval of positions along the line that contains where it meets a part; `None` where it passes a circle around the part.
fn extent(part: &Control) -> Option<[f64; 2]> {
    let [[ax, ay, ..], .., [dx, dy, ..]] = part;
    let middle = [0.5 * (ax + dx), 0.5 * (ay + dy)];
    let [mut low, mut high] = [f64::INFINITY, f64::NEG_INFINITY];
    let [mut spread, mut greatest, mut size] = [0.0_f64; 3];
    for [x, y, z, radius] in part {
        (low, high) = (low.min(*z), high.max(*z));
        let off = [x - middle[0], y - middle[1]];
        spread = spread.max(off[0] * off[0] + off[1] * off[1]);
        greatest = greatest.max(*radius);
        size = size.max(x.abs() + y.abs() + z.abs() + radius);
    }
    // All centers are this far from the line at least.
    let away = sqrt(middle[0] * middle[0] + middle[1] * middle[1]) - sqrt(spread) - MARGIN * size;
    if away > greatest {
        return None;
    }
    let half_chord = if away > 0.0 { sqrt((greatest - away) * (greatest + away)) } else { greatest };
    Some([low - half_chord - MARGIN * size, high + half_chord + MARGIN * size])
}

/// Spans that do not overlap.
struct Spans {
    list: [Ends; MAX_SPANS],
    n: usize,
}

impl Spans {
    const EMPTY: Ends = [(f64::INFINITY, 0.0), (f64::NEG_INFINITY, 0.0)];

    fn all(&self) -> impl Iterator<Item = Ends> {
        self.list[..self.n].iter().copied()
    }

    /// Adds a span, and joins it with those that it overlaps. Where there is no room left, it is joined with the last.
    fn add(&mut self, mut span: Ends) {
        let mut i = 0;
        while i < self.n {
            let other = self.list[i];
            if other[0].0 <= span[1].0 && span[0].0 <= other[1].0 {
                span = joined(span, other);
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
            span = joined(span, self.list[self.n]);
        }
        self.list[self.n] = span;
        self.n += 1;
    }

    /// Whether an interval is within one span.
    fn contain(&self, start: f64, end: f64) -> bool {
        self.list[..self.n].iter().any(|[entry, exit]| entry.0 <= start && end <= exit.0)
    }
}

/// The span from the first entry to the last exit.
fn joined(a: Ends, b: Ends) -> Ends {
    [if b[0].0 < a[0].0 { b[0] } else { a[0] }, if b[1].0 > a[1].0 { b[1] } else { a[1] }]
}
