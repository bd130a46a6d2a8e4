use canted_obb::Affine;
use canted_obb::vector::{Vector, add, cross, dot, length, scale, sub, to_f32, to_f64, unit};

use crate::rounding::UNIT_ROUNDOFF;
use crate::{HIT_ERROR, Hit, Ray};

/// The point of a triangle that a ray hit, with its error bound: where shadow rays, reflections and paths continue.
///
/// ```
/// use canted_trace::{Kernel, Ray, ScaledRay, SurfacePoint, Watertight};
/// # use canted_trace::{Hit, InstanceId};
/// # use canted_obb::PrimId;
/// let vertices = [[1000.1, 0.0, 0.0], [1004.0, 0.3, 0.0], [1000.0, 4.0, 0.7]];
/// let ray = Ray::new([1001.0, 1.0, 3.0], [0.1, 0.1, -10.0]);
/// # let scaled = ScaledRay::new(&ray).unwrap();
/// # let hit = Watertight::intersect(&Watertight::prepare(&scaled), &scaled, &vertices, scaled.t_max).unwrap();
/// # let hit = Hit { t: scaled.caller_t(hit.t), u: hit.u, v: hit.v, primitive: PrimId(0), instance: InstanceId(0), side: hit.side };
/// // `reach` is the greatest absolute coordinate of the mesh, as `Aabb::reach` of its bounds returns it.
/// let point = SurfacePoint::new(&hit, vertices, 1004.0);
/// let reflected = point.spawn_ray([0.1, 0.1, 10.0]);
/// let along_normal = point.spawn_ray_f64(point.normal);
/// let shadow = point.spawn_ray_to([1000.0, 0.0, 50.0]).unwrap();
/// assert!(point.normal[2] > 0.9 && reflected.origin[2] > point.position[2] as f32);
/// assert!(shadow.t_max < 1.0 && along_normal.origin == reflected.origin);
/// ```
///
/// The vertices come from the BVH that was hit (`triangle(hit.primitive)`), the reach from its bounds. Read both again after a
/// refit. The normal is that of the front side: for a point seen from the back (`hit.side`), negate it before you choose
/// directions around it. Rays may be shortened by a smaller `t_max`.
///
/// # Guarantee
/// A ray that continues from a point does not hit the triangle that it leaves, nor any triangle of the same mesh that
/// lies on the far side of that triangle's plane; that includes every neighbor across a convex edge. It holds for all
/// kernels, for a mesh traced as it is and for an instance, at every scale and distance from the origin. No constant of
/// length is involved: scaling by a power of two scales the rays bit for bit.
///
/// Geometry closer to the point than its `offset`, such as a coplanar triangle of another mesh or the other face of a
/// sharp wedge, is below what `f32` positions resolve and may be missed or hit. For a triangle whose height is less
/// than 2^-30 of its length the `f64` normal is too inexact to promise anything.
///
/// # Proof
/// Let `u = 2^-24`, `ρ` the greatest absolute vertex coordinate of the mesh, `M` and `T` the linear part and the
/// translation of `world_from_object`, `R_k = ρ·Σ_i |M_ki|`, and `W` the greatest `R_k + |T_k|`: no world coordinate of
/// the mesh exceeds `W`. The new origin is the hit point, which `f64` represents to one part in 2^50, moved along the
/// normal and rounded to `f32`: an error of `u·W` along each axis. Then, along each axis,
///
/// - a BVH over vertices rounded to world space adds `u·W` and accepts points within
///   `HIT_ERROR·(|o|∞ + ρ∞) <= HIT_ERROR·2W` of a triangle;
/// - a BVH over object-space vertices rounds origin and direction to object space. On the way to any point of the mesh
///   the ray moves at most `2ρ` along an object axis, so these errors are `u·ρ` and `u·2ρ`; it accepts points within
///   `HIT_ERROR·2ρ`. `M` takes the sum to at most `(2·HIT_ERROR + 3u)·R_k`.
///
/// In both cases the errors of origin and hit sum to at most `(2·HIT_ERROR + 4u)·W` along each axis
/// ([`position_error`]), hence to `|n_x| + |n_y| + |n_z|` times that along a unit normal `n`: the offset. A ray that
/// starts that far off the plane and leads away from it cannot hit what lies in the plane or behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point, computed from the barycentric coordinates: in the plane of its triangle up to a few roundings of `f64`.
    pub position: [f64; 3],
    /// Unit geometric normal on the front side, from which the triangle runs counter-clockwise; in a mirroring instance
    /// it is the image of the object-space normal.
    pub normal: [f64; 3],
    /// Distance from the triangle's plane at which rays start.
    pub offset: f64,
}

/// Covers second-order terms: roundings of `f64`, and origins that exceed `W` by the offset itself; all below 2^-16.
const SECOND_ORDER: f64 = 1.0 + 1.0 / 1024.0;

/// Error bound along each axis of a continued ray and its next hit, for a mesh whose world coordinates do not exceed
/// `reach_world` (`W` in the proof at [`SurfacePoint`]).
///
/// For an instance, [`Affine::reach`] returns `reach_world`; for one that moves linearly, take the greater of both ends.
#[must_use]
pub fn position_error(reach_world: f64) -> f64 {
    // The last term covers subnormal numbers, whose rounding is absolute.
    let u = f64::from(UNIT_ROUNDOFF);
    SECOND_ORDER * (2.0 * f64::from(HIT_ERROR) + 4.0 * u) * reach_world + f64::from(f32::MIN_POSITIVE)
}

impl SurfacePoint {
    /// The point of `hit` on the triangle with these vertices, in the space of a mesh that is traced as it is.
    ///
    /// `reach` is the greatest absolute coordinate of the whole mesh, e.g. [`canted_obb::Aabb::reach`] of its bounds. The
    /// vertices' own reach suffices where only the triangle itself must not be hit again. A triangle without area has the
    /// normal `[0, 0, 1]`.
    #[must_use]
    pub fn new(hit: &Hit, vertices: [impl Into<[f32; 3]>; 3], reach: f32) -> Self {
        let (position, normal) = on_triangle(hit, vertices);
        Self::with_error(position, unit(normal).unwrap_or(FALLBACK_NORMAL), position_error(f64::from(reach)))
    }

    /// The world-space point of `hit` on an instance, from the object-space vertices of the triangle.
    ///
    /// `reach_object` is the greatest absolute coordinate of the mesh in object space. The map must be invertible.
    #[must_use]
    pub fn in_instance(
        hit: &Hit,
        vertices_object: [impl Into<[f32; 3]>; 3],
        reach_object: f32,
        world_from_object: &Affine,
    ) -> Self {
        let columns = world_from_object.columns.map(to_f64);
        Self::under_map(hit, vertices_object, &columns, world_from_object.reach(reach_object))
    }

    /// As [`Self::in_instance`], under an invertible map of `f64` by its columns, such as that of a moving instance at a time.
    ///
    /// `reach_world` is the greatest absolute coordinate of the mesh in world space; of a moving instance, at all times.
    #[must_use]
    pub fn under_map(
        hit: &Hit,
        vertices_object: [impl Into<[f32; 3]>; 3],
        world_from_object: &[[f64; 3]; 4],
        reach_world: f64,
    ) -> Self {
        let (position, normal) = on_triangle(hit, vertices_object);
        let [x, y, z, translation] = *world_from_object;
        // The cofactors of the linear part take normals to world space; a mirror reverses them.
        let [a, b, c] = [cross(y, z), cross(z, x), cross(x, y)];
        let image = add(scale(a, normal[0]), add(scale(b, normal[1]), scale(c, normal[2])));
        let side = 1f64.copysign(dot(x, a));
        let normal = unit(image).map_or(FALLBACK_NORMAL, |normal| scale(normal, side));
        let linear: Vector = core::array::from_fn(|k| x[k] * position[0] + y[k] * position[1] + z[k] * position[2]);
        Self::with_error(add(linear, translation), normal, position_error(reach_world))
    }

    /// A point of a surface with this unit normal, from [`position_error`].
    #[inline]
    #[must_use]
    pub fn with_error(position: [f64; 3], normal: [f64; 3], error: f64) -> Self {
        Self { position, normal, offset: error * normal.iter().map(|x| x.abs()).sum::<f64>() }
    }

    /// A ray without end along `direction`, from the side of the surface that `direction` points to.
    #[inline]
    #[must_use]
    pub fn spawn_ray(&self, direction: impl Into<[f32; 3]>) -> Ray {
        self.spawn_ray_f64(to_f64(direction.into()))
    }

    /// [`SurfacePoint::spawn_ray`] along a direction of `f64`, such as one computed from [`SurfacePoint::normal`]; it is rounded.
    #[inline]
    #[must_use]
    pub fn spawn_ray_f64(&self, direction: [f64; 3]) -> Ray {
        Ray::new(self.origin_toward(direction), to_f32(direction))
    }

    /// A ray that ends just before `target`, for shadow rays: its direction spans the whole distance and its `t_max` is
    /// below 1. `None` where the target is too close to distinguish from the point.
    ///
    /// The gap at the end is this point's offset and four roundings of the direction, so a surface through `target`
    /// does not count as a blocker as long as its own offset is not larger. Where it may be, as for a target far from
    /// the origin, use [`Self::spawn_ray_to_point`].
    #[must_use]
    pub fn spawn_ray_to(&self, target: impl Into<[f32; 3]>) -> Option<Ray> {
        let target = to_f64(target.into());
        let origin = self.origin_toward(sub(target, self.position));
        let span = sub(target, to_f64(origin));
        let gap = self.offset / length(span) + 2.0 * f64::from(f32::EPSILON);
        // False for a span of length zero, whose gap is infinite or NaN.
        (gap < 1.0).then(|| {
            let t_max = (1.0 - gap) as f32;
            Ray { t_max, ..Ray::new(origin, to_f32(span)) }
        })
    }

    /// A ray between two surfaces that ends before `target` by the offsets of both; otherwise as [`Self::spawn_ray_to`].
    #[must_use]
    pub fn spawn_ray_to_point(&self, target: &Self) -> Option<Ray> {
        self.spawn_ray_to(target.origin_toward(sub(self.position, target.position)))
    }

    /// Where a ray along `direction` starts: `offset` off the plane, on the side that `direction` points to.
    #[inline]
    #[must_use]
    pub fn origin_toward(&self, direction: [f64; 3]) -> [f32; 3] {
        let side = self.offset.copysign(dot(self.normal, direction));
        to_f32(add(self.position, scale(self.normal, side)))
    }
}

const FALLBACK_NORMAL: Vector = [0.0, 0.0, 1.0];

/// Position and normal, of any length, of a hit.
fn on_triangle(hit: &Hit, vertices: [impl Into<[f32; 3]>; 3]) -> (Vector, Vector) {
    let [a, b, c] = vertices.map(|vertex| to_f64(vertex.into()));
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    let w = 1.0 - u - v;
    (core::array::from_fn(|k| w * a[k] + u * b[k] + v * c[k]), cross(sub(b, a), sub(c, a)))
}
