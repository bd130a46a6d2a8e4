//! The shading normal.
//!
//! # Tangent frame
//!
//! In a normal map, `x` points along increasing `u`, `y` along increasing `v` and `z` along the shading normal.
//! Tangents are transformed by the matrix itself, the normal by its inverse transpose. Tangents come from the vertices
//! if the file has them, with the sign for `normal × tangent`; otherwise they are the gradients of the triangle's
//! texture coordinates. They are made orthonormal to the interpolated normal. The handedness is kept, so that mirrored
//! coordinates and mirroring transforms invert nothing. Seen from behind, the perturbed normal is reversed: a bump
//! becomes a dent. If the texture coordinates are degenerate, or the map's normal is zero, the interpolated normal is
//! used.
//!
//! # Decoding
//!
//! A channel `c` in 0..=1 decodes to `2c - 1`, as in glTF. No byte decodes to exactly 0: the usual "flat" texel
//! (128, 128, 255) tilts the normal by 0.32 degrees in both directions, as in other renderers that follow the standard.
//!
//! # Below the horizon
//!
//! A strongly perturbed normal may face away from the viewer, or mirror the view direction below the surface. Following
//! Keller et al. 2017 ("The Iray light transport simulation and rendering system", appendix A), the mirrored direction
//! is lifted to the horizon, and the normal is the half vector between it and the viewer. As a normal turns away from
//! the viewer, this tends to the geometric normal, which is therefore used for all normals that face away.

use canted_scene::{Lobes as Source, Material, Mesh, TextureRef, UvSet};
use glam::DVec3;

use super::hit_triangle::{PlacedTriangle, TextureLookup};
use crate::Lobes;

/// The unit shading normal, on the viewer's side.
///
/// `smooth` is the interpolated normal, `normal` the geometric one on the viewer's side; `lookup` is `None` for a material without textures.
pub(super) fn shading_normal(
    material: &Material,
    placed: &PlacedTriangle,
    lookup: Option<&TextureLookup>,
    smooth: Option<DVec3>,
    normal: DVec3,
    towards_viewer: DVec3,
) -> DVec3 {
    let map = material.normal_texture.as_ref().zip(lookup);
    let result = map.and_then(|(slot, lookup)| {
        // Cofactors of a mirroring transform flip normals.
        let outward = smooth.or_else(|| placed.winding.try_normalize())? * handedness(placed);
        let mapped = mapped(slot, material.normal_scale, placed, lookup, outward)?;
        let oriented = if outward.dot(normal) < 0.0 { -mapped } else { mapped };
        Some(lifted(oriented, normal, towards_viewer.try_normalize()?))
    });
    result.unwrap_or_else(|| {
        let smooth = smooth.map_or(normal, |n| facing(n, normal));
        if smooth.dot(towards_viewer) > 0.0 { smooth } else { normal }
    })
}

/// `v` or its opposite, whichever is on the side of `towards`.
pub(super) fn facing(v: DVec3, towards: DVec3) -> DVec3 {
    if v.dot(towards) < 0.0 { -v } else { v }
}

/// The unit normal `outward`, perturbed by a normal map.
fn mapped(
    slot: &TextureRef,
    factor: f32,
    placed: &PlacedTriangle,
    lookup: &TextureLookup,
    outward: DVec3,
) -> Option<DVec3> {
    let [x, y, z, _] = lookup.sample(slot)?.map(|c| 2.0 * f64::from(c) - 1.0);
    let factor = f64::from(factor);
    let [u, v] = vertex_tangents(placed, outward).or_else(|| uv_tangents(slot, lookup, outward))?;
    (u * (factor * x) + v * (factor * y) + outward * z).try_normalize()
}

/// Tangents about the unit vector `normal`: those of the vertices, else the gradients of the coordinates of a texture, or of the first
/// ones.
pub(super) fn tangents(
    slot: Option<&TextureRef>,
    placed: &PlacedTriangle,
    lookup: Option<&TextureLookup>,
    normal: DVec3,
) -> Option<[DVec3; 2]> {
    let of_texture = || uv_tangents(slot?, lookup?, normal);
    let of_mesh = || {
        let [a, b, c] = placed.triangle.uvs(UvSet::First)?;
        let edges = [b, c].map(|uv| std::array::from_fn(|k| uv[k] - a[k]));
        gradients(edges, placed.edges_world(), normal)
    };
    vertex_tangents(placed, normal).or_else(of_texture).or_else(of_mesh)
}

/// -1 if the instance mirrors, which flips cross products relative to object space.
fn handedness(placed: &PlacedTriangle) -> f64 {
    if placed.is_mirrored { -1.0 } else { 1.0 }
}

/// The tangents of the vertices.
fn vertex_tangents(placed: &PlacedTriangle, outward: DVec3) -> Option<[DVec3; 2]> {
    let Mesh { tangents, close, .. } = placed.triangle.mesh;
    let close = close.as_ref().and_then(|close| close.tangents.as_ref());
    let [x, y, z, sign] = placed.triangle.moving_attribute(tangents.as_ref()?, close);
    let u = orthonormal(placed.pose.vector_world(DVec3::new(x, y, z)), outward)?;
    Some([u, outward.cross(u) * (1.0_f64.copysign(sign) * handedness(placed))])
}

/// The gradients of the texture coordinates.
fn uv_tangents(slot: &TextureRef, lookup: &TextureLookup, outward: DVec3) -> Option<[DVec3; 2]> {
    gradients(lookup.uv_edges(slot)?, lookup.plane.edges, outward)
}

/// Directions of increasing coordinates in a triangle, from the differences of coordinates and of points along its edges.
fn gradients([[a, b], [c, d]]: [[f64; 2]; 2], [first, second]: [DVec3; 2], outward: DVec3) -> Option<[DVec3; 2]> {
    // Only the sign of the determinant matters, not the lengths of the gradients.
    let determinant = a * d - b * c;
    if determinant == 0.0 {
        return None;
    }
    let sign = 1.0_f64.copysign(determinant);
    let along_u = (first * d - second * b) * sign;
    let along_v = (second * a - first * c) * sign;
    let u = orthonormal(along_u, outward)?;
    Some([u, facing(outward.cross(u), along_v)])
}

/// The normalized component of `v` perpendicular to the unit vector `normal`.
fn orthonormal(v: DVec3, normal: DVec3) -> Option<DVec3> {
    (v - normal * v.dot(normal)).try_normalize()
}

/// The unit normal closest to `perturbed` that faces the viewer and mirrors the view direction above the surface.
fn lifted(perturbed: DVec3, normal: DVec3, towards_viewer: DVec3) -> DVec3 {
    let cosine = perturbed.dot(towards_viewer);
    if cosine <= 0.0 {
        return normal;
    }
    let mirrored = perturbed * (2.0 * cosine) - towards_viewer;
    let height = mirrored.dot(normal);
    if height >= 0.0 {
        return perturbed;
    }
    (towards_viewer + (mirrored - normal * height)).try_normalize().unwrap_or(normal)
}

// Further lobes at a hit: factors times textures, and the direction of anisotropy.

/// The lobes where `texel` evaluates a texture, and the factor of the dielectric reflection.
pub(super) fn lobes(source: &Source, texel: impl Fn(&Option<TextureRef>) -> [f32; 4]) -> (Lobes, f32) {
    let times = |color: [f32; 3], texture| {
        let texel = texel(texture);
        std::array::from_fn(|k| color[k] * texel[k])
    };
    let channel = |factor: f32, texture, channel: usize| factor * texel(texture)[channel];
    let [thin, thick] = source.iridescence_thickness;
    let lobes = Lobes {
        specular_color: times(source.specular_color, &source.specular_color_texture),
        clearcoat: channel(source.clearcoat, &source.clearcoat_texture, 0),
        clearcoat_roughness: channel(source.clearcoat_roughness, &source.clearcoat_roughness_texture, 1),
        sheen_color: times(source.sheen_color, &source.sheen_color_texture),
        sheen_roughness: channel(source.sheen_roughness, &source.sheen_roughness_texture, 3),
        anisotropy: channel(source.anisotropy, &source.anisotropy_texture, 2),
        direction: [1.0, 0.0],
        iridescence: channel(source.iridescence, &source.iridescence_texture, 0),
        iridescence_ior: source.iridescence_ior,
        iridescence_thickness: thin + (thick - thin) * texel(&source.iridescence_thickness_texture)[1],
        absorption: source.absorption,
    };
    (lobes, texel(&source.specular_texture)[3])
}

/// The direction of longer highlights, world space; `None` where the mesh has no tangents and no texture coordinates.
pub(super) fn anisotropy(
    source: &Source,
    placed: &PlacedTriangle,
    lookup: Option<&TextureLookup>,
    normal: DVec3,
) -> Option<DVec3> {
    let texture = source.anisotropy_texture.as_ref();
    let [u, v] = tangents(texture, placed, lookup, normal)?;
    let texel = texture.zip(lookup).and_then(|(slot, lookup)| lookup.sample(slot));
    let [x, y] = texel.map_or([1.0, 0.0], |[x, y, ..]| [x, y].map(|c| 2.0 * f64::from(c) - 1.0));
    let (sine, cosine) = f64::from(source.anisotropy_rotation).sin_cos();
    Some(u * (cosine * x - sine * y) + v * (sine * x + cosine * y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions on a grid of angles.
    fn directions() -> impl Iterator<Item = DVec3> {
        (0..16).flat_map(|i| {
            (0..32).map(move |j| {
                let (theta, phi) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
                DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
            })
        })
    }

    /// Rounding error of a unit vector and of a dot product with it.
    const BOUND: f64 = 16.0 * f64::EPSILON;

    #[test]
    fn lifted_normals_face_the_viewer_and_mirror_above_the_surface() {
        let normal = DVec3::Z;
        for viewer in directions().filter(|v| v[2] > 0.01) {
            for perturbed in directions() {
                let result = lifted(perturbed, normal, viewer);
                let cosine = result.dot(viewer);
                assert!(cosine > 0.0 && (result.length() - 1.0).abs() < BOUND, "{perturbed:?} {viewer:?}");
                let mirrored = result * (2.0 * cosine) - viewer;
                assert!(mirrored.dot(normal) > -BOUND, "{perturbed:?} {viewer:?}");
            }
        }
    }

    #[test]
    fn valid_normals_are_unchanged() {
        let viewer = DVec3::new(0.6, 0.0, 0.8);
        let perturbed = DVec3::new(0.28, 0.0, 0.96);
        assert_eq!(lifted(perturbed, DVec3::Z, viewer), perturbed);
    }
}
