//! Surfaces of curves: points, normals and tangents of tubes and ribbons.
//!
//! A hit states how far along a curve it is. The point of a tube is that of the ray, moved onto the ball that touches the surface
//! there, in object space and f64: rounding `t` moves it along the surface only. The point of a ribbon is that of the line as far along the ray as the
//! center.
//!
//! A ribbon faces every ray, so also the next one from a point on it, which it would hit again. So rays leave a ribbon from half its width in front of it or
//! behind it, and no ray to that side hits the same straight part.

use canted_scene::{CurveSegments, CurveShape, Curves, Mesh};
use canted_trace::{Hit, Ray, RoundCubic, Side};
use glam::DVec3;

use super::hit_triangle::Pose;
use super::shading_normal::facing;
use super::{Surface, Surfaces, bsdf};
use crate::{Cone, Hair, wide};

/// A point of a curve, object space.
struct CurvePoint {
    position: DVec3,
    /// Outward, of any length; of a ribbon on either side.
    normal: DVec3,
    /// Along the curve, the derivative by the parameter of the segment; zero for a ball.
    tangent: DVec3,
    /// To the right, as long as the radius; zero for a ball, and where the ray looks along the curve.
    right: DVec3,
    /// Position across, 0..=1 from left to right.
    across: f64,
    /// Linear RGBA of the points around.
    color: [f32; 4],
}

impl Surfaces<'_> {
    /// The surface of a curve at a hit.
    pub(super) fn on_curve(&self, hit: &Hit, ray: &Ray, cone: Cone, mesh: &Mesh, curves: &Curves) -> Surface {
        let placement = &self.placements[hit.instance.0 as usize];
        let pose = placement.pose(ray.time);
        let direction = wide(ray.direction);
        let towards_viewer = -direction;
        let travelled = f64::from(hit.t) * direction;
        let near = object_from_world(&pose, wide(ray.origin) + travelled - pose.columns[3]);
        let material = self.material(mesh.material_of(hit.primitive.0));
        let mut point = point(mesh, curves, hit, near, object_from_world(&pose, direction));
        let mut offset = 0.0;
        if curves.shape == CurveShape::Ribbon {
            offset = pose.vector_world(point.right).length();
            if material.hair.is_some() {
                // Hair scatters as the fiber that has this silhouette.
                let (sine, right) = (2.0 * point.across - 1.0, point.right.normalize_or_zero());
                let towards = facing(point.normal.normalize_or_zero(), object_from_world(&pose, towards_viewer));
                point.normal = sine * right + (1.0 - sine * sine).max(0.0).sqrt() * towards;
            }
        }
        // The cofactors of a mirroring transform turn normals around.
        let outward = pose.normal_world(point.normal) * if placement.is_mirrored() { -1.0 } else { 1.0 };
        let outward = outward.try_normalize().or_else(|| towards_viewer.try_normalize()).unwrap_or(DVec3::Z);
        let normal = facing(outward, towards_viewer);
        let is_front = hit.side == Side::Front;
        let along = pose.vector_world(point.tangent);
        let mut bsdf = bsdf(material, point.color, is_front, |_| [1.0; 4]);
        bsdf.hair = material.hair.as_ref().map(|hair| Hair::new(hair, bsdf.base_color, material.ior));
        Surface {
            position: pose.point_world(point.position).into(),
            normal: normal.into(),
            shading_normal: normal.into(),
            smooth: None,
            is_front,
            bsdf,
            along: (along != DVec3::ZERO).then(|| along.into()),
            emission: material.emission,
            offset: placement.offset(normal) + offset,
            cone: cone.grown(travelled.length()),
            time: ray.time,
        }
    }
}

/// The inverse of [`Pose::vector_world`].
fn object_from_world(pose: &Pose, vector: DVec3) -> DVec3 {
    let [yz, zx, xy] = pose.cofactor;
    DVec3::new(vector.dot(yz), vector.dot(zx), vector.dot(xy)) / pose.columns[0].dot(yz)
}

/// The point of the surface next to `near`, a point of a ray along `direction`.
fn point(mesh: &Mesh, curves: &Curves, hit: &Hit, near: DVec3, direction: DVec3) -> CurvePoint {
    let Curves { radii, segments, shape } = curves;
    let index = hit.primitive.index();
    let u = f64::from(hit.u);
    let (ball, slope, weights) = match segments {
        CurveSegments::Linear(list) => {
            let [a, b] = list[index].map(|i| i as usize);
            let (from, to) = (wide(mesh.positions[a]), wide(mesh.positions[b]));
            let (r, s) = (f64::from(radii[a]), f64::from(radii[b]));
            // The position is rounded to f32: the one of the ball that touches a cone at the point is computed again.
            let (axis, narrowing) = (to - from, r - s);
            let square = axis.length_squared() - narrowing * narrowing;
            let exact = ((near - from).dot(axis) - r * narrowing) / square;
            let is_cone = *shape == CurveShape::Tube && square > 0.0 && 0.0 < u && u < 1.0;
            let u = if is_cone { exact.clamp(0.0, 1.0) } else { u };
            ((from + axis * u, r - narrowing * u), axis, [(a, 1.0 - u), (b, u), (a, 0.0), (a, 0.0)])
        }
        CurveSegments::Cubic(list) => {
            let points = list[index].map(|i| i as usize);
            let curve = RoundCubic { points: points.map(|i| mesh.positions[i]), radii: points.map(|i| radii[i]) };
            let ([x, y, z, radius], [dx, dy, dz, _]) = curve.ball(u);
            let v = 1.0 - u;
            let weights = [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u];
            let weights = [0, 1, 2, 3].map(|k| (points[k], weights[k]));
            ((DVec3::new(x, y, z), radius), DVec3::new(dx, dy, dz), weights)
        }
    };
    let (center, radius) = ball;
    let color = mesh.colors.as_ref().map_or([1.0; 4], |colors| {
        std::array::from_fn(|k| weights.iter().map(|&(i, weight)| f64::from(colors[i][k]) * weight).sum::<f64>() as f32)
    });
    let right = direction.cross(slope).normalize_or_zero();
    if *shape == CurveShape::Ribbon {
        let off = near - center;
        let aside = off - direction * (off.dot(direction) / direction.length_squared());
        // A disk faces the ray.
        let normal = if right == DVec3::ZERO { -direction } else { slope.cross(right) };
        let across = f64::from(hit.v);
        return CurvePoint { position: center + aside, normal, tangent: slope, right: right * radius, across, color };
    }
    let normal = (near - center).try_normalize().unwrap_or(DVec3::Z);
    let across = 0.5 + 0.5 * normal.dot(right);
    CurvePoint { position: center + normal * radius, normal, tangent: slope, right: right * radius, across, color }
}
