use std::f64::consts::PI;

use crate::light::{IncomingLight, LightId, Lights};
use crate::query::RayKeyed;
use crate::vector::{dot, narrow, scale};
use crate::{Surface, Tracer};

/// Radiance that a surface reflects of the listed lights, each seen along one shadow ray, and the number of those rays.
///
/// The ray to light `k` is number `k` of those that `query` stands for.
///
/// A Lambert surface of reflectance `ρ` sends `ρ/π` of its irradiance in every direction. The irradiance of a sun is
/// `E·cosθ`, that of a point light `I·cosθ/r²`; spheres and discs are seen at one point, which `square` chooses by the
/// light's index. Light reaches the side that the viewer sees, and only what lies above both the triangle's and the
/// shading normal's horizon.
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
