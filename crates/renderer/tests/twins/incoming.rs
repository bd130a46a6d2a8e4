use bytemuck::{Pod, Zeroable};
use canted_fixtures::device_tests::{Test, needs_device, needs_nothing};
use canted_gpu::{Variant, wgsl};
use canted_renderer::twins::{incoming_light, light_list};
use canted_scene::Light;
use glam::DVec3;

use crate::{U, answers, are_near, direction, gpu, number, surface};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(incoming_light_matches_the_cpu), needs_nothing(layouts_match_the_kernel)]
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    at: [f32; 3],
    light: u32,
    square: [f32; 2],
    _padding: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    to_light: [f32; 3],
    density: f32,
    radiance: [f32; 3],
    shadow_ray: u32,
    position: [f32; 3],
    _padding: u32,
    density_again: f32,
    _more_padding: [u32; 3],
}

/// Each kind of light, near and far, and lights that emit nothing: black, zero radius, a spot without falloff.
fn lights() -> Vec<Light> {
    let mut lights = vec![
        Light::Sun { direction: direction(0, 0), irradiance: [1.0, 2.0, 3.0] },
        Light::Point { position: [0.0; 3], intensity: [0.0; 3] },
        Light::Point { position: [1e6, -2e6, 3.0], intensity: [1e12; 3] },
        Light::Spot {
            position: [0.5; 3],
            direction: direction(1, 0),
            intensity: [5.0; 3],
            cos_inner: 0.5,
            cos_outer: 0.5,
        },
        Light::Sphere { center: [3e5, 0.0, 0.0], radius: 1e-3, radiance: [1e9; 3] },
    ];
    for i in 2..20 {
        let center = direction(i, 2).map(|x| 5.0 * x);
        let radiance = [0, 1, 2].map(|k| 10.0 * number(i, 10 + k));
        let radius = 0.01 + number(i, 20);
        lights.push(Light::Point { position: center, intensity: radiance });
        let [cos_outer, cos_inner] = [0.9 * number(i, 30), 0.9 + 0.1 * number(i, 31)];
        lights.push(Light::Spot {
            position: center,
            direction: direction(i, 40),
            intensity: radiance,
            cos_inner,
            cos_outer,
        });
        lights.push(Light::Sphere { center, radius, radiance });
        lights.push(Light::Disk { center, normal: direction(i, 50), radius, radiance });
    }
    assert!(
        (0..Light::KINDS.len()).all(|kind| lights.iter().any(|light| light.kind() == kind)),
        "a light of each kind"
    );
    lights
}

fn wide(v: [f32; 3]) -> DVec3 {
    v.map(f64::from).into()
}

/// Condition number of incoming light: the factor of `U` in its error bound.
///
/// Vectors between points in f32 have one rounding per axis. Every formula from there is a chain of fewer than 32 roundings
/// and quotients, with two exceptions: the cap height of a sphere has the error of its sine times the tangent, and the
/// density of a disk seen at a slant depends on a height that is the remainder of a dot product.
fn condition(light: &Light, at: DVec3, point: DVec3) -> f64 {
    32.0 * match *light {
        Light::Sphere { center, radius, .. } => {
            let (d, r) = ((wide(center) - at).length(), f64::from(radius));
            1.0 + r / (d * d - r * r).max(0.0).sqrt()
        }
        Light::Disk { center, normal, .. } => {
            let terms = |a: DVec3| (0..3).map(|k| (a[k] * f64::from(normal[k])).abs()).sum::<f64>();
            let delta = point - at;
            // The point on the disk is rounded in absolute terms, not relative to the distance.
            let absolute = terms(delta) + terms(point) + terms(wide(center));
            1.0 + absolute / delta.dot(wide(normal)).abs() + point.length() / delta.length()
        }
        _ => 1.0,
    }
}

/// Number of compared queries, and number of those at a discontinuity.
fn compare(lights: &[Light], queries: &[Query], answers: &[Answer]) -> Result<[u32; 2], String> {
    let mut counts = [0, 0];
    for (query, answer) in queries.iter().zip(answers) {
        let light = &lights[query.light as usize];
        let up = [0.0, 0.0, 1.0];
        let surface = surface(query.at, up, up);
        let expected = incoming_light(light, &surface, query.square);
        let fail = |what: &str| Err(format!("{what}: {light:?} from {:?}: {answer:?}", query.at));
        let Some(expected) = expected else {
            if answer.shadow_ray != 0 {
                // At a discontinuity, almost no light arrives.
                counts[1] += 1;
            }
            continue;
        };
        let at = wide(query.at);
        let point = expected.shadow_ray.map_or(at, |ray| wide(ray.origin) + wide(ray.direction));
        let bound = U * condition(light, at, point);
        if answer.shadow_ray == 0 || bound > 0.1 {
            counts[1] += 1;
            continue;
        }
        counts[0] += 1;
        let soft = match *light {
            // Slope of the falloff over the cosine, in units of the falloff.
            Light::Spot { direction, cos_outer, .. } => {
                let cosine = -wide(direction).dot(expected.to_light.into());
                2.0 / (cosine - f64::from(cos_outer)).max(1e-30)
            }
            _ => 0.0,
        };
        if !are_near(answer.to_light, expected.to_light, bound.min(64.0 * U * (1.0 + point.length()))) {
            return fail("direction");
        }
        for k in 0..3 {
            let off = (f64::from(answer.radiance[k]) - expected.radiance[k]).abs();
            if off > bound * (1.0 + soft) * expected.radiance[k] {
                return fail("radiance");
            }
        }
        for density in [answer.density, answer.density_again] {
            let expected = expected.density.unwrap_or(0.0);
            if (f64::from(density) - expected).abs() > 2.0 * bound * expected {
                return fail("density");
            }
        }
        let span = point.length() + at.length();
        if expected.shadow_ray.is_some_and(|ray| ray.t_max < 1.0)
            && !are_near(answer.position, point.into(), bound * span)
        {
            return fail("position");
        }
    }
    Ok(counts)
}

fn queries(lights: &[Light]) -> Vec<Query> {
    let n_lights = u32::try_from(lights.len()).unwrap();
    (0..40 * n_lights)
        .map(|i| {
            let scale = [1.0, 6.0, 1000.0, 1e-3][i as usize % 4];
            let square = [number(i, 60), number(i, 61)];
            let square = if i % 7 == 0 { [0.0, 0.0] } else { square };
            Query { at: direction(i, 62).map(|x| scale * x), light: i % n_lights, square, _padding: [0; 2] }
        })
        .collect()
}

fn incoming_light_matches_the_cpu() {
    let gpu = gpu();
    let lights = lights();
    let packed = light_list(&gpu, &lights).unwrap();
    let queries = queries(&lights);
    let mut answers: Vec<Answer> =
        answers(&gpu, wgsl::check::INCOMING, &Variant::none(), &queries, &[("lights", &packed)]);
    let [n_compared, n_at_edges] = compare(&lights, &queries, &answers).unwrap();
    assert!(n_compared > 1500 && n_at_edges < 10, "{n_compared} {n_at_edges}");

    // An error of 1e-5 in a direction is detected.
    let lit = answers.iter().position(|answer| answer.density > 0.0).unwrap();
    answers[lit].to_light = (wide(answers[lit].to_light) + DVec3::new(1.0, -1.0, 1.0) * 2e-5).as_vec3().into();
    let error = compare(&lights, &queries, &answers).unwrap_err();
    assert!(error.starts_with("direction"), "{error}");
}

fn layouts_match_the_kernel() {
    canted_shaders::same_layout!(wgsl::check::INCOMING, &Variant::none(), "Query", Query { at, light, square });
}
