//! Gaps between a box and the eight boxes of a node, by separating axes (Gottschalk, Lin and Manocha 1996).
//!
//! # No lost pair
//! The space of a query is relative to a point near the first body. A body with the linear map `M` has its boxes `lo <= R·y <= hi` at
//! `M·y + offset`; let `c`, `h` be their centers and half-extents, `ρ` the greatest coordinate of its root box, `K = ‖M‖·ρ` with the root of the sum of
//! squares for the norm, and u = 2^-24. Along an axis `a` of length at most 1 a point of the content is at `Σ y_k·(a·d_k) + a·offset` with `d_k = M·row_k`,
//! where `|y_k - c_k| <= h_k`, but for two errors:
//!
//! *Rows.* `y = R⁻¹·(R·y)` is taken as `Rᵀ·(R·y)`. With `R·Rᵀ = I + E` and `s >= ‖E‖`, at most 1/4, that is off by at most 1.5·s·|R·y|, and |R·y| is at most
//! `2·ρ`: less than `5·s·K` along the axis. Where `s` is greater, there is no gap.
//! *Roundings.* In lanes of `f32` a sum of three products takes five roundings of terms that add up to at most 3.5·K, for centers and for
//! half-extents: 35 u·K; the comparison adds less than 15 u·K, and what is computed in `f64` and rounded once as much for the other body and the offset. Of oriented
//! nodes, `d_k` has four roundings in lanes and its product with the axis four more, each relative to ‖M‖: with 12·ρ for the sum of centers and half-extents
//! 96 u·K more. So [`ROUNDING`] is 192 u, times the sum of `K` and `|offset|` of both bodies.
//!
//! Stored planes are farther out than the content by at least 7 u·ρ, which covers that content is moved to the reference point in `f32`. Any vector is an
//! axis: no proof depends on it being a normal. So a computed gap, less these errors, is at most the distance of any two points of the contents, times the length of
//! the axis, whose square is at most 1 + s. Where `M` is a similarity, the squares of the gaps along three normals of a box add up, as those of components
//! do, up to 1 + s again and to 2^-16, which [`SHRINK`] covers with the roundings.
//! *Far from the origin.* In `f64` the images of vertices and of the reference point are off by less than 2^-49 of the terms, [`FAR`].

use canted_obb::vector::{Vector, add, cross, dot, length, reach, scale, sub, to_f64};
use canted_wide::{NodeBox, NodeLanes};

use crate::body::Body;
use crate::pose::Pose;

/// See the module.
const ROUNDING: f64 = 192.0 / 16_777_216.0;

/// See the module.
const SHRINK: f32 = 1.0 - 1.0 / 65_536.0;

/// See the module.
const FAR: f64 = 8.0 * f64::EPSILON;

/// By how much the product of a matrix of normals with its transpose may differ from the identity if it is one of a similarity.
const SIMILAR: f64 = 1.0 / 262_144.0;

/// Greatest deviation of rows from right angles and unit length with which there are gaps.
const GREATEST_SKEW: f64 = 0.25;

/// Beyond this the lanes may overflow.
const GREATEST_SIZE: f64 = 1e30;

/// By how much times are farther out than they are, of themselves: more than a contact is early.
const WIDER: f64 = 1.0 / (1_u64 << 39) as f64;

/// Eight numbers.
pub(crate) type Lanes = [f32; 8];

/// A body in the space of a query.
pub(crate) struct Frame {
    pose: Pose,
    /// Maps normals; of length at most 1.
    normals: [Vector; 3],
    /// Image of the reference point.
    offset: Vector,
    /// `K` of the module.
    size: f64,
    /// Error of vertices and of the offset.
    far: f64,
    /// Whether normals of the three axes of a box are orthogonal and of unit length, but for [`SIMILAR`].
    is_similarity: bool,
}

/// A box in the space of a query.
pub(crate) struct PlacedBox {
    center: Vector,
    halves: [Vector; 3],
    normals: [Vector; 3],
    /// Error of its rows.
    error: f64,
}

impl Frame {
    /// A body under a pose; the space is relative to `origin`.
    pub(crate) fn new<B: Body + ?Sized>(body: &B, root: &NodeBox, pose: &Pose, origin: Vector) -> Self {
        let normals = pose.of_normals();
        let identity = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
        let deviation = identity.map(|(i, j)| (dot(normals[i], normals[j]) - f64::from(u8::from(i == j))).abs());
        let reach = root.lo.iter().chain(&root.hi).fold(0.0, |most: f64, x| most.max(x.abs()));
        Self {
            pose: *pose,
            normals,
            offset: sub(pose.point_f64(body.reference_point()), origin),
            size: pose.norm() * reach,
            far: FAR
                * (pose.norm() * (length(body.reference_point()) + reach) + length(pose.columns[3]) + length(origin)),
            is_similarity: deviation.fold(0.0, f64::max) < SIMILAR,
        }
    }

    /// How far boxes may reach, and where they are; for errors.
    fn scale(&self) -> f64 {
        self.size + length(self.offset)
    }

    /// The size of a box, to compare with others.
    pub(crate) fn size_of(&self, NodeBox { lo, hi, .. }: &NodeBox) -> f64 {
        self.pose.norm() * (0..3).map(|k| hi[k] - lo[k]).fold(0.0, f64::max)
    }

    /// How far what is compared in `f64` may be off, for boxes of both bodies: much more than the roundings, and than `tolerance` of the
    /// coordinates.
    pub(crate) fn slack(&self, other: &Self, tolerance: f64) -> f64 {
        self.far + other.far + (tolerance + 1024.0 * f64::EPSILON) * (self.scale() + other.scale())
    }

    /// A box of the body.
    pub(crate) fn placed(&self, NodeBox { rows, lo, hi }: &NodeBox) -> PlacedBox {
        let rows = rows.map(to_f64);
        let images = rows.map(|row| self.pose.vector(row));
        let half = |k: usize, side: f64| 0.5 * (hi[k] + side * lo[k]);
        let [x, y, z] = [0, 1, 2].map(|k| scale(images[k], half(k, 1.0)));
        PlacedBox {
            center: add(self.offset, add(x, add(y, z))),
            halves: [0, 1, 2].map(|k| scale(images[k], half(k, -1.0))),
            normals: rows.map(|row| linear(&self.normals, row)),
            error: 5.0 * usable_skew(skew(&rows)) * self.size,
        }
    }

    /// Lower bounds of the distances from a box of another body to the eight boxes of a node of this one; below zero where they may touch.
    pub(crate) fn gaps(&self, single: &PlacedBox, other: &Self, lanes: NodeLanes<'_>, frame: [[f32; 3]; 3]) -> Lanes {
        let size = self.scale() + other.scale();
        let error = ROUNDING * size + self.far + other.far + single.error + 16.0 * f64::from(f32::MIN_POSITIVE);
        if !(size < GREATEST_SIZE && error < f64::INFINITY) {
            return [f32::NEG_INFINITY; 8];
        }
        let center = sub(single.center, self.offset);
        match lanes {
            NodeLanes::Aligned(rows) => {
                let frame = frame.map(to_f64);
                let skew = usable_skew(skew(&frame));
                let error = error + 5.0 * skew * self.size;
                shrunk(self.aligned(&PlacedBox { center, error, ..*single }, rows, &frame), &[skew as f32; 8])
            }
            NodeLanes::Oriented(rows) => self.oriented(&PlacedBox { center, error, ..*single }, rows),
        }
    }

    /// For a node in the frame of the mesh; the box is relative to the offset, and its error that of a gap.
    fn aligned(&self, single: &PlacedBox, rows: &[Lanes; 8], frame: &[Vector; 3]) -> Lanes {
        let images = frame.map(|row| self.pose.vector(row));
        let center: [Lanes; 3] =
            std::array::from_fn(|k| std::array::from_fn(|i| 0.5 * (rows[2 * k][i] + rows[2 * k + 1][i])));
        let half: [Lanes; 3] =
            std::array::from_fn(|k| std::array::from_fn(|i| 0.5 * (rows[2 * k + 1][i] - rows[2 * k][i])));
        let along = |axis: Vector| -> Lanes {
            let [g, h, j] = images.map(|image| dot(axis, image) as f32);
            let (at, reach) = single.along(axis);
            std::array::from_fn(|i| {
                let from = (center[0][i] * g + center[1][i] * h + center[2][i] * j - at).abs();
                from - (half[0][i] * g.abs() + half[1][i] * h.abs() + half[2][i] * j.abs() + reach)
            })
        };
        let own = frame.map(|row| along(linear(&self.normals, row)));
        let mut gaps = self.joined(&own);
        for normal in single.normals {
            raise(&mut gaps, &along(normal));
        }
        if gaps.iter().any(|&gap| gap <= 0.0) {
            for image in images {
                for half in single.halves {
                    let axis = cross(image, half);
                    let size = reach(axis);
                    if size > 0.0 {
                        // Of length at most 1.
                        raise(&mut gaps, &along(scale(axis, 0.5 / size)));
                    }
                }
            }
        }
        gaps
    }

    /// For a node with a frame for each box.
    fn oriented(&self, single: &PlacedBox, rows: &[Lanes; 16]) -> Lanes {
        let axes: [[Lanes; 3]; 3] = std::array::from_fn(|k| std::array::from_fn(|x| rows[5 * k + x]));
        let images = axes.map(|axis| mapped(&self.pose.columns, &axis));
        // Roundings are those of products of unit vectors: less than 2^-20.
        let mut skews = [1.0 / 1_048_576.0; 8];
        let [a, b, c] = &axes;
        for (one, other, expected) in [(a, a, 1.0), (b, b, 1.0), (c, c, 1.0), (a, b, 0.0), (b, c, 0.0), (c, a, 0.0)] {
            let (product, weight) = (dot_lanes(one, other), 2.0 - expected);
            (0..8).for_each(|i| skews[i] += weight * (product[i] - expected).abs());
        }
        let skews = skews.map(|skew| usable_skew(skew.into()) as f32);
        let errors = skews.map(|skew| single.error as f32 + (5.0 * self.size) as f32 * skew);
        let (center, half): ([&Lanes; 3], [&Lanes; 3]) =
            (std::array::from_fn(|k| &rows[5 * k + 3]), std::array::from_fn(|k| &rows[5 * k + 4]));
        // Along axes of the lanes, with the components of the box in lanes.
        let along = |axis: &[Lanes; 3], at: &Lanes, reach: &Lanes| -> Lanes {
            let g = [0, 1, 2].map(|k| dot_lanes(axis, &images[k]));
            std::array::from_fn(|i| {
                let from = (center[0][i] * g[0][i] + center[1][i] * g[1][i] + center[2][i] * g[2][i] - at[i]).abs();
                let extent = half[0][i] * g[0][i].abs() + half[1][i] * g[1][i].abs() + half[2][i] * g[2][i].abs();
                from - (extent + reach[i] + errors[i])
            })
        };
        let box_along = |axis: &[Lanes; 3]| -> (Lanes, Lanes) {
            let at = dot_single(axis, single.center);
            let parts = single.halves.map(|half| dot_single(axis, half));
            (at, std::array::from_fn(|i| parts[0][i].abs() + parts[1][i].abs() + parts[2][i].abs()))
        };
        let own = axes.map(|axis| {
            let axis = mapped(&[self.normals[0], self.normals[1], self.normals[2], [0.0; 3]], &axis);
            let (at, reach) = box_along(&axis);
            along(&axis, &at, &reach)
        });
        let mut gaps = self.joined(&own);
        for normal in single.normals {
            let axis = normal.map(|x| [x as f32; 8]);
            let (at, reach) = box_along(&axis);
            raise(&mut gaps, &along(&axis, &at, &reach));
        }
        if gaps.iter().any(|&gap| gap <= 0.0) {
            for image in &images {
                for half in single.halves {
                    // Unit length for rows of unit length under a similarity, else less.
                    let size = length(half) * self.pose.norm();
                    if size > 0.0 {
                        let axis = cross_single(image, scale(half, 1.0 / size));
                        let (at, reach) = box_along(&axis);
                        raise(&mut gaps, &along(&axis, &at, &reach));
                    }
                }
            }
        }
        shrunk(gaps, &skews)
    }

    /// The bound by the gaps along the three normals of the boxes.
    fn joined(&self, own: &[Lanes; 3]) -> Lanes {
        std::array::from_fn(|i| {
            let gaps = [own[0][i], own[1][i], own[2][i]];
            let most = gaps[0].max(gaps[1]).max(gaps[2]);
            if most > 0.0 && self.is_similarity {
                let [x, y, z] = gaps.map(|gap| gap.max(0.0));
                return (x * x + y * y + z * z).sqrt().max(most);
            }
            most
        })
    }
}

impl PlacedBox {
    /// When this box and another one that moves by `t·motion` may share a point: from the first `t` to the second, of all numbers. Empty where the first
    /// exceeds the second.
    ///
    /// Along each axis of the separating-axis test without edges, and two across the motion, both are intervals of which one moves.
    pub(crate) fn meeting(&self, other: &Self, motion: Vector, across: &[Vector; 2], slack: f64) -> [f64; 2] {
        let slack = slack + self.error + other.error;
        let between = sub(other.center, self.center);
        let axes = self.normals.iter().chain(&other.normals).chain(across);
        axes.fold([f64::NEG_INFINITY, f64::INFINITY], |[from, to], &axis| {
            let halves = self.halves.iter().chain(&other.halves).map(|&half| dot(axis, half).abs()).sum::<f64>();
            // No axis is longer than 1 by much.
            let (at, reach) = (dot(axis, between), halves + 2.0 * slack);
            let own = times(-reach - at, reach - at, dot(axis, motion));
            [from.max(own[0]), to.min(own[1])]
        })
    }

    /// The center along an axis, and how far the box reaches from it, with the error of a gap.
    #[inline]
    fn along(&self, axis: Vector) -> (f32, f32) {
        let reach = self.halves.iter().map(|&half| dot(axis, half).abs()).sum::<f64>() + self.error;
        (dot(axis, self.center) as f32, reach as f32)
    }
}

/// When what moves at a speed is between two places, from the first time to the second, each of them farther out by 2^-39 of it.
pub(crate) fn times(near: f64, far: f64, speed: f64) -> [f64; 2] {
    if speed == 0.0 {
        let is_empty = near > 0.0 || far < 0.0;
        return if is_empty { [f64::INFINITY, f64::NEG_INFINITY] } else { [f64::NEG_INFINITY, f64::INFINITY] };
    }
    let (a, b) = (near / speed, far / speed);
    let [from, to] = [a.min(b), a.max(b)];
    [from - WIDER * from.abs(), to + WIDER * to.abs()]
}

/// Gaps as bounds of distances, for axes that are longer than 1 by the skew.
fn shrunk(gaps: Lanes, skews: &Lanes) -> Lanes {
    std::array::from_fn(|i| gaps[i] * (SHRINK / (1.0 + skews[i]).sqrt()))
}

/// The greater of both; a gap that is NaN says nothing.
#[inline]
fn raise(gaps: &mut Lanes, others: &Lanes) {
    for (gap, &other) in gaps.iter_mut().zip(others) {
        if other > *gap {
            *gap = other;
        }
    }
}

#[inline]
fn linear([x, y, z]: &[Vector; 3], v: Vector) -> Vector {
    std::array::from_fn(|k| x[k] * v[0] + y[k] * v[1] + z[k] * v[2])
}

/// The linear part of a map, of vectors in lanes.
#[inline]
fn mapped([x, y, z, _]: &[Vector; 4], v: &[Lanes; 3]) -> [Lanes; 3] {
    std::array::from_fn(|k| {
        let [a, b, c] = [x[k] as f32, y[k] as f32, z[k] as f32];
        std::array::from_fn(|i| a * v[0][i] + b * v[1][i] + c * v[2][i])
    })
}

#[inline]
fn dot_lanes(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    std::array::from_fn(|i| a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i])
}

#[inline]
fn dot_single(a: &[Lanes; 3], b: Vector) -> Lanes {
    let [x, y, z] = b.map(|x| x as f32);
    std::array::from_fn(|i| a[0][i] * x + a[1][i] * y + a[2][i] * z)
}

#[inline]
fn cross_single(a: &[Lanes; 3], b: Vector) -> [Lanes; 3] {
    let b = b.map(|x| x as f32);
    std::array::from_fn(|k| {
        let (m, n) = ((k + 1) % 3, (k + 2) % 3);
        std::array::from_fn(|i| a[m][i] * b[n] - a[n][i] * b[m])
    })
}

/// A bound of the spectral norm of `R·Rᵀ - I`: the sum of its entries.
fn skew(rows: &[Vector; 3]) -> f64 {
    let [a, b, c] = *rows;
    let lengths = (dot(a, a) - 1.0).abs() + (dot(b, b) - 1.0).abs() + (dot(c, c) - 1.0).abs();
    lengths + 2.0 * (dot(a, b).abs() + dot(b, c).abs() + dot(c, a).abs())
}

/// Infinite where the skew is too great for gaps.
fn usable_skew(skew: f64) -> f64 {
    if skew <= GREATEST_SKEW { skew } else { f64::INFINITY }
}
