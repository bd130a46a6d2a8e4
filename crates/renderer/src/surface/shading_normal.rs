//! The normal to shade with.
//!
//! # The tangent frame
//!
//! A normal map speaks of `x` along growing `u`, `y` along growing `v` and `z` along the shading normal. Both tangents are
//! vectors of the surface, so they go to world space by the transform itself and only the normal by its inverse transpose.
//! They come from the vertices where the file has tangents, with the sign by which `normal × tangent` becomes the other; else
//! they are the gradients of the triangle's texture coordinates. Either way they are made orthonormal to the interpolated
//! normal, and the handedness is kept: mirrored coordinates and mirroring transforms turn nothing inside out. Seen from
//! behind, the finished normal is reversed: what was a bump is a dent. Where coordinates do not spread over the triangle, or
//! the map's normal has no length, there is no frame, and the interpolated normal stands.
//!
//! # Decoding
//!
//! A channel `c` in 0..=1 is the coordinate `2c - 1`, as glTF says. No byte is exactly 0: the usual "flat" texel
//! (128, 128, 255) leans by 0.32 degrees in both directions, as in other renderers that follow the standard.
//!
//! # Below the horizon
//!
//! A normal that a map bends too far shows the viewer its back, or mirrors the view into the body; what such a surface
//! scatters cannot be. After Keller et al. 2017 ("The Iray light transport simulation and rendering system", appendix A) the
//! mirrored direction is lifted to the horizon, and the normal half-way between it and the viewer is taken. As a normal turns
//! away from the viewer this tends to the triangle's normal, which is therefore taken for all that face away.

use canted_scene::{Material, TextureRef};

use super::lookups::Lookups;
use super::placed::Placed;
use crate::vector::{Vector, add, cross, dot, scale, sub, unit};

/// Unit normal to shade with, on the side of the viewer.
///
/// `normal` is the triangle's, on that side too; `lookups` is `None` where the material has no textures.
pub(super) fn shading_normal(
    material: &Material,
    placed: &Placed,
    lookups: Option<&Lookups>,
    normal: Vector,
    towards_viewer: Vector,
) -> Vector {
    let smooth = placed.smooth_normal();
    let map = material.normal_texture.as_ref().zip(lookups);
    let shown = map.and_then(|(slot, lookups)| {
        // Cofactors take normals to the other side where the transform mirrors.
        let outward = scale(smooth.or_else(|| unit(placed.winding))?, handedness(placed));
        let mapped = mapped(slot, material.normal_scale, placed, lookups, outward)?;
        let turned = if dot(outward, normal) < 0.0 { scale(mapped, -1.0) } else { mapped };
        Some(lifted(turned, normal, unit(towards_viewer)?))
    });
    shown.unwrap_or_else(|| {
        let smooth = smooth.map_or(normal, |n| facing(n, normal));
        if dot(smooth, towards_viewer) > 0.0 { smooth } else { normal }
    })
}

/// `v` or its opposite, whichever is on the side of `towards`.
pub(super) fn facing(v: Vector, towards: Vector) -> Vector {
    if dot(v, towards) < 0.0 { scale(v, -1.0) } else { v }
}

/// What a normal map makes of the unit normal `outward`.
fn mapped(slot: &TextureRef, factor: f32, placed: &Placed, lookups: &Lookups, outward: Vector) -> Option<Vector> {
    let [x, y, z, _] = lookups.found(slot)?.map(|c| 2.0 * f64::from(c) - 1.0);
    let factor = f64::from(factor);
    let [u, v] = of_vertices(placed, outward).or_else(|| of_coordinates(slot, lookups, outward))?;
    unit(add(add(scale(u, factor * x), scale(v, factor * y)), scale(outward, z)))
}

/// -1 where the instance mirrors, so that cross products in world space are on the other side of those in object space.
fn handedness(placed: &Placed) -> f64 {
    if placed.is_mirrored { -1.0 } else { 1.0 }
}

/// The tangents that the file gives.
fn of_vertices(placed: &Placed, outward: Vector) -> Option<[Vector; 2]> {
    let [x, y, z, sign] = placed.corners.blend(placed.corners.mesh.tangents.as_ref()?);
    let u = orthonormal(placed.pose.vector_world([x, y, z]), outward)?;
    Some([u, scale(cross(outward, u), 1.0_f64.copysign(sign) * handedness(placed))])
}

/// The gradients of the texture coordinates.
fn of_coordinates(slot: &TextureRef, lookups: &Lookups, outward: Vector) -> Option<[Vector; 2]> {
    let [[a, b], [c, d]] = lookups.uv_edges(slot)?;
    let [first, second] = lookups.plane.edges;
    // Their lengths do not matter, the sign of the determinant does; where it is zero there are no gradients.
    let determinant = a * d - b * c;
    if determinant == 0.0 {
        return None;
    }
    let sign = 1.0_f64.copysign(determinant);
    let along_u = scale(sub(scale(first, d), scale(second, b)), sign);
    let along_v = scale(sub(scale(second, a), scale(first, c)), sign);
    let u = orthonormal(along_u, outward)?;
    Some([u, facing(cross(outward, u), along_v)])
}

/// The unit vector along `v`, less what of it lies along the unit vector `normal`.
fn orthonormal(v: Vector, normal: Vector) -> Option<Vector> {
    unit(sub(v, scale(normal, dot(v, normal))))
}

/// The unit normal next to `bent` that shows the viewer its face and mirrors the view out of the body.
fn lifted(bent: Vector, normal: Vector, towards_viewer: Vector) -> Vector {
    let cosine = dot(bent, towards_viewer);
    if cosine <= 0.0 {
        return normal;
    }
    let mirrored = sub(scale(bent, 2.0 * cosine), towards_viewer);
    let height = dot(mirrored, normal);
    if height >= 0.0 {
        return bent;
    }
    unit(add(towards_viewer, sub(mirrored, scale(normal, height)))).unwrap_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::length;

    /// Directions all around, on a grid of angles.
    fn directions() -> impl Iterator<Item = Vector> {
        (0..16).flat_map(|i| {
            (0..32).map(move |j| {
                let (theta, phi) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
                [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]
            })
        })
    }

    /// Roundings of a unit vector and of a product with it.
    const BOUND: f64 = 16.0 * f64::EPSILON;

    #[test]
    fn no_normal_hides_from_the_viewer_or_mirrors_into_the_body() {
        let normal = [0.0, 0.0, 1.0];
        for viewer in directions().filter(|v| v[2] > 0.01) {
            for bent in directions() {
                let shown = lifted(bent, normal, viewer);
                let cosine = dot(shown, viewer);
                assert!(cosine > 0.0 && (length(shown) - 1.0).abs() < BOUND, "{bent:?} {viewer:?}");
                let mirrored = sub(scale(shown, 2.0 * cosine), viewer);
                assert!(dot(mirrored, normal) > -BOUND, "{bent:?} {viewer:?}");
            }
        }
    }

    #[test]
    fn what_needs_no_lift_is_left_as_it_is() {
        let viewer = [0.6, 0.0, 0.8];
        let bent = [0.28, 0.0, 0.96];
        assert_eq!(lifted(bent, [0.0, 0.0, 1.0], viewer), bent);
    }
}
