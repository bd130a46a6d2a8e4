//! Parts of a bicubic patch in the frame of a ray, whose line is the third axis: two coordinates across the line, one along it.
//!
//! # Windings
//! The boundary of a part, seen along the line, winds around the line as often as the line passes through the part from one side,
//! less how often it does from the other. It is counted on polylines: each edge of a part is halved [`MAX_LEVEL`] times in all,
//! from the edge of the patch or the line of equal parameters on which it lies. Halving takes means of two numbers, in f64, so that
//!
//! - a mean is between both numbers, whatever the rounding: what all control points of an edge have in common with respect to a
//!   coordinate, all vertices of its polyline have;
//! - a mean does not depend on the order of both: an edge that is read backward has the same vertices;
//! - halving a part halves its edges as curves: parts on both sides of an edge have the same vertices there, however often each is
//!   halved, and so have patches that share the four control points of an edge.
//!
//! A polyline is counted where it crosses the half-axis `y = 0, x > 0`. A vertex with `y = 0` is above it. Whether a piece passes
//! the line on the right is the sign of one difference of two products, which changes if the piece is read backward, and is zero
//! then, too. So the numbers of both readings are each other's negatives, the numbers of the halves of a part sum to that of the
//! part, and those of patches that form a closed surface sum to zero: exactly.
//!
//! Source: the degree of a map, as in Kronecker 1869; de Casteljau 1959.

/// Numbers along the second parameter.
pub(crate) type Row = [f64; 4];

/// Most halvings of a patch in each direction.
///
/// The differences of neighboring control points are halved each time, so after as many in both directions the control points of a
/// part differ by at most `6·2^-30` of the extent of those of the patch, in each coordinate.
pub(crate) const MAX_LEVEL: u32 = 30;

/// Control points of a part: for each axis of the frame of the ray, rows of the first parameter.
#[derive(Clone, Copy)]
pub(crate) struct Net {
    pub(crate) axes: [[Row; 4]; 3],
}

/// A coordinate of a point of a part, and its derivatives by both parameters of the part.
#[derive(Clone, Copy)]
struct Jet {
    value: f64,
    by_u: f64,
    by_v: f64,
}

/// Where the line passes through a part: parameters of the part, and the position along the line.
#[derive(Clone, Copy)]
pub(crate) struct Crossing {
    pub(crate) at: [f64; 2],
    pub(crate) along: f64,
}

/// Newton's steps; they converge quadratically, or the part is halved.
const MAX_STEPS: u32 = 10;

/// A step as small as this is the last: the next one would be below the roundings of a parameter.
const LAST_STEP: f64 = 1.0 / (1_u64 << 30) as f64;

#[inline(always)]
fn mean(a: f64, b: f64) -> f64 {
    0.5 * (a + b)
}

/// De Casteljau's halves of a cubic polynomial, which share the value in the middle.
#[inline(always)]
fn halves([a, b, c, d]: Row) -> [Row; 2] {
    let (ab, bc, cd) = (mean(a, b), mean(b, c), mean(c, d));
    let (abc, bcd) = (mean(ab, bc), mean(bc, cd));
    let middle = mean(abc, bcd);
    [[a, ab, abc, middle], [middle, bcd, cd, d]]
}

/// Means of two rows, number by number.
#[inline(always)]
fn means(a: Row, b: Row) -> Row {
    [mean(a[0], b[0]), mean(a[1], b[1]), mean(a[2], b[2]), mean(a[3], b[3])]
}

/// How often the polyline of an edge crosses the half-axis upward, less how often downward.
fn crossings(x: Row, y: Row, level: u32) -> i32 {
    if y.iter().all(|&y| y >= 0.0) || y.iter().all(|&y| y < 0.0) || x.iter().all(|&x| x <= 0.0) {
        return 0;
    }
    let rises = i32::from(y[3] >= 0.0) - i32::from(y[0] >= 0.0);
    if x.iter().all(|&x| x > 0.0) {
        return rises;
    }
    if level < MAX_LEVEL {
        let ([low_x, high_x], [low_y, high_y]) = (halves(x), halves(y));
        return crossings(low_x, low_y, level + 1) + crossings(high_x, high_y, level + 1);
    }
    let is_right = match (x[0] > 0.0, x[3] > 0.0) {
        (true, true) => true,
        (false, false) => false,
        _ => {
            let turn = x[0] * y[3] - x[3] * y[0];
            if rises > 0 { turn > 0.0 } else { turn < 0.0 }
        }
    };
    if is_right { rises } else { 0 }
}

impl Net {
    /// Whether the line passes all control points on one side, as `crossings` compares them: then the winding of every part is zero.
    #[inline(always)]
    pub(crate) fn is_beside(&self) -> bool {
        let [x, y, _] = &self.axes;
        let is_all = |rows: &[Row; 4], of: fn(f64) -> bool| rows.as_flattened().iter().all(|&number| of(number));
        is_all(x, |x| x > 0.0) || is_all(x, |x| x <= 0.0) || is_all(y, |y| y >= 0.0) || is_all(y, |y| y < 0.0)
    }

    /// The interval of an axis that contains all control points.
    #[inline(always)]
    pub(crate) fn interval(&self, axis: usize) -> [f64; 2] {
        let numbers = self.axes[axis].as_flattened();
        let fold = |of: fn(f64, f64) -> f64| numbers.iter().copied().reduce(of).unwrap_or(0.0);
        [fold(|a, b| if a < b { a } else { b }), fold(|a, b| if a > b { a } else { b })]
    }

    /// The greatest extent of the control points along the first axes.
    pub(crate) fn extent(&self, n_axes: usize) -> f64 {
        (0..n_axes).map(|axis| self.interval(axis)).fold(0.0, |extent, [low, high]| extent.max(high - low))
    }

    /// The halves of the first parameter.
    pub(crate) fn halves_of_u(&self) -> [Self; 2] {
        let [mut low, mut high] = [*self; 2];
        for axis in 0..3 {
            let [a, b, c, d] = self.axes[axis];
            let (ab, bc, cd) = (means(a, b), means(b, c), means(c, d));
            let (abc, bcd) = (means(ab, bc), means(bc, cd));
            let middle = means(abc, bcd);
            low.axes[axis] = [a, ab, abc, middle];
            high.axes[axis] = [middle, bcd, cd, d];
        }
        [low, high]
    }

    /// The halves of the second parameter.
    pub(crate) fn halves_of_v(&self) -> [Self; 2] {
        let [mut low, mut high] = [*self; 2];
        for axis in 0..3 {
            for i in 0..4 {
                [low.axes[axis][i], high.axes[axis][i]] = halves(self.axes[axis][i]);
            }
        }
        [low, high]
    }

    /// The greatest difference of neighboring control points along each parameter, in a coordinate of the first axes.
    pub(crate) fn steps(&self, n_axes: usize) -> [f64; 2] {
        let (mut of_u, mut of_v) = (0.0_f64, 0.0_f64);
        for rows in &self.axes[..n_axes] {
            for (i, row) in rows.iter().enumerate() {
                for j in 0..3 {
                    of_u = of_u.max((rows[j + 1][i] - rows[j][i]).abs());
                    of_v = of_v.max((row[j + 1] - row[j]).abs());
                }
            }
        }
        [of_u, of_v]
    }

    /// How often the boundary winds around the line, counter-clockwise as seen against the third axis; `levels` are the halvings so far.
    pub(crate) fn winding(&self, levels: [u32; 2]) -> i32 {
        let [x, y, _] = &self.axes;
        let column = |rows: &[Row; 4], j: usize| [rows[0][j], rows[1][j], rows[2][j], rows[3][j]];
        crossings(column(x, 0), column(y, 0), levels[0]) + crossings(x[3], y[3], levels[1])
            - crossings(column(x, 3), column(y, 3), levels[0])
            - crossings(x[0], y[0], levels[1])
    }

    /// Whether a line parallel to that of the ray passes through the part at most once.
    ///
    /// Let `U` and `V` be the mean differences along both parameters, across the line. In coordinates along `U` and `V` the part is
    /// simple if each difference of neighbors along the first parameter has a greater part along `U`, positive, than along `V`, and
    /// each along the second one the other way round: between two points of the part the map changes by `a·p + b·q` with such `p`
    /// and `q`, means of differences, which are linearly independent.
    pub(crate) fn is_simple(&self) -> bool {
        let [x, y, _] = &self.axes;
        let along = |rows: &[Row; 4]| {
            let (mut u, mut v) = (0.0, 0.0);
            for (i, row) in rows.iter().enumerate() {
                u += rows[3][i] - rows[0][i];
                v += row[3] - row[0];
            }
            [u, v]
        };
        let ([u_x, v_x], [u_y, v_y]) = (along(x), along(y));
        let area = u_x * v_y - u_y * v_x;
        let sign = if area < 0.0 { -1.0 } else { 1.0 };
        let (mut is_simple, [u_x, v_x, u_y, v_y]) = (area != 0.0, [sign * u_x, sign * v_x, u_y, v_y]);
        // Where the sign is negative, the first coordinate is mirrored.
        for i in 0..4 {
            for j in 0..3 {
                let (p_x, p_y) = (sign * (x[j + 1][i] - x[j][i]), y[j + 1][i] - y[j][i]);
                let (q_x, q_y) = (sign * (x[i][j + 1] - x[i][j]), y[i][j + 1] - y[i][j]);
                is_simple &= p_x * v_y - p_y * v_x > (u_x * p_y - u_y * p_x).abs();
                is_simple &= u_x * q_y - u_y * q_x > (q_x * v_y - q_y * v_x).abs();
            }
        }
        is_simple
    }

    /// Whether all control points, seen along the line, are within a strip of this width.
    pub(crate) fn is_thin(&self, width: f64) -> bool {
        let [x, y, _] = &self.axes;
        // Along the longest of six lines between the corners.
        let corners = [[x[0][0], y[0][0]], [x[3][0], y[3][0]], [x[3][3], y[3][3]], [x[0][3], y[0][3]]];
        let (mut longest, mut square) = ([0.0; 2], 0.0);
        for i in 0..4 {
            for j in 0..i {
                let line = [corners[i][0] - corners[j][0], corners[i][1] - corners[j][1]];
                let length = line[0] * line[0] + line[1] * line[1];
                if length > square {
                    (longest, square) = (line, length);
                }
            }
        }
        if square == 0.0 {
            return self.extent(2) <= width;
        }
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for i in 0..4 {
            for j in 0..4 {
                let across = longest[0] * (y[i][j] - y[0][0]) - longest[1] * (x[i][j] - x[0][0]);
                (low, high) = (low.min(across), high.max(across));
            }
        }
        (high - low) * (high - low) <= width * width * square
    }

    /// A coordinate at parameters of the part.
    fn at(&self, axis: usize, [u, v]: [f64; 2]) -> Jet {
        let weights = |s: f64| {
            let r = 1.0 - s;
            ([r * r * r, 3.0 * s * r * r, 3.0 * s * s * r, s * s * s], [3.0 * r * r, 6.0 * s * r, 3.0 * s * s])
        };
        let ((value_u, slope_u), (value_v, slope_v)) = (weights(u), weights(v));
        let rows = &self.axes[axis];
        let (mut value, mut slope) = ([0.0; 4], [0.0; 4]);
        for j in 0..4 {
            for i in 0..4 {
                value[j] += value_u[i] * rows[i][j];
            }
            for i in 0..3 {
                slope[j] += slope_u[i] * (rows[i + 1][j] - rows[i][j]);
            }
        }
        let dot = |a: &Row| a[0] * value_v[0] + a[1] * value_v[1] + a[2] * value_v[2] + a[3] * value_v[3];
        let by_v = (0..3).map(|j| slope_v[j] * (value[j + 1] - value[j])).sum();
        Jet { value: dot(&value), by_u: dot(&slope), by_v }
    }

    /// Where the line passes through a simple part, by Newton's steps from the middle; `None` where they do not end at a point
    /// nearer to the line than `error`, in both coordinates.
    pub(crate) fn crossing(&self, error: f64) -> Option<Crossing> {
        let mut at = [0.5; 2];
        for _ in 0..MAX_STEPS {
            let (x, y) = (self.at(0, at), self.at(1, at));
            let area = x.by_u * y.by_v - x.by_v * y.by_u;
            let step = [(x.value * y.by_v - y.value * x.by_v) / area, (x.by_u * y.value - y.by_u * x.value) / area];
            let next = [0, 1].map(|k| (at[k] - step[k]).clamp(0.0, 1.0));
            let moved = (next[0] - at[0]).abs().max((next[1] - at[1]).abs());
            at = next;
            if moved <= LAST_STEP {
                break;
            }
        }
        let [x, y, along] = [0, 1, 2].map(|axis| self.at(axis, at).value);
        // False for NaN.
        (x.abs() <= error && y.abs() <= error).then_some(Crossing { at, along })
    }
}
