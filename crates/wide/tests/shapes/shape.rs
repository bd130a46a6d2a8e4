//! Capsules and disks of all sizes and orientations, rays at them, and the loop over all shapes.

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, Moments, PrimId};
use canted_trace::{Hit, InstanceId, Ray, RoundSegment, ScaledRay, Side, Sphere};
use canted_wide::{Primitive, PrimitiveHit, SavedPrimitive, bounds_of_points, extent_of_points};

type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn add_scaled(a: Vector, s: f64, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] + s * b[k])
}

fn wide(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

/// All points within `radius` of a line segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Capsule {
    pub(crate) ends: [[f32; 3]; 2],
    pub(crate) radius: f32,
}

impl Primitive for Capsule {
    fn bounds(&self) -> Aabb {
        bounds_of_points(self.ends, self.radius)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_points(self.ends, self.radius, direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.ends)
    }

    /// The union of two balls and of the cylinder between them is convex: least entry, greatest exit.
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let ([a, b], radius) = (self.ends.map(wide), f64::from(self.radius));
        let intervals = [ball(ray, a, radius), ball(ray, b, radius), cylinder(ray, a, b, radius)];
        let (mut near, mut far) = (f64::INFINITY, f64::NEG_INFINITY);
        for [entry, exit] in intervals.into_iter().flatten() {
            (near, far) = (near.min(entry), far.max(exit));
        }
        if near <= far { first_in([near, far], ray.t_min, t_max) } else { None }
    }
}

/// Front where the ray enters, back where it leaves.
fn first_in([near, far]: [f64; 2], t_min: f32, t_max: f32) -> Option<PrimitiveHit> {
    let [near, far] = [near as f32 + 0.0, far as f32 + 0.0];
    let (t, side) = if near >= t_min { (near, Side::Front) } else { (far, Side::Back) };
    (t_min <= t && t <= t_max).then_some(PrimitiveHit { t, u: 0.0, v: 0.0, side })
}

/// Where the line of a ray is inside a ball; computed at the point of the line that is closest to the center.
fn ball(ray: &ScaledRay, center: Vector, radius: f64) -> Option<[f64; 2]> {
    let d = wide(ray.direction);
    let m = add_scaled(wide(ray.origin), -1.0, center);
    let closest = -dot(m, d) / dot(d, d);
    let across = add_scaled(m, closest, d);
    let square = radius * radius - dot(across, across);
    (square >= 0.0).then(|| [-1.0, 1.0].map(|sign| closest + sign * (square / dot(d, d)).sqrt()))
}

/// Where the line of a ray is inside the cylinder between two points.
fn cylinder(ray: &ScaledRay, a: Vector, b: Vector, radius: f64) -> Option<[f64; 2]> {
    let (axis, d, m) = (add_scaled(b, -1.0, a), wide(ray.direction), add_scaled(wide(ray.origin), -1.0, a));
    let length = dot(axis, axis);
    if length == 0.0 {
        return None;
    }
    // Between the planes at both ends.
    let (along_d, along_m) = (dot(d, axis), dot(m, axis));
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    if along_d == 0.0 {
        if along_m < 0.0 || along_m > length {
            return None;
        }
    } else {
        let (p, q) = (-along_m / along_d, (length - along_m) / along_d);
        (near, far) = (p.min(q), p.max(q));
    }
    // Within the radius of the axis: a quadratic across it, about its minimum.
    let (d, m) = (add_scaled(d, -along_d / length, axis), add_scaled(m, -along_m / length, axis));
    if dot(d, d) == 0.0 {
        return (dot(m, m) <= radius * radius && near <= far).then_some([near, far]);
    }
    let closest = -dot(m, d) / dot(d, d);
    let across = add_scaled(m, closest, d);
    let square = radius * radius - dot(across, across);
    if square.is_nan() || square < 0.0 {
        return None;
    }
    let half = (square / dot(d, d)).sqrt();
    let interval = [near.max(closest - half), far.min(closest + half)];
    (interval[0] <= interval[1]).then_some(interval)
}

impl SavedPrimitive for Capsule {
    type Data = [f32; 7];

    fn to_data(&self) -> [f32; 7] {
        let [[a, b, c], [d, e, f]] = self.ends;
        [a, b, c, d, e, f, self.radius]
    }

    fn from_data(&[a, b, c, d, e, f, radius]: &[f32; 7]) -> Self {
        Self { ends: [[a, b, c], [d, e, f]], radius }
    }
}

/// A thin disk: all points `center + x·a + y·b` with `x² + y² <= 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Disk {
    pub(crate) center: [f32; 3],
    pub(crate) axes: [[f32; 3]; 2],
}

impl Disk {
    /// Corners of a parallelogram around it.
    fn corners(&self) -> [[f32; 3]; 4] {
        let [a, b] = self.axes;
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| std::array::from_fn(|k| self.center[k] + x * a[k] + y * b[k]))
    }
}

impl Primitive for Disk {
    const MAX_LEAF: usize = 4;

    fn bounds(&self) -> Aabb {
        bounds_of_points(self.corners(), 0.0)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_points(self.corners(), 0.0, direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.corners())
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let [o, d, c, a, b] = [ray.origin, ray.direction, self.center, self.axes[0], self.axes[1]].map(wide);
        let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let to_center = add_scaled(c, -1.0, o);
        let t = (dot(to_center, normal) / dot(d, normal)) as f32 + 0.0;
        let p: Vector = std::array::from_fn(|k| f64::from(t) * d[k] - to_center[k]);
        // Coordinates in the frame of `a` and `b`, which need not be orthogonal.
        let (aa, ab, bb, pa, pb) = (dot(a, a), dot(a, b), dot(b, b), dot(p, a), dot(p, b));
        let determinant = aa * bb - ab * ab;
        let (x, y) = ((pa * bb - pb * ab) / determinant, (pb * aa - pa * ab) / determinant);
        let side = if dot(d, normal) < 0.0 { Side::Front } else { Side::Back };
        let is_hit = ray.t_min <= t && t <= t_max && x * x + y * y <= 1.0;
        is_hit.then_some(PrimitiveHit { t, u: x as f32, v: y as f32, side })
    }
}

/// Every hit of the loop over all shapes, sorted by `t`, then by shape.
pub(crate) fn loop_over_all<P: Primitive>(shapes: &[P], ray: &Ray) -> Vec<Hit> {
    let Some(ray) = ScaledRay::new(ray) else { return vec![] };
    let mut hits = vec![];
    for (primitive, shape) in (0..).map(PrimId).zip(shapes) {
        let mut rest = ray;
        while let Some(PrimitiveHit { t, u, v, side }) = shape.intersect(&rest, ray.t_max) {
            hits.push(Hit { t, u, v, primitive, instance: InstanceId(0), side });
            rest.t_min = t.next_up();
            if rest.t_min > ray.t_max {
                break;
            }
        }
    }
    hits.sort_by(|a, b| (a.t, a.primitive).partial_cmp(&(b.t, b.primitive)).unwrap());
    for hit in &mut hits {
        hit.t = ray.caller_t(hit.t);
    }
    hits
}

/// A lattice of thin diagonal capsules, like struts.
pub(crate) fn struts(n: usize) -> Vec<Capsule> {
    let mut rng = SplitMix64::new(3);
    let directions = [[1.0, 1.0, 1.0], [1.0, -1.0, 0.5], [-0.5, 1.0, 1.0]];
    (0..n)
        .map(|i| {
            let a: [f32; 3] = std::array::from_fn(|_| (10.0 * rng.unit()).floor() as f32);
            let b = std::array::from_fn(|k| a[k] + 5.0 * directions[i % 3][k]);
            Capsule { ends: [a, b], radius: 0.02 }
        })
        .collect()
}

/// Capsules from points to needles, some without radius, some twice, all moved by `offset`.
pub(crate) fn capsules(n: usize, scale: f32, offset: f32) -> Vec<Capsule> {
    let mut rng = SplitMix64::new(5);
    let mut capsules: Vec<Capsule> = (0..n)
        .map(|i| {
            let a: [f32; 3] = std::array::from_fn(|_| scale * (8.0 * rng.unit() as f32 - 4.0) + offset);
            let length = scale * [0.0, 0.01, 1.0, 4.0][i % 4];
            let along: [f32; 3] = match i % 5 {
                0 => [1.0, 0.0, -0.0],
                1 => [0.0, 0.0, 1.0],
                _ => rng.on_sphere().map(|x| x as f32),
            };
            let b = std::array::from_fn(|k| a[k] + length * along[k]);
            Capsule { ends: [a, b], radius: scale * [0.0, 1e-4, 0.02, 0.3][i / 4 % 4] }
        })
        .collect();
    capsules.extend_from_within(..n / 5);
    capsules
}

/// Thin disks in all directions, some in planes of the axes, some almost without width.
pub(crate) fn disks(n: usize, scale: f32, offset: f32) -> Vec<Disk> {
    let mut rng = SplitMix64::new(7);
    (0..n)
        .map(|i| {
            let center = std::array::from_fn(|_| scale * (8.0 * rng.unit() as f32 - 4.0) + offset);
            let mut axes = [rng.on_sphere(), rng.on_sphere()].map(|axis| axis.map(|x| x as f32));
            if i % 6 == 0 {
                axes = [[1.0, 0.0, 0.0], [0.0, -0.0, 1.0]];
            }
            let sizes = [[1.0, 1.0], [1.0, 0.01], [0.1, 0.05], [2.0, 0.3]][i % 4];
            Disk { center, axes: std::array::from_fn(|k| axes[k].map(|x| scale * sizes[k] * x)) }
        })
        .collect()
}

pub(crate) fn spheres(n: usize, scale: f32, offset: f32) -> Vec<Sphere> {
    capsules(n, scale, offset).iter().map(|c| Sphere { center: c.ends[0], radius: c.radius }).collect()
}

/// Segments of all kinds: cones, capsules, balls, one ball within the other, tips.
pub(crate) fn segments(n: usize, scale: f32, offset: f32) -> Vec<RoundSegment> {
    let other = |i: usize, radius: f32| [radius, 0.0, 0.1 * radius, 3.0 * radius, scale * 0.5][i / 3 % 5];
    let segment = |(i, c): (usize, &Capsule)| RoundSegment { ends: c.ends, radii: [c.radius, other(i, c.radius)] };
    capsules(n, scale, offset).iter().enumerate().map(segment).collect()
}

/// Boxes, some flat, some points.
pub(crate) fn boxes(n: usize, scale: f32, offset: f32) -> Vec<Aabb> {
    capsules(n, scale, offset).iter().map(|c| Aabb::from_points(c.ends)).collect()
}

/// Rays at, past, along and from inside the shapes, from all distances, some bounded.
pub(crate) fn rays<P: Primitive>(shapes: &[P], n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(11);
    let all = shapes.iter().fold(Aabb::EMPTY, |all, shape| all.union(shape.bounds()));
    let size = all.extent().into_iter().fold(1e-30, f64::max) as f32;
    (0..n)
        .map(|i| {
            // A point at a corner, on the border, or inside the bounds of a shape.
            let bounds = shapes[rng.below(shapes.len())].bounds();
            let target: [f32; 3] = std::array::from_fn(|k| {
                let weight = [0.0, 1.0, 0.5, rng.unit() as f32][(i + 3 * k) % 4];
                bounds.min[k] + weight * (bounds.max[k] - bounds.min[k])
            });
            let from: [f32; 3] = rng.on_sphere().map(|x| x as f32);
            let distance = size * [0.0, 0.01, 1.0, 100.0, 1e5][i % 5];
            let origin: [f32; 3] = std::array::from_fn(|k| target[k] + distance * from[k]);
            let mut direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
            if i % 6 == 0 || direction == [0.0; 3] {
                direction = [[1.0, -0.0, 0.0], [-0.0, 0.0, -3.0], from][i / 6 % 3];
            }
            let mut ray = Ray::new(origin, direction);
            if i % 7 == 0 {
                (ray.t_min, ray.t_max) = (0.5, 1.25);
            }
            ray
        })
        .collect()
}
