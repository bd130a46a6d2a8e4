//! Surfaces of curves: points, normals, tangents and texture coordinates of tubes, ribbons and patches.
//!
//! A hit states how far along a curve it is. The point of a tube is that of the ray, moved onto the ball that touches the surface
//! there, in object space and f64: rounding `t` moves it along the surface only. The point of a ribbon is that of the line as far along the ray as the
//! center.
//!
//! A ribbon faces every ray, so also the next one from a point on it, which it would hit again. So rays leave a ribbon from half its width in front of it or
//! behind it, and no ray to that side hits the same straight part.
//!
//! Texture coordinates: `u` along the strand, from 0 to 1, in proportion to length ([`Mesh::strand_coordinates`]); `v` across, from 0 at the left edge to 1 at the
//! right one, as the ray sees a curve that leads upward. A tube has no edges, so its `v` is that of its silhouette. Those of a patch are its parameters.

use canted_scene::{CurveSegments, CurveShape, Curves, Material, Mesh, TextureRef};
use canted_trace::{BezierPatch, Hit, Ray, RoundCubic, Side, position_at};
use glam::DVec3;

use super::hit_triangle::Pose;
use super::shading_normal::facing;
use super::{Surface, Surfaces, bsdf};
use crate::texture::{Footprint, Plane, filtered_textures};
use crate::{Cone, Hair, Lod, wide};

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
        let mut point = point(mesh, curves, hit, near, object_from_world(&pose, direction), ray.time);
        let mut offset = 0.0;
        let is_patch = mesh.has_patches();
        if curves.shape == CurveShape::Ribbon && !is_patch {
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
        let cone = cone.grown(travelled.length());
        let uvs = self.strands[self.mesh_of(hit)].as_ref().map(|strands| strands[hit.primitive.index()]);
        let texel = |slot: &Option<TextureRef>| {
            let texel = slot.as_ref().zip(uvs).map(|(slot, along_strand)| {
                let edges = [along, 2.0 * pose.vector_world(point.right)];
                self.texel_of_curve(slot, along_strand, [hit.u.into(), point.across], edges, direction, cone)
            });
            texel.unwrap_or([1.0; 4])
        };
        let mut bsdf = bsdf(material, point.color, is_front, texel);
        bsdf.hair =
            material.hair.as_ref().filter(|_| !is_patch).map(|hair| Hair::new(hair, bsdf.base_color, material.ior));
        let emission_texel = if material.is_emissive() { texel(&material.emission_texture) } else { [1.0; 4] };
        Surface {
            position: pose.point_world(point.position).into(),
            normal: normal.into(),
            shading_normal: normal.into(),
            smooth: None,
            is_front,
            bsdf,
            along: (along != DVec3::ZERO).then(|| along.into()),
            emission: std::array::from_fn(|k| material.emission[k] * emission_texel[k]),
            offset: placement.offset(normal) + offset,
            cone,
            time: ray.time,
        }
    }

    /// The value of a texture on a curve. `edges` lead along the whole segment and across the whole width, world space.
    fn texel_of_curve(
        &self,
        slot: &TextureRef,
        [from, to]: [f32; 2],
        [u, v]: [f64; 2],
        edges: [DVec3; 2],
        direction: DVec3,
        cone: Cone,
    ) -> [f32; 4] {
        let map = |uv| slot.texture_from_mesh.point(uv);
        let [from, to] = [from, to].map(f64::from);
        let uv = self.point_of_texture(slot, [from + u * (to - from), v]);
        let (mip_map, normal) = (self.textures.get(slot.texture), edges[0].cross(edges[1]));
        let footprint = if self.lod == Lod::None || cone.is_zero() || normal == DVec3::ZERO {
            Footprint::POINT
        } else {
            let origin = map([0.0; 2]);
            let along = [[to - from, 0.0], [0.0, 1.0]].map(map).map(|end| [end[0] - origin[0], end[1] - origin[1]]);
            Footprint::new(self.lod, &cone, direction, &Plane { edges, normal }, along, mip_map.size())
        };
        mip_map.lookup(uv, &footprint)
    }

    /// Where the texture has coordinates of a curve, at least half a texel from the ends and edges of the strand: beyond, a texture that repeats is a
    /// mixture of both, which the round ends of tubes would show.
    fn point_of_texture(&self, slot: &TextureRef, uv: [f64; 2]) -> [f64; 2] {
        let map = |uv| slot.texture_from_mesh.point(uv);
        let (size, origin) = (self.textures.get(slot.texture).size(), map([0.0; 2]));
        map(std::array::from_fn(|axis| {
            let end = map(std::array::from_fn(|k| if k == axis { 1.0 } else { 0.0 }));
            let texels = (0..2).map(|k| (size[k] * (end[k] - origin[k])).abs()).fold(1.0, f64::max);
            uv[axis].clamp(0.5 / texels, 1.0 - 0.5 / texels)
        }))
    }

    /// Alpha of a curve at a hit, from textures at full resolution. The direction of the ray is not known here, so tubes are looked up in the middle of `v`.
    pub(super) fn alpha_of_curve(&self, hit: &Hit, material: &Material, curves: &Curves) -> f32 {
        let texture = material.alpha_texture.as_ref().and_then(|slot| {
            let [from, to] = self.strands[self.mesh_of(hit)].as_ref()?[hit.primitive.index()];
            let has_width = curves.shape == CurveShape::Ribbon || matches!(curves.segments, CurveSegments::Patches(_));
            let v = if has_width { hit.v } else { 0.5 };
            let uv = [from + hit.u * (to - from), v].map(f64::from);
            Some(self.textures.get(slot.texture).alpha(self.point_of_texture(slot, uv)))
        });
        material.alpha * texture.unwrap_or(1.0)
    }

    fn mesh_of(&self, hit: &Hit) -> usize {
        self.scene.instances[hit.instance.0 as usize].mesh.0 as usize
    }
}

/// The positions along strands of a mesh of curves, for textures; `None` without textures, or without curves.
pub(super) fn strands(mesh: &Mesh, materials: &[Material]) -> Option<Vec<[f32; 2]>> {
    let is_textured = mesh.parts.iter().any(|part| {
        let material = &materials[part.material.0 as usize];
        material.alpha_texture.is_some() || filtered_textures(material).next().is_some()
    });
    (mesh.curves.is_some() && is_textured).then(|| mesh.strand_coordinates())
}

/// The inverse of [`Pose::vector_world`].
fn object_from_world(pose: &Pose, vector: DVec3) -> DVec3 {
    let [yz, zx, xy] = pose.cofactor;
    DVec3::new(vector.dot(yz), vector.dot(zx), vector.dot(xy)) / pose.columns[0].dot(yz)
}

/// The position and radius of a point of curves at a time, as the BVH has them.
fn ball_at(mesh: &Mesh, radii: &[f32], i: usize, time: f32) -> ([f32; 3], f32) {
    let Some(close) = &mesh.close else { return (mesh.positions[i], radii[i]) };
    let close_radius = close.radii.as_deref().unwrap_or(radii)[i];
    let [radius, ..] = position_at(&[radii[i]; 3], &[close_radius; 3], time);
    (position_at(&mesh.positions[i], &close.positions[i], time), radius)
}

/// The patch with these control points at a time.
fn patch(mesh: &Mesh, radii: &[f32], indices: &[u32; 16], time: f32) -> BezierPatch {
    let row = |i: usize| [0, 1, 2, 3].map(|j| ball_at(mesh, radii, indices[4 * i + j] as usize, time).0);
    BezierPatch { points: [row(0), row(1), row(2), row(3)] }
}

/// The point of a patch at a hit, and its unit normal on the front, object space; `None` for other meshes.
pub(super) fn point_of_patch(mesh: &Mesh, hit: &Hit, time: f32) -> Option<(DVec3, DVec3)> {
    let Some(Curves { segments: CurveSegments::Patches(list), radii, .. }) = &mesh.curves else { return None };
    let indices = &list[hit.primitive.index()];
    let CurvePoint { position, normal, .. } = on_patch(mesh, patch(mesh, radii, indices, time), indices, hit);
    Some((position, normal))
}

/// A point of a patch: its tangent is the derivative by `u`, and what leads right half of that by `v`.
fn on_patch(mesh: &Mesh, patch: BezierPatch, indices: &[u32; 16], hit: &Hit) -> CurvePoint {
    let at = [hit.u, hit.v].map(f64::from);
    let [position, by_u, by_v] = patch.at(at);
    let normal = patch.normal(at).map_or(DVec3::Z, DVec3::from);
    let [of_u, of_v] = at.map(|s| {
        let r = 1.0 - s;
        [r * r * r, 3.0 * s * r * r, 3.0 * s * s * r, s * s * s]
    });
    let weights: [(usize, f64); 16] = std::array::from_fn(|k| (indices[k] as usize, of_u[k / 4] * of_v[k % 4]));
    let (tangent, right) = (DVec3::from(by_u), 0.5 * DVec3::from(by_v));
    CurvePoint { position: position.into(), normal, tangent, right, across: at[1], color: mixed_color(mesh, &weights) }
}

/// The mean color of points with these weights.
fn mixed_color(mesh: &Mesh, weights: &[(usize, f64)]) -> [f32; 4] {
    mesh.colors.as_ref().map_or([1.0; 4], |colors| {
        std::array::from_fn(|k| weights.iter().map(|&(i, weight)| f64::from(colors[i][k]) * weight).sum::<f64>() as f32)
    })
}

/// The point of the surface next to `near`, a point of a ray along `direction`.
fn point(mesh: &Mesh, curves: &Curves, hit: &Hit, near: DVec3, direction: DVec3, time: f32) -> CurvePoint {
    let Curves { radii, segments, shape } = curves;
    let ball = |i: usize| ball_at(mesh, radii, i, time);
    let index = hit.primitive.index();
    let u = f64::from(hit.u);
    let ((center, radius), slope, weights) = match segments {
        CurveSegments::Patches(list) => {
            return on_patch(mesh, patch(mesh, radii, &list[index], time), &list[index], hit);
        }
        CurveSegments::Linear(list) => {
            let [a, b] = list[index].map(|i| i as usize);
            let ((from, r), (to, s)) = (ball(a), ball(b));
            let (from, to, r, s) = (wide(from), wide(to), f64::from(r), f64::from(s));
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
            let balls = points.map(ball);
            let curve = RoundCubic { points: balls.map(|(point, _)| point), radii: balls.map(|(_, radius)| radius) };
            let ([x, y, z, radius], [dx, dy, dz, _]) = curve.ball(u);
            let v = 1.0 - u;
            let weights = [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u];
            let weights = [0, 1, 2, 3].map(|k| (points[k], weights[k]));
            ((DVec3::new(x, y, z), radius), DVec3::new(dx, dy, dz), weights)
        }
    };
    let color = mixed_color(mesh, &weights);
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
