//! Emissive triangles: all that do not move, sampled by solid angle; twin of `shared/light/triangle.wgsl`.

use std::collections::HashMap;

#[cfg(feature = "gpu")]
use bytemuck::{Pod, Zeroable};
use canted_film::srgb::{self, luminance};
use canted_obb::PrimId;
use canted_scene::{Encoding, Material, Scene, Texture, TextureRef};
use canted_trace::{Hit, InstanceId, Side};
use glam::DVec3;

use super::disk::{area_density, plane_density};
use super::tree::{Cluster, Cone};
use super::{IncomingLight, LightId};
use crate::{Surface, Surfaces, narrow, wide};

/// An emissive triangle that does not move.
#[derive(Clone, Copy, Debug)]
struct Emitter {
    instance: InstanceId,
    primitive: PrimId,
    /// World space.
    corners: [[f32; 3]; 3],
}

/// All emissive triangles that do not move while the shutter is open, ordered by instance and primitive.
///
/// Triangles of moving instances and deforming meshes are not sampled, because their position depends on the time of the ray. Only BSDF
/// sampling finds them.
pub(crate) struct Emitters<'a> {
    surfaces: &'a Surfaces<'a>,
    list: Vec<Emitter>,
}

impl<'a> Emitters<'a> {
    /// The emitters, and the light bounds of each.
    pub(super) fn new(surfaces: &'a Surfaces<'a>) -> (Self, Vec<Cluster>) {
        let scene = surfaces.scene();
        let radiances = mean_radiances(scene);
        let (mut list, mut clusters) = (Vec::new(), Vec::new());
        for (number, instance) in (0..).map(InstanceId).zip(&scene.instances) {
            let mesh = &scene.meshes[instance.mesh.0 as usize];
            let moves = instance.world_from_object_close.is_some_and(|close| close != instance.world_from_object);
            if moves || mesh.close.is_some() {
                continue;
            }
            for (i, part) in mesh.parts.iter().enumerate() {
                let radiance = radiances[part.material.0 as usize];
                if !(radiance > 0.0 && radiance.is_finite()) {
                    continue;
                }
                let start = part.first_triangle as usize;
                let end = mesh.parts.get(i + 1).map_or(mesh.triangles.len(), |next| next.first_triangle as usize);
                for (primitive, triangle) in
                    (part.first_triangle..).map(PrimId).zip(mesh.triangles.get(start..end).unwrap_or_default())
                {
                    let corner = |i: u32| instance.world_from_object.point(mesh.positions[i as usize]);
                    let corners = triangle.map(corner);
                    let Some(triangle_light) = TriangleLight::new(corners) else { continue };
                    list.push(Emitter { instance: number, primitive, corners });
                    clusters.push(Cluster::of_points(
                        corners.map(wide),
                        Cone::about(triangle_light.normal, true),
                        triangle_light.area * radiance,
                    ));
                }
            }
        }
        (Self { surfaces, list }, clusters)
    }

    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    pub(super) fn id(&self, number: usize) -> LightId {
        LightId::Triangle(self.list[number].instance, self.list[number].primitive)
    }

    /// Index of the emitter that was hit; `None` if it moves, has no area or is black.
    pub(super) fn find(&self, instance: InstanceId, primitive: PrimId) -> Option<usize> {
        self.list.binary_search_by_key(&(instance, primitive), |emitter| (emitter.instance, emitter.primitive)).ok()
    }

    /// Samples a point of an emitter; `None` if that point is black or transparent.
    pub(super) fn sample(&self, number: usize, from: &Surface, square: [f32; 2]) -> Option<IncomingLight> {
        let Emitter { instance, primitive, corners } = self.list[number];
        let triangle_light = TriangleLight::new(corners)?;
        let ([u, v], density) = triangle_light.sample(from.position.into(), square)?;
        let target = triangle_light.point([u, v]);
        let to_light = (target - DVec3::from(from.position)).try_normalize()?;
        let hit = Hit { t: 1.0, u: u as f32, v: v as f32, primitive, instance, side: Side::Front };
        let radiance = self.radiance(&hit, narrow(to_light))?;
        // The ray ends at the offset of rays that leave the emitter, so that rounding never puts its end behind the
        // emitter.
        let normal = triangle_light.normal_towards(from.position.into());
        let off = target + normal * self.surfaces.offset(instance, normal);
        Some(IncomingLight {
            to_light,
            radiance: radiance * (1.0 / density),
            density: Some(density),
            shadow_ray: from.spawn_ray_to(narrow(off)),
        })
    }

    /// PDF per steradian of [`Self::sample`] for a unit direction that hits the emitter.
    pub(super) fn density(&self, number: usize, from: DVec3, direction: DVec3) -> f64 {
        TriangleLight::new(self.list[number].corners).map_or(0.0, |light| light.density(from, direction))
    }

    fn material(&self, instance: InstanceId, primitive: PrimId) -> &'a Material {
        let scene = self.surfaces.scene();
        let mesh = &scene.meshes[scene.instances[instance.0 as usize].mesh.0 as usize];
        &scene.materials[mesh.material_of(primitive.0).0 as usize]
    }

    /// The radiance of a point of an emitter, or what of it passes its alpha; `None` if black.
    fn radiance(&self, hit: &Hit, direction: [f32; 3]) -> Option<DVec3> {
        let material = self.material(hit.instance, hit.primitive);
        // With stochastic alpha, light sampling must carry the fraction of rays that would hit the surface.
        let presence = if material.uses_alpha() { self.surfaces.presence(hit) } else { 1.0 };
        let radiance = match material.emission_texture {
            None => material.emission,
            Some(_) => self.surfaces.at(hit, direction).emission,
        };
        (presence > 0.0 && radiance.iter().any(|&x| x > 0.0)).then(|| wide(radiance) * f64::from(presence))
    }
}

/// `Emitter` of `shared/light/triangle`, which documents the members.
#[cfg(feature = "gpu")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct PackedEmitter {
    pub(crate) corner: [f32; 3],
    pub(crate) instance: u32,
    pub(crate) first: [f32; 3],
    pub(crate) primitive: u32,
    pub(crate) second: [f32; 3],
    pub(crate) leaf: u32,
    pub(crate) radiance: [f32; 3],
    pub(crate) slack: f32,
}

#[cfg(feature = "gpu")]
impl Emitters<'_> {
    /// Whether the radiance of any emitter varies over its surface.
    pub(crate) fn are_textured(&self) -> bool {
        let mut materials = self.list.iter().map(|emitter| self.material(emitter.instance, emitter.primitive));
        materials.any(|material| material.uses_alpha() || material.emission_texture.is_some())
    }

    /// The emitters on the GPU, with their leaves in the light tree; `slack` is the ray offset of an instance per axis.
    pub(crate) fn packed(&self, leaves: &[u32], slack: impl Fn(InstanceId) -> f32) -> Vec<PackedEmitter> {
        let packed = self.list.iter().zip(leaves).map(|(emitter, &leaf)| {
            let [a, b, c] = emitter.corners.map(wide);
            PackedEmitter {
                corner: emitter.corners[0],
                instance: emitter.instance.0,
                first: narrow(b - a),
                primitive: emitter.primitive.0,
                second: narrow(c - a),
                leaf,
                radiance: super::bounded(self.material(emitter.instance, emitter.primitive).emission),
                slack: slack(emitter.instance),
            }
        });
        packed.collect()
    }
}

/// Mean luminance of each material's emission over its texture.
fn mean_radiances(scene: &Scene) -> Vec<f64> {
    // Many materials may share one large texture.
    let mut means = HashMap::new();
    let mut mean_radiance = |material: &Material| {
        let tint = material.emission_texture.as_ref().map_or(DVec3::ONE, |TextureRef { texture, .. }| {
            *means.entry(*texture).or_insert_with(|| mean_texel(&scene.textures[texture.0 as usize]))
        });
        let emission = wide(material.emission);
        luminance((emission * tint).into())
    };
    scene.materials.iter().map(|material| if material.is_emissive() { mean_radiance(material) } else { 0.0 }).collect()
}

/// Mean of all texels, linear RGB; white for a texture without texels.
fn mean_texel(texture: &Texture) -> DVec3 {
    let mut counts = [[0_u32; 256]; 3];
    for texel in &texture.texels {
        for (counts, byte) in counts.iter_mut().zip(texel) {
            counts[usize::from(*byte)] += 1;
        }
    }
    let value = |byte: u8| match texture.encoding {
        Encoding::Srgb => f64::from(srgb::decode(byte)),
        Encoding::Linear => f64::from(byte) / 255.0,
    };
    let means = counts.map(|counts| {
        let sum: f64 = (0..=255).zip(counts).map(|(byte, n)| value(byte) * f64::from(n)).sum();
        let n: f64 = counts.into_iter().map(f64::from).sum();
        if n > 0.0 { sum / n } else { 1.0 }
    });
    means.into()
}

/// A triangle that emits on both sides, world space.
#[derive(Clone, Copy)]
struct TriangleLight {
    corners: [DVec3; 3],
    /// Unit vector.
    normal: DVec3,
    area: f64,
}

impl TriangleLight {
    /// `None` for a triangle without area.
    fn new(corners: [[f32; 3]; 3]) -> Option<Self> {
        let corners = corners.map(wide);
        let perpendicular = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let twice_area = perpendicular.length();
        (twice_area > 0.0 && twice_area.is_finite()).then(|| Self {
            corners,
            normal: perpendicular * (1.0 / twice_area),
            area: 0.5 * twice_area,
        })
    }

    /// Samples a point: the weights of the second and third corner, and the PDF per steradian at `from`.
    ///
    /// Uniform over the solid angle, or over the area if both are nearly the same.
    fn sample(&self, from: DVec3, square: [f32; 2]) -> Option<([f64; 2], f64)> {
        let square = square.map(f64::from);
        if let Some(spherical) = SphericalTriangle::new(self.corners, from) {
            let weights = self.weights_along(from, spherical.sample(square)?)?;
            return Some((weights, 1.0 / spherical.solid_angle));
        }
        let weights = uniform_weights(square);
        let density = area_density(self.point(weights) - from, self.normal, self.area)?;
        Some((weights, density))
    }

    /// PDF per steradian of [`Self::sample`] for a unit direction from `from` that hits the triangle.
    fn density(&self, from: DVec3, direction: DVec3) -> f64 {
        match SphericalTriangle::new(self.corners, from) {
            Some(spherical) => 1.0 / spherical.solid_angle,
            None => plane_density(from, direction, self.corners[0], self.normal, self.area).unwrap_or(0.0),
        }
    }

    /// Weights of the point that a direction from `from` hits, clamped to the triangle.
    fn weights_along(&self, from: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let [a, b, c] = self.corners;
        let distance = (a - from).dot(self.normal) / direction.dot(self.normal);
        let from_a = from + direction * distance - a;
        let weight = |perpendicular: DVec3| (perpendicular.dot(self.normal) / (2.0 * self.area)).clamp(0.0, 1.0);
        let u = weight(from_a.cross(c - a));
        let v = weight((b - a).cross(from_a)).min(1.0 - u);
        // NaN if the plane is seen edge-on.
        (u + v <= 1.0).then_some([u, v])
    }

    fn point(&self, [u, v]: [f64; 2]) -> DVec3 {
        let [a, b, c] = self.corners;
        a * (1.0 - u - v) + (b * u + c * v)
    }

    /// The normal on the side of `from`.
    fn normal_towards(&self, from: DVec3) -> DVec3 {
        let side = self.normal.dot(from - self.corners[0]);
        self.normal * 1.0_f64.copysign(side)
    }
}

/// Barycentric weights of two corners, uniform over the triangle, from a point of the unit square.
///
/// The square is folded along its diagonal, which distorts strata less than the square-root map (Heitz 2019, *A
/// Low-Distortion Map Between Triangle and Square*).
fn uniform_weights([x, y]: [f64; 2]) -> [f64; 2] {
    if x < y { [0.5 * x, y - 0.5 * x] } else { [x - 0.5 * y, 0.5 * y] }
}

/// A triangle projected onto the unit sphere around a point.
struct SphericalTriangle {
    corners: [DVec3; 3],
    solid_angle: f64,
}

/// Solid angles that are sampled uniformly, in steradians.
///
/// Below, uniform area sampling is about as good and cheaper. Above, the triangle covers nearly a hemisphere, and the
/// formulas divide by the sine of an angle close to π.
const SAMPLED: std::ops::Range<f64> = 1e-4..6.2;

impl SphericalTriangle {
    /// `None` if uniform area sampling is used instead.
    fn new(corners: [DVec3; 3], from: DVec3) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| (corner - from).try_normalize());
        let (a, b, c) = (a?, b?, c?);
        // Van Oosterom and Strackee 1983.
        let triple = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * triple.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        SAMPLED.contains(&solid_angle).then_some(Self { corners: [a, b, c], solid_angle })
    }

    /// Samples a unit direction uniformly over the solid angle. Source: Arvo 1995, *Stratified Sampling of Spherical
    /// Triangles*.
    ///
    /// `None` for a degenerate triangle.
    fn sample(&self, [x, y]: [f64; 2]) -> Option<DVec3> {
        let [a, b, c] = self.corners;
        let (side_b, side_c) = (c.cross(a).try_normalize()?, a.cross(b).try_normalize()?);
        // The angle at `a`.
        let cos_alpha = -side_b.dot(side_c);
        let sin_alpha = ((1.0 - cos_alpha) * (1.0 + cos_alpha)).max(0.0).sqrt();
        // Find c' on the arc from a to c, so that the triangle a, b, c' has the fraction x of the solid angle.
        let alpha = cos_alpha.clamp(-1.0, 1.0).acos();
        let (s, t) = (x * self.solid_angle - alpha).sin_cos();
        let (u, v) = (t - cos_alpha, s + sin_alpha * a.dot(b));
        let cosine = ((v * t - u * s) * cos_alpha - v) / ((v * s + u * t) * sin_alpha);
        let third = along(a, c, cosine)?;
        // Then a point on the arc from b to c'.
        along(b, third, 1.0 - y * (1.0 - third.dot(b)))
    }
}

/// The unit vector on the arc from `from` towards `to`, at a cosine to `from`.
fn along(from: DVec3, to: DVec3, cosine: f64) -> Option<DVec3> {
    if cosine.is_nan() {
        return None;
    }
    let cosine = cosine.clamp(-1.0, 1.0);
    // No arc if both coincide.
    let perpendicular = (to - from * to.dot(from)).try_normalize().unwrap_or(DVec3::ZERO);
    Some(from * cosine + perpendicular * ((1.0 - cosine) * (1.0 + cosine)).sqrt())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// An octant has a solid angle of π/2, half of it π/4.
    #[test]
    fn known_solid_angles() {
        let octant = [DVec3::X * 3.0, DVec3::Y * 0.5, DVec3::Z];
        let half = [octant[0], octant[1], DVec3::new(0.0, 0.5, 0.5)];
        for (corners, expected) in [(octant, PI / 2.0), (half, PI / 4.0)] {
            let triangle = SphericalTriangle::new(corners, DVec3::ZERO).unwrap();
            assert!((triangle.solid_angle - expected).abs() < 1e-14);
        }
        assert!(SphericalTriangle::new(octant, DVec3::splat(-1000.0)).is_none());
        assert!(SphericalTriangle::new(octant, octant[0]).is_none());
    }

    /// Samples fall into each of three parts of a triangle in proportion to its solid angle.
    #[test]
    fn samples_are_uniform_over_solid_angle() {
        let from = DVec3::new(0.2, -0.1, 0.3);
        for corners in [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[5.0, 0.0, -1.0], [0.3, 0.4, 0.0], [0.0, -2.0, 0.1]],
            [[9.0, 0.0, 0.0], [9.0, 1.0, 0.0], [9.0, 0.5, 0.2]],
        ] {
            let corners = corners.map(DVec3::from);
            let triangle = SphericalTriangle::new(corners, from).unwrap();
            let center = 0.2 * corners[0] + 0.3 * corners[1] + 0.5 * corners[2];
            let part_of = |p: DVec3| (0..3).find(|&k| is_inside([corners[k], corners[(k + 1) % 3], center], from, p));
            const N: u32 = 400;
            let mut counts = [0.0; 3];
            for i in 0..N {
                for j in 0..N {
                    let square = [i, j].map(|x| (f64::from(x) + 0.5) / f64::from(N));
                    let direction = triangle.sample(square).unwrap();
                    assert!((direction.dot(direction) - 1.0).abs() < 1e-9);
                    if let Some(k) = part_of(direction) {
                        counts[k] += 1.0 / f64::from(N * N);
                    }
                }
            }
            for (k, count) in counts.into_iter().enumerate() {
                let part = SphericalTriangle::new([corners[k], corners[(k + 1) % 3], center], from).unwrap();
                let expected = part.solid_angle / triangle.solid_angle;
                assert!((count - expected).abs() < 4.0 / f64::from(N), "{corners:?} {k}: {count} {expected}");
            }
        }
    }

    /// Whether a direction points into a triangle.
    fn is_inside(corners: [DVec3; 3], from: DVec3, direction: DVec3) -> bool {
        let [a, b, c] = corners.map(|corner| corner - from);
        let [x, y, z] = [a.cross(b), b.cross(c), c.cross(a)].map(|normal| normal.dot(direction) >= 0.0);
        x == y && y == z
    }
}
