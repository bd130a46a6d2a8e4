use bytemuck::{Pod, Zeroable};
use canted_fixtures::device_tests::{Test, needs_device, needs_nothing};
use canted_gpu::{Gpu, Variant, choice, wgsl};
use canted_obb::Affine;
use canted_renderer::twins::{LightBuffers, light_list};
use canted_renderer::{LightId, LightSample, LightSampler, Lights, Surface, Surfaces};
use canted_scene::{Environment, EnvironmentImage, Instance, Light, Material, MaterialId, Mesh, MeshId, Part, Scene};

use crate::{U, answers, compare, direction, gpu, number, surface};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(light_samples_match_the_cpu), needs_nothing(layouts_match_the_kernel)]
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Query {
    position: [f32; 3],
    choice: f32,
    normal: [f32; 3],
    transmits: u32,
    square: [f32; 2],
    kind: u32,
    number: u32,
    to_light: [f32; 3],
    primitive: u32,
    shading_normal: [f32; 3],
    _padding: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    to_light: [f32; 3],
    density: f32,
    radiance: [f32; 3],
    shadow_ray: u32,
    position: [f32; 3],
    shape_light: u32,
    is_emission: u32,
    density_there: f32,
    _padding: [u32; 2],
}

/// An answer is correct if the CPU gives it for a receiver moved by at most this share of the scene's largest coordinate,
/// rotated by as much, and with random numbers changed by as much. Vectors to lights have this rounding.
const MOVE: f64 = 8.0 * U;

/// Rounding of the last operations: about thirty in the formulas of a light, and ten at each of about eight levels of the tree.
const CHAIN: f64 = 128.0 * U;

/// Largest coordinate of the scenes and receivers in these tests.
const SPAN: f64 = 8.0;

impl Query {
    fn surface(&self) -> Surface {
        surface(self.position, self.normal, self.shading_normal)
    }

    fn sample(&self, sampler: &LightSampler) -> Option<LightSample> {
        sampler.sample(&self.surface(), self.transmits != 0, self.choice, self.square)
    }

    fn density(&self, sampler: &LightSampler) -> f64 {
        let source = match self.kind {
            0 => LightId::Environment,
            1 => LightId::Light(self.number),
            _ => LightId::Triangle(canted_trace::InstanceId(self.number), canted_obb::PrimId(self.primitive)),
        };
        sampler.density(&self.surface(), self.transmits != 0, self.to_light, source).into()
    }

    fn moved(&self, span: f64) -> Vec<Self> {
        let mut all = vec![];
        for sign in [-1.0, 1.0] {
            let step = (sign * MOVE) as f32;
            let far = (sign * MOVE * span) as f32;
            for k in 0..3 {
                let mut query = *self;
                query.position[k] += far;
                all.push(query);
                let mut query = *self;
                query.normal[k] += step;
                all.push(query);
                let mut query = *self;
                query.shading_normal[k] += step;
                all.push(query);
                let mut query = *self;
                query.to_light[k] += step;
                all.push(query);
            }
            let within = |x: f32| (x + step).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
            all.push(Self { choice: within(self.choice), ..*self });
            for k in 0..2 {
                let mut query = *self;
                query.square[k] = within(query.square[k]);
                all.push(query);
            }
        }
        all
    }
}

fn numbers(sample: &LightSample) -> [f64; 7] {
    let ([x, y, z], [r, g, b]) = (sample.to_light, sample.radiance);
    [x, y, z, r, g, b, sample.density].map(f64::from)
}

/// Whether an answer matches the CPU's; false where another light may be chosen; or what is wrong with it.
fn compare_one(sampler: &LightSampler, query: &Query, answer: &Answer) -> Result<bool, String> {
    let there = query.density(sampler);
    let all_moved = query.moved(SPAN);
    let bound: f64 = all_moved.iter().map(|moved| (moved.density(sampler) - there).abs()).sum();
    let sample = query.sample(sampler);
    if (f64::from(answer.density_there) - there).abs() > bound + CHAIN * there {
        return Err(format!("density: {query:?} {answer:?} {there} {bound} {sample:?}"));
    }
    let Some(sample) = sample else { return Ok(answer.shadow_ray == 0) };
    let here = numbers(&sample);
    // Directions err by roundings of 1.
    let mut bounds: [f64; 7] = std::array::from_fn(|k| CHAIN * if k < 3 { 1.0 } else { here[k].abs() });
    for moved in all_moved {
        match moved.sample(sampler) {
            Some(other) if other.light == sample.light && other.is_delta == sample.is_delta => {
                let other = numbers(&other);
                bounds = std::array::from_fn(|k| bounds[k] + (other[k] - here[k]).abs());
            }
            _ => return Ok(false),
        }
    }
    let is_same = answer.shadow_ray != 0
        && match sample.light {
            LightId::Environment => answer.shape_light == u32::MAX && answer.is_emission == 0,
            LightId::Light(light) => answer.shape_light == light,
            LightId::Triangle(..) => answer.is_emission == 1,
        };
    let ([x, y, z], [r, g, b]) = (answer.to_light, answer.radiance);
    let got = [x, y, z, r, g, b, answer.density].map(f64::from);
    if is_same && (0..7).all(|k| (got[k] - here[k]).abs() <= bounds[k]) {
        return Ok(true);
    }
    Err(format!("sample: {query:?} {answer:?} {sample:?} {bounds:?}"))
}

/// Emissive triangles, some of them needles, tiny, or far away.
fn emitting(n: u32) -> Mesh {
    let mut mesh = Mesh { parts: vec![Part { first_triangle: 0, material: MaterialId(0) }], ..Mesh::default() };
    for i in 0..n {
        let scale = match i % 5 {
            0 => 1e-3,
            1 => 0.1,
            _ => 1.0,
        };
        let center = direction(i, 200).map(|x| (0.5 + 3.0 * number(i, 203)) * x);
        let long = direction(i, 204).map(|x| scale * x);
        let thin = if i % 7 == 3 { 1e-4 } else { 1.0 };
        let wide = direction(i, 206).map(|x| thin * scale * x);
        let first = 3 * i;
        let at = |a: f32, b: f32| std::array::from_fn(|k| center[k] + a * long[k] + b * wide[k]);
        mesh.positions.extend([at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// Lights of each kind.
fn listed() -> Vec<Light> {
    let lights: Vec<Light> = (0..6)
        .flat_map(|i| {
            let center = direction(i, 210).map(|x| 3.0 * x);
            let radiance = [0, 1, 2].map(|k| 0.1 + number(i, 220 + k));
            let normal = direction(i, 230);
            [
                Light::Sun { direction: normal, irradiance: radiance },
                Light::Point { position: center, intensity: radiance },
                Light::Spot {
                    position: center,
                    direction: normal,
                    intensity: radiance,
                    cos_inner: 0.9,
                    cos_outer: 0.2,
                },
                Light::Sphere { center: direction(i, 240).map(|x| 4.0 * x), radius: 0.3, radiance },
                Light::Disk { center: direction(i, 250).map(|x| 4.0 * x), normal, radius: 0.5, radiance },
            ]
        })
        .collect();
    assert!(
        (0..Light::KINDS.len()).all(|kind| lights.iter().any(|light| light.kind() == kind)),
        "a light of each kind"
    );
    lights
}

/// An environment map with a bright texel and a black row.
fn sky() -> Environment {
    let (width, height) = (16, 8);
    let texel = |i: u32| match (i % width, i / width) {
        (5, 2) => [90.0, 80.0, 70.0],
        (_, 6) => [0.0; 3],
        _ => [0, 1, 2].map(|k| number(i, 260 + k)),
    };
    Environment::Image(EnvironmentImage {
        name: "sky".to_owned(),
        width,
        height,
        texels: (0..width * height).map(texel).collect(),
        scale: [0.5, 1.0, 2.0],
        turn_degrees: -75.0,
    })
}

fn scene(n_emitters: u32, lights: Vec<Light>, environment: Environment) -> Scene {
    let instance = Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    };
    let dark = Mesh {
        positions: vec![[-4.0; 3], [4.0, -4.0, -4.0], [-4.0, 4.0, 4.0]],
        triangles: vec![[0, 1, 2]],
        parts: vec![Part { first_triangle: 0, material: MaterialId(1) }],
        ..Mesh::default()
    };
    Scene {
        meshes: vec![emitting(n_emitters), dark],
        instances: vec![instance, Instance { mesh: MeshId(1), ..instance }],
        materials: vec![Material { emission: [3.0, 2.0, 1.0], ..Material::default() }, Material::default()],
        lights,
        environment: Some(environment),
        ..Scene::default()
    }
}

/// Receivers throughout the scene and close to lights, each with a query for the density of the CPU's sample.
fn queries(sampler: &LightSampler, n: u32) -> Vec<Query> {
    (0..n)
        .map(|i| {
            let mut query = Query {
                position: direction(i, 10).map(|x| [3.0, 0.3, 8.0][i as usize % 3] * x),
                choice: number(i, 12),
                normal: direction(i, 13),
                shading_normal: direction(i, 19),
                transmits: u32::from(i % 3 == 0),
                square: [number(i, 15), number(i, 16)],
                kind: 0,
                number: 0,
                to_light: direction(i, 17),
                primitive: 0,
                _padding: 0,
            };
            if let Some(sample) = query.sample(sampler).filter(|sample| !sample.is_delta) {
                query.to_light = sample.to_light;
                match sample.light {
                    LightId::Environment => {}
                    LightId::Light(light) => (query.kind, query.number) = (1, light),
                    LightId::Triangle(instance, primitive) => {
                        (query.kind, query.number, query.primitive) = (2, instance.0, primitive.0);
                    }
                }
            }
            query
        })
        .collect()
}

/// Compares samples of a scene's lights; with `spoil`, after changing an answer.
fn check(gpu: &Gpu, scene: &Scene, n: u32, spoil: Option<fn(&mut Answer)>) -> Result<[usize; 2], String> {
    let surfaces = Surfaces::new(scene);
    let sampler = LightSampler::new(Lights::new(scene), &surfaces);
    // This kernel has no camera uniforms, which hold a constant sky; the share of the sky is then zero.
    let is_image = matches!(scene.environment, Some(Environment::Image(_)));
    let black = Scene { environment: Some(sky()), ..Scene::default() };
    let buffers = LightBuffers::new(gpu, &sampler, if is_image { scene } else { &black }).unwrap();
    let list = light_list(gpu, &scene.lights).unwrap();
    let mut bound = buffers.bindings();
    bound.push(("lights", &list));
    let chosen = buffers.specialize(Variant::none());
    let queries = queries(&sampler, n);
    let mut answers: Vec<Answer> = answers(gpu, wgsl::check::LIGHT, &chosen, &queries, &bound);
    if let Some(spoil) = spoil {
        let lit = answers.iter().position(|answer| answer.density > 0.0).unwrap();
        spoil(&mut answers[lit]);
    }
    compare(|query, answer| compare_one(&sampler, query, answer), &queries, &answers)
}

fn light_samples_match_the_cpu() {
    let gpu = gpu();
    let black = || Environment::Constant([0.0; 3]);
    let scenes = [
        scene(1, vec![], black()),
        scene(60, vec![], black()),
        scene(0, listed(), black()),
        scene(60, listed(), sky()),
        scene(0, vec![], sky()),
    ];
    for scene in &scenes {
        let [n_equal, n_at_edges] = check(&gpu, scene, 1500, None).unwrap();
        assert!(n_equal > 20 * n_at_edges, "{n_at_edges} at edges beside {n_equal}");
    }
    // An error of a thousandth in a density is detected.
    let error = check(&gpu, &scenes[1], 1500, Some(|answer| answer.density *= 1.001)).unwrap_err();
    assert!(error.starts_with("sample"), "{error}");
}

fn layouts_match_the_kernel() {
    let chosen = Variant::none()
        .with(choice::Local::Both)
        .with(choice::Skylight::Image)
        .with(choice::Suns::List)
        .with(choice::Emission::Constant)
        .with(choice::Sky::Image);
    let kernel = wgsl::check::LIGHT;
    canted_shaders::same_layout!(
        kernel,
        &chosen,
        "Query",
        Query { position, choice, normal, transmits, square, kind, number, to_light, primitive, shading_normal }
    );
    canted_shaders::same_layout!(
        kernel,
        &chosen,
        "Answer",
        Answer { to_light, density, radiance, shadow_ray, position, shape_light, is_emission, density_there }
    );
}
