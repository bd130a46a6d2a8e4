use std::f64::consts::PI;

use crate::light::{IncomingLight, LightId, Lights};
use crate::query::RayKeyed;
use crate::vector::{dot, narrow, scale};
use crate::{Surface, Tracer};

/// Direct lighting of a diffuse surface by the lights of the scene file, one shadow ray each; returns the number of
/// shadow rays.
///
/// The shadow ray to light `k` has number `k` below `query`.
///
/// A Lambertian surface with reflectance `ρ` reflects `ρ/π` of its irradiance in every direction. The irradiance of a
/// sun is `E·cosθ`, that of a point light `I·cosθ/r²`; `square` samples a point of a sphere or disk light by the
/// light's index. Only light above the horizons of both the triangle and the shading normal counts, on the viewer's
/// side.
pub(crate) fn direct<T: Tracer, Q: RayKeyed>(
    lights: &Lights,
    tracer: &T,
    query: &Q,
    surface: &Surface,
    square: impl Fn(u32) -> [f32; 2],
) -> ([f32; 3], u64) {
    let mut radiance = [0.0; 3];
    let mut n_rays = 0;
    for (index, light) in (0..).zip(lights.list()) {
        let Some(incoming) = IncomingLight::of(light, surface, || square(index)) else { continue };
        let cosine = dot(surface.shading_normal, incoming.to_light);
        if cosine <= 0.0 || dot(surface.normal, incoming.to_light) <= 0.0 {
            continue;
        }
        if let Some(ray) = incoming.shadow_ray {
            n_rays += 1;
            if !lights.is_unoccluded(&ray, LightId::Light(index), tracer, &mut query.keyed(index)) {
                continue;
            }
        }
        let reflected = narrow(scale(incoming.radiance, cosine / PI));
        radiance = std::array::from_fn(|k| radiance[k] + surface.bsdf.base_color[k] * reflected[k]);
    }
    (radiance, n_rays)
}
