//! Small scenes, and a brute-force tracer.

use std::sync::atomic::AtomicBool;

use canted_film::Film;
use canted_obb::vector;
pub(crate) use canted_obb::vector::{Vector, cross, dot, sub, to_f32 as narrow};
use canted_obb::{Affine, Obb, PrimId};
use canted_renderer::{Levels, SceneBvh, SceneBvhConfig, Settings, render};
use canted_scene::{
    Camera, Encoding, Instance, Light, Magnification, Material, MaterialId, Mesh, MeshId, Part, Scene, Texture, Wrap,
};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Intersect, Query, Ray, ScaledRay, Side};

/// Half of `f32::EPSILON`: the relative error of one rounding.
pub(crate) const U: f64 = 0.5 * f32::EPSILON as f64;

pub(crate) fn unit(a: Vector) -> Vector {
    vector::unit(a).expect("a direction")
}

/// Tests every triangle of every instance, in object space, in `f64`, including edges.
///
/// The ray is rounded to `f32` in object space, as in the tracers under test.
pub(crate) struct BruteForce<'a> {
    scene: &'a Scene,
    /// Rows of the inverse linear parts.
    inverses: Vec<[Vector; 3]>,
}

impl<'a> BruteForce<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Self {
        let inverse = |instance: &Instance| {
            let [a, b, c, _] = instance.world_from_object.columns.map(|column| column.map(f64::from));
            let determinant = dot(a, cross(b, c));
            [cross(b, c), cross(c, a), cross(a, b)].map(|row| row.map(|x| x / determinant))
        };
        Self { scene, inverses: scene.instances.iter().map(inverse).collect() }
    }

    fn each_hit(&self, ray: &ScaledRay, query: &mut dyn Query, mut found: impl FnMut(Hit)) {
        for (i, instance) in self.scene.instances.iter().enumerate() {
            let shift = instance.world_from_object.columns[3].map(f64::from);
            let to_object = |v: Vector| narrow(self.inverses[i].map(|row| dot(row, v))).map(f64::from);
            let origin = to_object(sub(ray.origin.map(f64::from), shift));
            let direction = to_object(ray.direction.map(f64::from));
            let mesh = &self.scene.meshes[instance.mesh.0 as usize];
            query.boxes(1);
            query.triangles(u32::try_from(mesh.triangles.len()).unwrap());
            for (primitive, triangle) in (0..).zip(&mesh.triangles) {
                let corners = triangle.map(|v| mesh.positions[v as usize].map(f64::from));
                let Some((t, u, v, side)) = intersect(origin, direction, corners) else { continue };
                let (t, u, v) = (t as f32, u as f32, v as f32);
                let hit = Hit {
                    t: ray.caller_t(t),
                    u,
                    v,
                    primitive: PrimId(primitive),
                    instance: InstanceId(u32::try_from(i).unwrap()),
                    side,
                };
                if ray.t_min <= t && t <= ray.t_max && query.accepts(&hit) {
                    found(hit);
                }
            }
        }
    }
}

/// Möller-Trumbore in `f64`, with closed edges, two-sided.
fn intersect(origin: Vector, direction: Vector, [v0, v1, v2]: [Vector; 3]) -> Option<(f64, f64, f64, Side)> {
    let (e1, e2) = (sub(v1, v0), sub(v2, v0));
    let p = cross(direction, e2);
    let determinant = dot(p, e1);
    if determinant == 0.0 {
        return None;
    }
    let from_v0 = sub(origin, v0);
    let u = dot(p, from_v0) / determinant;
    let q = cross(from_v0, e1);
    let v = dot(q, direction) / determinant;
    let t = dot(q, e2) / determinant;
    let side = if determinant > 0.0 { Side::Front } else { Side::Back };
    // Edges are widened by a few f64 roundings, so that no ray passes between neighbors.
    const EDGE: f64 = 1e-12;
    (u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE && t >= 0.0).then_some((t, u, v, side))
}

impl Intersect for BruteForce<'_> {
    fn bounds(&self) -> Obb {
        Obb::from_aabb(&self.scene.bounds_world())
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> Option<Hit> {
        let mut closest: Option<Hit> = None;
        self.each_hit(ray, query, |hit| {
            if closest.is_none_or(|best| hit.before(&best)) {
                closest = Some(hit);
            }
        });
        closest
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> bool {
        let mut any = false;
        self.each_hit(ray, query, |_| any = true);
        any
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64], hits: &mut Vec<Hit>) {
        let first = hits.len();
        self.each_hit(ray, query, |hit| hits.push(hit));
        hits[first..].sort_by(|a, b| a.t.total_cmp(&b.t));
    }
}

pub(crate) fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    let parts = vec![Part { first_triangle: 0, material: MaterialId(material) }];
    Mesh { positions, triangles, parts, ..Mesh::default() }
}

/// A parallelogram with its front along `a x b`.
pub(crate) fn parallelogram(corner: [f32; 3], a: [f32; 3], b: [f32; 3], material: u32) -> Mesh {
    let at = |s: f32, t: f32| std::array::from_fn(|k| corner[k] + s * a[k] + t * b[k]);
    mesh(vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)], vec![[0, 1, 2], [0, 2, 3]], material)
}

/// A square with half-side `half` in the plane y = `height`, front up.
pub(crate) fn floor(half: f32, height: f32, material: u32) -> Mesh {
    parallelogram([-half, height, -half], [0.0, 0.0, 2.0 * half], [2.0 * half, 0.0, 0.0], material)
}

/// A box with its fronts outside.
pub(crate) fn cuboid(min: [f32; 3], max: [f32; 3], material: u32) -> Mesh {
    let corner = |i: usize| std::array::from_fn(|k| if i >> k & 1 == 1 { max[k] } else { min[k] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh((0..8).map(corner).collect(), triangles, material)
}

/// A triangulated sphere with its fronts outside: an octahedron subdivided `level` times.
pub(crate) fn sphere(center: [f32; 3], radius: f32, level: u32, material: u32) -> Mesh {
    let mut faces: Vec<[Vector; 3]> = (0..8)
        .map(|octant| {
            let s = |k: u32| if octant >> k & 1 == 1 { -1.0 } else { 1.0 };
            let (x, y, z) = ([s(0), 0.0, 0.0], [0.0, s(1), 0.0], [0.0, 0.0, s(2)]);
            if s(0) * s(1) * s(2) > 0.0 { [x, y, z] } else { [y, x, z] }
        })
        .collect();
    for _ in 0..level {
        let midpoint = |a: Vector, b: Vector| unit(std::array::from_fn(|k| a[k] + b[k]));
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (midpoint(a, b), midpoint(b, c), midpoint(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    // Equal points have equal bits, because the midpoint of an edge does not depend on its direction.
    let mut positions: Vec<[f32; 3]> = Vec::new();
    let mut known = std::collections::HashMap::new();
    let triangles = faces
        .iter()
        .map(|face| {
            face.map(|v| {
                let p = narrow(std::array::from_fn(|k| f64::from(center[k]) + f64::from(radius) * v[k]));
                // Adding zero merges the two signed zeros.
                *known.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                    positions.push(p);
                    u32::try_from(positions.len() - 1).unwrap()
                })
            })
        })
        .collect();
    mesh(positions, triangles, material)
}

/// The mesh with reversed winding.
pub(crate) fn inside_out(mut mesh: Mesh) -> Mesh {
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    mesh
}

pub(crate) fn gray(albedo: f32) -> Material {
    Material { base_color: [albedo; 3], ..Material::default() }
}

pub(crate) fn place(mesh: u32, world_from_object: Affine) -> Instance {
    Instance { mesh: MeshId(mesh), world_from_object, world_from_object_close: None, first_primitive: 0 }
}

/// Static meshes without lights or environment.
pub(crate) fn scene(meshes: Vec<Mesh>, materials: Vec<Material>) -> Scene {
    let instances = (0..u32::try_from(meshes.len()).unwrap()).map(|i| place(i, Affine::IDENTITY)).collect();
    Scene { meshes, instances, materials, environment: Some([0.0; 3].into()), ..Scene::default() }
}

/// A box on a floor under a sky and a sun.
pub(crate) fn box_on_floor(half: f32, fov_degrees: f32) -> (Scene, Camera) {
    let bodies = vec![floor(half, 0.0, 0), cuboid([-1.0, 0.0, -1.0], [1.0, 1.5, 0.5], 1)];
    let orange = Material { base_color: [0.9, 0.4, 0.1], ..Material::default() };
    let lights = vec![Light::Sun { direction: [-0.6, -0.8, 0.0], irradiance: [2.0; 3] }];
    let stage = Scene { lights, ..under([0.3, 0.4, 0.6], scene(bodies, vec![gray(0.8), orange])) };
    (stage, camera([3.0, 3.0, 4.0], [0.0, 0.5, 0.0], fov_degrees))
}

pub(crate) fn camera(eye: [f32; 3], target: [f32; 3], fov_degrees: f32) -> Camera {
    // Any direction not parallel to the view works as up.
    let view = unit(sub(target.map(f64::from), eye.map(f64::from)));
    let up = if view[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, -1.0] };
    Camera::pinhole(eye, target, up, fov_degrees)
}

/// Settings of a small image without ambient light.
pub(crate) fn settings(width: u32, height: u32, samples: u32, bounces: u32) -> Settings {
    Settings { width, height, samples, bounces, ao_radius: Some(f32::INFINITY), ..Settings::default() }
}

pub(crate) fn film(scene: &Scene, camera: &Camera, settings: &Settings) -> Film {
    film_of(scene, &BruteForce::new(scene), camera, settings)
}

/// The film of a scene, traced through a structure.
pub(crate) fn film_of(scene: &Scene, structure: &dyn Intersect, camera: &Camera, settings: &Settings) -> Film {
    render(scene, structure, camera, settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

/// The structure of a scene with so many levels.
pub(crate) fn prepared(scene: &Scene, levels: Levels) -> SceneBvh {
    SceneBvh::build(scene, &SceneBvhConfig { levels, ..SceneBvhConfig::default() }).unwrap()
}

/// The scene under a sky of constant radiance.
pub(crate) fn under(radiance: [f32; 3], scene: Scene) -> Scene {
    Scene { environment: Some(radiance.into()), ..scene }
}

/// A texture with linear magnification.
pub(crate) fn texture([width, height]: [u32; 2], texels: Vec<[u8; 4]>, encoding: Encoding, wrap: Wrap) -> Texture {
    let (name, magnification) = (String::new(), Magnification::Linear);
    Texture { name, width, height, texels, encoding, wrap: [wrap; 2], magnification }
}

/// Rays from all around the origin, with directions of many lengths.
pub(crate) fn rays_from_all_around(n: usize) -> impl Iterator<Item = Ray> {
    let mut state = 1_u32;
    let mut number = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(u16::try_from(state >> 16).unwrap()) / 32768.0 - 1.0
    };
    (0..n).map(move |i| {
        let origin = [(); 3].map(|()| 3.0 * number());
        let target = [(); 3].map(|()| 1.5 * number());
        let length = [1e-3, 1.0, 1e5][i % 3];
        Ray::new(origin, std::array::from_fn(|k| if i % 7 == k { -0.0 } else { (target[k] - origin[k]) * length }))
    })
}

/// Radiance from `target` towards `eye`: one pixel with a field of view of a hundredth of a degree.
pub(crate) fn probe(scene: &Scene, eye: [f32; 3], target: [f32; 3], settings: Settings) -> Vector {
    let one = Settings { width: 1, height: 1, ..settings };
    film(scene, &camera(eye, target, 0.01), &one).pixels()[0].mean()
}

// Pearson's chi-squared test.

/// Deviation of Pearson's statistic from its mean, in standard deviations.
///
/// Cells with an expected count below ten are merged.
pub(crate) fn deviation(counts: &[f64], probabilities: &[f64]) -> f64 {
    let n: f64 = counts.iter().sum();
    let (mut statistic, mut freedom, mut rare) = (0.0, -1.0, (0.0, 0.0));
    let mut add = |count: f64, expected: f64| {
        statistic += (count - expected).powi(2) / expected;
        freedom += 1.0;
    };
    for (&count, &probability) in counts.iter().zip(probabilities) {
        let expected = probability * n;
        if expected < 10.0 { rare = (rare.0 + count, rare.1 + expected) } else { add(count, expected) }
    }
    if rare.1 >= 10.0 {
        add(rare.0, rare.1);
    } else {
        // Too few for the statistic; the count must still match the expectation.
        assert!(rare.0 <= rare.1.max(0.0) + 6.0 * (rare.1.max(0.0) + 1.0).sqrt(), "{rare:?}");
    }
    let freedom: f64 = freedom;
    (statistic - freedom) / (2.0 * freedom.max(1.0)).sqrt()
}
