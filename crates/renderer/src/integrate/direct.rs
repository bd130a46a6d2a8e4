use std::f64::consts::PI;

use canted_scene::Light;
use canted_trace::{Query, Ray};

use crate::vector::{Vector, dot, scale, sub, wide};
use crate::{Surface, Tracer};

/// Radiance that a surface reflects of all `lights`, each seen along one shadow ray, and the number of those rays.
///
/// A Lambert surface of reflectance `ρ` sends `ρ/π` of its irradiance in every direction. The irradiance of a sun is
/// `E·cosθ`, that of a point light `I·cosθ/r²`. Light reaches the side that the viewer sees, and only what lies above
/// both the triangle's and the shading normal's horizon.
pub(crate) fn direct<T: Tracer, Q: Query>(
    lights: &[Light],
    tracer: &T,
    query: &mut Q,
    surface: &Surface,
) -> ([f32; 3], u64) {
    let mut radiance = [0.0; 3];
    let mut n_rays = 0;
    for light in lights {
        let Some(arrival) = Arrival::of(light, surface) else { continue };
        if let Some(ray) = arrival.shadow_ray {
            n_rays += 1;
            if tracer.occluded(&ray, query) {
                continue;
            }
        }
        radiance = std::array::from_fn(|k| radiance[k] + surface.albedo[k] * arrival.reflected[k]);
    }
    (radiance, n_rays)
}

/// What a light would do to a surface if nothing stood between.
struct Arrival {
    /// Irradiance over π.
    reflected: [f32; 3],
    /// `None` where the light is too close for anything to stand between.
    shadow_ray: Option<Ray>,
}

impl Arrival {
    fn of(light: &Light, surface: &Surface) -> Option<Self> {
        match *light {
            Light::Sun { direction, irradiance } => {
                let to_light = direction.map(|d| -d);
                let cosine = cosine(surface, wide(to_light))?;
                Some(Self { reflected: over_pi(irradiance, cosine), shadow_ray: Some(surface.leave(to_light)) })
            }
            Light::Point { position, intensity } => {
                let way = sub(wide(position), surface.position);
                let square = dot(way, way);
                let cosine = cosine(surface, scale(way, 1.0 / square.sqrt()))?;
                Some(Self { reflected: over_pi(intensity, cosine / square), shadow_ray: surface.reach(position) })
            }
            Light::Spot { .. } | Light::Sphere { .. } | Light::Disc { .. } => None,
        }
    }
}

/// Cosine to a unit direction about the shading normal; `None` where it or the triangle faces away.
fn cosine(surface: &Surface, to_light: Vector) -> Option<f64> {
    let cosine = dot(surface.shading_normal, to_light);
    (cosine > 0.0 && dot(surface.normal, to_light) > 0.0).then_some(cosine)
}

#[expect(clippy::cast_possible_truncation, reason = "radiance is f32")]
fn over_pi(power: [f32; 3], factor: f64) -> [f32; 3] {
    power.map(|x| (f64::from(x) * factor / PI) as f32)
}
