//! The built-in scene as both tracers take it, and its camera rays.

use canted_gpu::{Gpu, GpuError, Options, Source, TracedScene, build::BuildConfig};
use canted_lbvh::{Corners, Strategy, triangle_corners};
use canted_obb::vector::{Vector, add, cross, dot, scale, sub, to_f32, to_f64, unit};
use canted_scene::{Light, Projection, Scene, builtin};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, Ray, SurfacePoint};
use canted_wide::{Preset, TriangleBvh};

use crate::Failure;

/// Width and height of the picture in pixels.
pub(crate) const SIZE: [usize; 2] = [192, 108];

/// The scene and the parts of it that both tracers share.
pub(crate) struct View {
    scene: Scene,
    corners: Vec<Vec<Corners>>,
    instances: Vec<Instance>,
    /// Towards the sun.
    sun: [f64; 3],
}

impl View {
    pub(crate) fn new() -> Result<Self, Failure> {
        let scene = builtin();
        let corners = scene.meshes.iter().map(|mesh| Ok(triangle_corners(&mesh.positions, &mesh.triangles)?.0));
        let corners = corners.collect::<Result<_, Failure>>()?;
        let instances = scene.instances.iter().map(|placed| Instance::new(placed.mesh.0, placed.world_from_object));
        let instances = instances.collect();
        let direction = scene.lights.iter().find_map(|light| match light {
            Light::Sun { direction, .. } => Some(to_f64(*direction)),
            _ => None,
        });
        let sun = scale(direction.ok_or("the built-in scene has no sun")?, -1.0);
        Ok(Self { scene, corners, instances, sun })
    }

    /// Both levels, built on the device.
    pub(crate) async fn on_device(&self, gpu: &Gpu, without_first: bool) -> Result<TracedScene, GpuError> {
        let config = BuildConfig { strategy: Strategy::Combined, ..BuildConfig::default() };
        let mut instances = self.instances.clone();
        if without_first {
            // Out of sight, so that the others keep their numbers.
            instances[0].world_from_object.columns[3][1] += 1e5;
        }
        TracedScene::new(gpu, Source::build(&self.corners, config).with_instances(&instances), Options::default()).await
    }

    /// Both levels, built on the CPU.
    pub(crate) fn on_cpu(&self) -> Result<Tlas<TriangleBvh>, Failure> {
        let build = |mesh: &canted_scene::Mesh| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Preset::Fast);
        let meshes = self.scene.meshes.iter().map(build);
        Ok(Tlas::new(meshes.collect::<Result<_, _>>()?, &self.instances, TopConfig::default())?)
    }

    /// The ray through the center of each pixel, row by row.
    pub(crate) fn camera_rays(&self) -> Result<Vec<Ray>, Failure> {
        let camera = self.scene.cameras.first().ok_or("the built-in scene has no camera")?;
        let Projection::Perspective { fov_degrees } = camera.projection else {
            return Err("the built-in camera has no perspective".into());
        };
        let [eye, target, up] = [camera.eye, camera.target, camera.up].map(to_f64);
        let forward = unit(sub(target, eye)).ok_or("the built-in camera has no direction")?;
        let right = unit(cross(forward, up)).ok_or("the built-in camera looks up")?;
        let down = cross(forward, right);
        let pixel = 2.0 * (0.5 * f64::from(fov_degrees).to_radians()).tan() / from(SIZE[1]);
        let at = |i: usize| {
            let [x, y] = [(i % SIZE[0], SIZE[0]), (i / SIZE[0], SIZE[1])].map(|(i, n)| from(i) + 0.5 - 0.5 * from(n));
            let direction = add(forward, add(scale(right, x * pixel), scale(down, y * pixel)));
            Ray::new(camera.eye, to_f32(direction))
        };
        Ok((0..SIZE[0] * SIZE[1]).map(at).collect())
    }

    /// The ray from each hit to the sun; `None` for misses.
    pub(crate) fn shadow_rays(&self, hits: &[Option<Hit>]) -> Vec<Option<Ray>> {
        let sun = to_f32(self.sun);
        hits.iter().map(|hit| hit.as_ref().map(|hit| self.point(hit).spawn_ray(sun))).collect()
    }

    /// RGBA of each pixel: sunlight, sky light, and sky behind.
    pub(crate) fn picture(&self, hits: &[Option<Hit>], in_shadow: &[bool]) -> Vec<u8> {
        let shade = |(hit, &in_shadow): (&Option<Hit>, &bool)| {
            let Some(hit) = hit else { return [0.36, 0.50, 0.72] };
            let placed = &self.scene.instances[hit.instance.0 as usize];
            let mesh = &self.scene.meshes[placed.mesh.0 as usize];
            let color = self.scene.materials[mesh.material_of(hit.primitive.0).0 as usize].base_color;
            let facing = dot(self.point(hit).normal, self.sun).abs();
            let light = [1.5, 1.1, 0.7].map(|sun| if in_shadow { 0.0 } else { sun * facing });
            [0, 1, 2].map(|c| f64::from(color[c]) * (light[c] + [0.25, 0.3, 0.4][c]))
        };
        hits.iter().zip(in_shadow).map(shade).flat_map(encoded).collect()
    }

    fn point(&self, hit: &Hit) -> SurfacePoint {
        let placed = &self.scene.instances[hit.instance.0 as usize];
        let vertices = self.corners[placed.mesh.0 as usize][hit.primitive.index()];
        let reach = vertices.as_flattened().iter().fold(0.0, |reach: f32, x| reach.max(x.abs()));
        SurfacePoint::in_instance(hit, vertices, reach, &placed.world_from_object)
    }
}

/// A linear color as bytes of sRGB, opaque.
fn encoded(color: Vector) -> [u8; 4] {
    let [r, g, b] = color.map(|c| (255.0 * c.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8);
    [r, g, b, 255]
}

/// A count as a coordinate.
fn from(n: usize) -> f64 {
    n as f64
}
