//! The scenes of the oracle in our renderer: the same numbers as in `tests/oracle/scenes.py`.
//!
//! First open scenes and the Cornell box, then pictures with all light transport: glass and metal in a kitchen, a lens, and Sponza with sun,
//! sky and a sphere light.

use std::{collections::BTreeSet, fs};

use canted_film::{Film, read_picture};
use canted_obb::Affine;
use canted_renderer::{Integrator, Lod, Pattern, SceneBvh, SceneBvhConfig, Settings, render};
use canted_scene::{
    Camera, CurveSegments, CurveShape, Curves, Encoding, Environment, Instance, Lens, Light, Material, MaterialId,
    Mesh, MeshId, Part, Scene, Texture, TextureId, TextureRef, Wrap, read, read_environment,
};
use canted_tests::scenes::models;

use crate::oracle::{Block, blocks_of_film, blocks_of_reference};

/// A picture that both renderers make.
pub(crate) struct OraclePicture {
    /// Name of the reference.
    pub(crate) name: &'static str,
    pub(crate) scene: Scene,
    pub(crate) camera: Camera,
    pub(crate) size: [u32; 2],
    /// Greatest number of segments of a path, including the camera's; the hybrid integrator then renders the picture.
    pub(crate) n_segments: Option<u32>,
    /// Samples per pixel, enough for the mean radiance.
    pub(crate) samples: u32,
}

pub(crate) const BLUE: [f32; 3] = [0.4, 0.5, 0.65];

/// A model with flat triangles, as both renderers use it.
pub(crate) fn flat_model(test: &str, file: &str) -> Option<Scene> {
    let mut scene = read(&models(test)?.join(file)).unwrap();
    for mesh in &mut scene.meshes {
        mesh.normals = None;
    }
    Some(scene)
}

/// The same without emission.
pub(crate) fn model(test: &str, file: &str) -> Option<Scene> {
    let mut scene = flat_model(test, file)?;
    for material in &mut scene.materials {
        material.emission = [0.0; 3];
    }
    Some(scene)
}

pub(crate) fn with_sun(scene: Scene, towards: [f64; 3], irradiance: [f32; 3]) -> Scene {
    let length = towards.map(|x| x * x).iter().sum::<f64>().sqrt();
    let direction = towards.map(|x| (x / length) as f32);
    Scene { lights: vec![Light::Sun { direction, irradiance }], ..scene }
}

/// The Cornell box under a blue sky.
pub(crate) fn cornell_env(test: &str) -> Option<OraclePicture> {
    let scene = Scene { environment: Some(BLUE.into()), ..model(test, "cornell/cornellBox.obj")? };
    let camera = Camera::pinhole([-0.23, 2.58, 9.0], [-0.23, 2.58, -3.0], [0.0, 1.0, 0.0], 36.0);
    Some(OraclePicture { name: "cornell-env-2", scene, camera, size: [64, 64], n_segments: Some(2), samples: 128 })
}

/// The same with a sun that shines in through the open side.
pub(crate) fn cornell_sun(test: &str) -> Option<OraclePicture> {
    let picture = cornell_env(test)?;
    let scene = with_sun(picture.scene, [0.3, -0.5, -1.0], [3.0, 2.8, 2.5]);
    Some(OraclePicture { name: "cornell-sun-3", scene, n_segments: Some(3), ..picture })
}

/// The box lit by a point light between its ceiling and its blocks.
pub(crate) fn cornell_point(test: &str) -> Option<OraclePicture> {
    let picture = cornell_env(test)?;
    let lights = vec![Light::Point { position: [-0.9, 3.5, -1.2], intensity: [8.0, 7.0, 6.0] }];
    let scene = Scene { environment: None, lights, ..picture.scene };
    Some(OraclePicture { name: "cornell-point-3", scene, n_segments: Some(3), ..picture })
}

/// Lambert triangles without texture; each part has a color and corners in threes.
pub(crate) fn parts(parts: &[([f32; 3], Vec<[f32; 3]>)]) -> Scene {
    let mut scene = Scene::default();
    for (index, (base_color, corners)) in (0..).zip(parts) {
        scene.materials.push(Material { base_color: *base_color, ..Material::default() });
        scene.meshes.push(Mesh {
            positions: corners.clone(),
            triangles: (0..u32::try_from(corners.len() / 3).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            parts: vec![Part { first_triangle: 0, material: MaterialId(index) }],
            ..Mesh::default()
        });
        scene.instances.push(Instance {
            mesh: MeshId(index),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        });
    }
    scene
}

pub(crate) fn floor() -> ([f32; 3], Vec<[f32; 3]>) {
    let [a, b, c, d] = [[-6.0, 0.0, 6.0], [6.0, 0.0, 6.0], [6.0, 0.0, -6.0], [-6.0, 0.0, -6.0]];
    ([0.6, 0.5, 0.4], vec![a, b, c, a, c, d])
}

fn over_floor(name: &'static str, scene: Scene, light: Light) -> OraclePicture {
    let scene = Scene { lights: vec![light], environment: None, ..scene };
    let camera = Camera::pinhole([0.0, 4.0, 8.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0);
    OraclePicture { name, scene, camera, size: [64, 64], n_segments: Some(2), samples: 128 }
}

/// A disk of 64 corners between a floor and a sphere light. The reference has unlimited paths; after eight bounces between floor
/// and disk no visible light is left.
pub(crate) fn penumbra() -> OraclePicture {
    let corner = |i: u32| {
        let (s, c) = (std::f64::consts::TAU * f64::from(i) / 64.0).sin_cos();
        [(0.8 * c) as f32, 1.0, (-0.8 * s) as f32]
    };
    let disc = (0..64).flat_map(|i| [[0.0, 1.0, 0.0], corner(i), corner(i + 1)]).collect();
    let light = Light::Sphere { center: [0.5, 3.0, 0.0], radius: 0.4, radiance: [8.0; 3] };
    let scene = parts(&[floor(), ([0.2, 0.3, 0.6], disc)]);
    OraclePicture { n_segments: Some(10), samples: 1024, ..over_floor("penumbra", scene, light) }
}

/// A spot light with a hard edge.
pub(crate) fn spot() -> OraclePicture {
    let [x, y, z] = [-1.5_f64, -4.0, -1.0];
    let length = (x * x + y * y + z * z).sqrt();
    let (direction, cosine) = ([x, y, z].map(|x| (x / length) as f32), 20.0_f64.to_radians().cos() as f32);
    let light = Light::Spot {
        position: [1.0, 4.0, 1.0],
        direction,
        intensity: [20.0, 18.0, 14.0],
        cos_inner: cosine,
        cos_outer: cosine.next_down(),
    };
    over_floor("spot", parts(&[floor()]), light)
}

/// Forty strands that bend above a floor, in the sun, as tubes of straight segments or of uniform B-splines.
pub(crate) fn curves(is_cubic: bool) -> OraclePicture {
    let name = if is_cubic { "curves-bspline" } else { "curves-linear" };
    let sun = with_sun(parts(&[floor()]), [0.3, -1.0, -0.4], [3.0, 2.8, 2.5]);
    let mut scene = Scene { environment: Some(BLUE.into()), ..sun };
    let (mut positions, mut radii, mut linear, mut cubic) = (vec![], vec![], vec![], vec![]);
    for strand in (0..40).map(strand) {
        let mut push = |[x, y, z, radius]: [f64; 4]| {
            positions.push([x as f32, y as f32, z as f32]);
            radii.push(radius as f32);
            positions.len() as u32 - 1
        };
        if is_cubic {
            for [a, b, c, d] in (0..4).map(|k| [0, 1, 2, 3].map(|i| strand[k + i])) {
                let sum = |w: [f64; 4]| std::array::from_fn(|k| w[0] * a[k] + w[1] * b[k] + w[2] * c[k] + w[3] * d[k]);
                let weights = [[1.0, 4.0, 1.0, 0.0], [0.0, 4.0, 2.0, 0.0], [0.0, 2.0, 4.0, 0.0], [0.0, 1.0, 4.0, 1.0]];
                cubic.push(weights.map(|w| push(sum(w.map(|w| w / 6.0)))));
            }
        } else {
            let points = strand.map(push);
            linear.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
        }
    }
    let segments = if is_cubic { CurveSegments::Cubic(cubic) } else { CurveSegments::Linear(linear) };
    let (mesh, material) = (MeshId(scene.meshes.len() as u32), MaterialId(scene.materials.len() as u32));
    scene.materials.push(Material { base_color: [0.7, 0.45, 0.2], ..Material::default() });
    scene.meshes.push(Mesh {
        positions,
        parts: vec![Part { first_triangle: 0, material }],
        curves: Some(Curves { radii, segments, shape: CurveShape::Tube }),
        ..Mesh::default()
    });
    scene.instances.push(Instance {
        mesh,
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 2,
    });
    let camera = Camera::pinhole([0.0, 4.0, 8.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0);
    OraclePicture { name, scene, camera, size: [64, 64], n_segments: None, samples: 256 }
}

/// Control points of a strand with radii.
fn strand(i: u32) -> [[f64; 4]; 7] {
    let i = f64::from(i);
    let (turn, reach) = (2.399963 * i, 1.8 * ((i + 0.5) / 40.0).sqrt());
    std::array::from_fn(|k| {
        let k = k as f64;
        let x = reach * turn.cos() + 0.3 * (0.9 * k + i).sin();
        let z = reach * turn.sin() + 0.3 * (1.1 * k + 2.0 * i).cos();
        [x, 0.5 * k - 0.8, z, (0.1 * (1.0 - k / 5.0)).max(0.001)]
    })
}

/// A tilted wall of four times four texels, enlarged to show the filter, under a white sky.
pub(crate) fn checker() -> OraclePicture {
    let mesh = Mesh {
        positions: vec![[-2.0, 0.5, 0.0], [2.0, 0.5, 0.0], [2.0, 3.5, -1.0], [-2.0, 3.5, -1.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
        parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
        ..Mesh::default()
    };
    let texel = |i: usize| if (i / 4 + i % 4).is_multiple_of(2) { [20, 90, 200, 255] } else { [230, 60, 30, 255] };
    let texels = (0..16).map(texel).collect();
    let texture = Texture {
        name: String::new(),
        width: 4,
        height: 4,
        texels,
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: canted_scene::Magnification::Linear,
    };
    let material = Material {
        base_color: [1.0; 3],
        base_color_texture: Some(TextureRef::new(TextureId(0))),
        ..Material::default()
    };
    let scene = Scene {
        meshes: vec![mesh],
        instances: vec![Instance {
            mesh: MeshId(0),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        }],
        materials: vec![material],
        textures: vec![texture],
        environment: Some([1.0; 3].into()),
        ..Scene::default()
    };
    let camera = Camera::pinhole([0.0, 4.0, 8.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0);
    OraclePicture { name: "checker", scene, camera, size: [64, 64], n_segments: Some(2), samples: 256 }
}

/// Unlimited paths in the Cornell box: under its sky, with the sun, and with a sphere light.
pub(crate) fn cornell_paths(test: &str) -> Option<[OraclePicture; 3]> {
    let sky = OraclePicture { name: "cornell-env", n_segments: None, samples: 256, ..cornell_env(test)? };
    let sun = OraclePicture { name: "cornell-sun", n_segments: None, samples: 256, ..cornell_sun(test)? };
    let picture = cornell_env(test)?;
    let lights = vec![Light::Sphere { center: [-0.9, 2.2, -1.2], radius: 0.3, radiance: [9.0, 8.0, 6.0] }];
    let scene = Scene { environment: None, lights, ..picture.scene };
    let ball = OraclePicture { name: "cornell-sphere", scene, n_segments: None, samples: 2048, ..picture };
    Some([sky, sun, ball])
}

impl OraclePicture {
    /// Our picture, with independent samples.
    ///
    /// Without ambient occlusion the hybrid integrator is a path tracer with limited path length. Light from the environment and
    /// from lights reaches its last vertex, which is one more segment than vertices.
    pub(crate) fn ours(&self) -> Vec<Block> {
        blocks_of_film(&self.film())
    }

    fn film(&self) -> Film {
        let [width, height] = self.size;
        let (integrator, bounces, ao_radius) = match self.n_segments {
            Some(n) => (Integrator::Hybrid, n - 2, Some(f32::INFINITY)),
            None => (Integrator::Path, Integrator::Path.bounces(), None),
        };
        let settings = Settings {
            width,
            height,
            samples: self.samples,
            integrator,
            bounces,
            pattern: Pattern::Random,
            // The other renderer samples textures at full size.
            lod: Lod::None,
            // It scatters once between microfacets.
            energy_compensation: false,
            ao_radius,
            ..Settings::default()
        };
        let bvh = SceneBvh::build(&self.scene, &SceneBvhConfig::default()).unwrap();
        render(&self.scene, &bvh, &self.camera, &settings, &|_, _| {}, &false.into()).unwrap()
    }

    /// The reference.
    pub(crate) fn theirs(&self) -> Vec<Block> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/oracle");
        let mean = read_picture(format!("{folder}/{}.exr", self.name).as_ref()).unwrap();
        let rows = fs::read_to_string(format!("{folder}/errors.tsv")).unwrap();
        let errors =
            rows.lines().filter_map(|row| row.split_once('\t')).find(|(name, _)| *name == self.name).unwrap().1;
        let errors: Vec<f64> = errors.split(' ').map(|number| f64::from(number.parse::<f32>().unwrap())).collect();
        blocks_of_reference(&mean, errors.as_chunks().0)
    }
}

/// The material as in Mitsuba: a smooth dielectric with an inside, or GGX in the metal's color, or Lambert.
fn as_the_other_has_it(material: &mut Material) {
    assert_eq!(material.metallic_roughness_texture, None, "{}: only factors are compared", material.name);
    if material.transmission > 0.5 {
        *material = Material {
            base_color: [1.0; 3],
            base_color_texture: None,
            roughness: 0.0,
            specular: 1.0,
            transmission: 1.0,
            ior: 1.5,
            thin_walled: false,
            ..std::mem::take(material)
        };
    } else if material.metallic < 0.5 {
        (material.metallic, material.specular) = (0.0, 0.0);
    }
}

/// The kitchen under a blue sky through its window.
pub(crate) fn kitchen_sky(test: &str) -> Option<OraclePicture> {
    let mut scene = model(test, "kitchen/country_kitchen.glb")?;
    scene.materials.iter_mut().for_each(as_the_other_has_it);
    (scene.lights, scene.environment) = (Vec::new(), Some(BLUE.into()));
    let camera = Camera::pinhole([1.211, 1.80475, 3.85239], [0.7729, 1.76308, 2.95443], [0.0, 1.0, 0.0], 36.5);
    Some(OraclePicture { name: "kitchen-env", scene, camera, size: [112, 64], n_segments: None, samples: 256 })
}

/// The same lit by a sphere light inside.
pub(crate) fn kitchen_ball(test: &str) -> Option<OraclePicture> {
    let picture = kitchen_sky(test)?;
    let ball = Light::Sphere { center: [1.9, 2.5, 2.2], radius: 0.15, radiance: [20.0, 18.0, 15.0] };
    let scene = Scene { lights: vec![ball], environment: None, ..picture.scene };
    Some(OraclePicture { name: "kitchen-sphere", scene, samples: 512, ..picture })
}

/// Its floor, where the sun reaches it through the window.
pub(crate) fn kitchen_sun(test: &str) -> Option<OraclePicture> {
    let picture = kitchen_sky(test)?;
    let scene = with_sun(picture.scene, [0.3, -0.5, 1.0], [60.0, 55.0, 45.0]);
    let camera = Camera::pinhole([0.7, 2.0, 3.0], [1.5, 0.0, 1.3], [0.0, 1.0, 0.0], 36.0);
    Some(OraclePicture { name: "kitchen-sun", scene, camera, size: [96, 64], samples: 512, ..picture })
}

/// The Cornell box lit by its own lamp, hung lower.
pub(crate) fn cornell_lamp(test: &str) -> Option<OraclePicture> {
    const DROP: f32 = 0.5;
    let mut scene = flat_model(test, "cornell/cornellBox.obj")?;
    for mesh in &mut scene.meshes {
        let ends = mesh.parts.iter().skip(1).map(|part| part.first_triangle as usize).chain([mesh.triangles.len()]);
        for (part, end) in mesh.parts.iter().zip(ends) {
            if scene.materials[part.material.0 as usize].emission != [0.0; 3] {
                let lamp: BTreeSet<u32> =
                    mesh.triangles[part.first_triangle as usize..end].iter().flatten().copied().collect();
                lamp.into_iter().for_each(|vertex| mesh.positions[vertex as usize][1] -= DROP);
            }
        }
    }
    let camera = Camera::pinhole([-0.23, 2.58, 9.0], [-0.23, 1.74, -3.0], [0.0, 1.0, 0.0], 27.0);
    Some(OraclePicture { name: "cornell-light", scene, camera, n_segments: None, samples: 1536, ..cornell_env(test)? })
}

/// A wall in the focus of a wide lens, and a floor out of focus.
pub(crate) fn lens() -> OraclePicture {
    let picture = checker();
    let mut scene = Scene { environment: Some(BLUE.into()), ..picture.scene };
    let mut ground = parts(&[floor()]);
    for mesh in &mut ground.meshes {
        mesh.parts[0].material = MaterialId(1);
    }
    for instance in &mut ground.instances {
        instance.mesh = MeshId(1);
    }
    scene.meshes.append(&mut ground.meshes);
    scene.instances.append(&mut ground.instances);
    scene.materials.append(&mut ground.materials);
    let camera = Camera { lens: Some(Lens { radius: 0.3, focus_distance: 6.0 }), ..picture.camera };
    OraclePicture { name: "lens", scene, camera, n_segments: None, samples: 512, ..picture }
}

const SIZE: [u32; 2] = [96, 64];

fn across_sponza() -> Camera {
    Camera::pinhole([700.0, 700.0, -100.0], [-300.0, 250.0, 100.0], [0.0, 1.0, 0.0], 60.0)
}

/// At noon, seen across its court; paths of three segments.
pub(crate) fn sponza_sun(test: &str) -> Option<OraclePicture> {
    let scene = Scene { environment: Some(BLUE.into()), ..model(test, "sponza/sponza.obj")? };
    let scene = with_sun(scene, [-0.15, -1.0, 0.12], [12.0, 11.0, 9.0]);
    Some(OraclePicture {
        name: "sponza-sun-3",
        scene,
        camera: across_sponza(),
        size: SIZE,
        n_segments: Some(3),
        samples: 128,
    })
}

/// The same with unlimited paths.
pub(crate) fn sponza_sun_paths(test: &str) -> Option<OraclePicture> {
    Some(OraclePicture { name: "sponza-sun", n_segments: None, samples: 768, ..sponza_sun(test)? })
}

/// Lit by a sphere light in the court, above the visible part.
pub(crate) fn sponza_ball(test: &str) -> Option<OraclePicture> {
    let light = Light::Sphere { center: [200.0, 1000.0, 0.0], radius: 100.0, radiance: [30.0, 27.0, 20.0] };
    let scene = Scene { lights: vec![light], ..model(test, "sponza/sponza.obj")? };
    Some(OraclePicture {
        name: "sponza-sphere",
        scene,
        camera: across_sponza(),
        size: SIZE,
        n_segments: None,
        samples: 256,
    })
}

/// The court from above, under a blue sky.
pub(crate) fn sponza_blue_sky(test: &str) -> Option<OraclePicture> {
    let scene = Scene { environment: Some(BLUE.into()), ..model(test, "sponza/sponza.obj")? };
    let camera = Camera::pinhole([600.0, 1350.0, 0.0], [-300.0, 450.0, 0.0], [0.0, 1.0, 0.0], 60.0);
    Some(OraclePicture { name: "sponza-env", scene, camera, size: SIZE, n_segments: None, samples: 512 })
}

/// The same under an image of the sky.
pub(crate) fn sponza_image_sky(test: &str) -> Option<OraclePicture> {
    let picture = sponza_blue_sky(test)?;
    let image = read_environment(&models(test)?.join("env/sky_64x32.exr"), &mut Vec::new()).unwrap();
    let scene = Scene { environment: Some(Environment::Image(image)), ..picture.scene };
    Some(OraclePicture { name: "sponza-sky", scene, ..picture })
}
