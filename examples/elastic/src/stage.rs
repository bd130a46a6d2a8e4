//! The body in a scene that can be rendered.

use anyhow::Result;
use canted_obb::Affine;
use canted_renderer::{Prepared, StructureConfig, UpdateOptions, Updates, prepare};
use canted_scene::{Camera, Instance, Light, Material as Paint, MaterialId, Mesh, MeshId, Part, Scene};
use canted_trace::Watertight;
use glam::Vec3;

use crate::{Body, Floor, Material, Surface, TriangleMesh, lattice_inside};

/// Acceleration by gravity, m/s².
const GRAVITY: [f64; 3] = [0.0, -9.81, 0.0];

/// Stripes of the body, and tiles along a side of the floor.
const N_STRIPES: u32 = 16;
const N_TILES: u32 = 24;

/// An elastic body that falls onto a floor at height 0, and the scene of it.
pub struct Stage {
    /// The body.
    pub body: Body,
    /// Mesh 0 is the surface of the body, mesh 1 the floor.
    pub scene: Scene,
    /// The acceleration structure of the scene, updated with it.
    pub prepared: Prepared<Watertight>,
    surface: Surface,
    floor: Floor,
}

impl Stage {
    /// Fills a closed mesh with phyxels of the given spacing in m.
    ///
    /// # Errors
    /// Invalid geometry; a spacing too large for the mesh, or too small; a material out of range.
    pub fn new(mesh: &TriangleMesh, spacing: f64, material: &Material) -> Result<Self> {
        let body = Body::new(&lattice_inside(mesh, spacing)?, spacing * spacing * spacing, material)?;
        let surface = Surface::new(&body, &mesh.positions)?;
        // A phyxel stands for a cell, which is half a spacing deeper than its center.
        let floor = Floor { height: 0.5 * spacing, friction: 0.4 };
        let scene = scene(mesh);
        let prepared = prepare(&scene, &StructureConfig::default())?;
        Ok(Self { body, scene, prepared, surface, floor })
    }

    /// Moves the body through a time, then its mesh, then updates the acceleration structure. Returns the number of time steps, and
    /// what was updated.
    ///
    /// # Errors
    /// A simulation that diverged; a scene that cannot be traced.
    pub fn advance(&mut self, seconds: f64, options: &UpdateOptions) -> Result<(u32, Updates)> {
        let n_steps = self.body.advance(seconds, GRAVITY, Some(self.floor))?;
        let mesh = &mut self.scene.meshes[0];
        mesh.positions = self.surface.positions(&self.body);
        mesh.normals = Some(normals(&mesh.positions, &mesh.triangles));
        Ok((n_steps, self.prepared.update(&self.scene, options)?))
    }
}

/// The scene: the body, a floor of tiles, a sun and a sky.
fn scene(body: &TriangleMesh) -> Scene {
    let paint = |name: &str, base_color| Paint { name: name.to_owned(), base_color, ..Paint::default() };
    let n_body = u32::try_from(body.triangles.len()).unwrap_or(u32::MAX);
    let stripe = |i| Part { first_triangle: i * (n_body / N_STRIPES), material: MaterialId(i % 2) };
    let body = Mesh {
        name: "body".to_owned(),
        normals: Some(normals(&body.positions, &body.triangles)),
        positions: body.positions.clone(),
        triangles: body.triangles.clone(),
        parts: (0..N_STRIPES).map(stripe).collect(),
        ..Mesh::default()
    };
    let place = |mesh, first_primitive| Instance {
        mesh: MeshId(mesh),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive,
    };
    Scene {
        meshes: vec![body, floor()],
        instances: vec![place(0, 0), place(1, n_body)],
        materials: vec![
            paint("red", [0.65, 0.09, 0.06]),
            paint("cream", [0.85, 0.75, 0.55]),
            paint("light tiles", [0.55, 0.56, 0.58]),
            paint("dark tiles", [0.30, 0.32, 0.36]),
        ],
        lights: vec![Light::Sun {
            direction: Vec3::new(-0.5, -1.0, -0.35).normalize().to_array(),
            irradiance: [3.0, 2.8, 2.5],
        }],
        environment: Some([0.45, 0.52, 0.65].into()),
        cameras: vec![Camera::pinhole([1.3, 1.25, 3.6], [0.0, 0.62, 0.0], [0.0, 1.0, 0.0], 38.0)],
        ..Scene::default()
    }
}

/// A checkered floor at height 0: all light tiles, then all dark ones.
fn floor() -> Mesh {
    const SIDE: f32 = 0.5;
    let mut mesh = Mesh { name: "floor".to_owned(), ..Mesh::default() };
    for parity in 0..2 {
        mesh.parts.push(Part {
            first_triangle: u32::try_from(mesh.triangles.len()).expect("few tiles"),
            material: MaterialId(2 + parity),
        });
        for tile in (0..N_TILES * N_TILES).filter(|tile| (tile % N_TILES + tile / N_TILES) % 2 == parity) {
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let [x, z] = [tile % N_TILES, tile / N_TILES].map(|i| SIDE * (i as f32 - 0.5 * N_TILES as f32));
            let first = u32::try_from(mesh.positions.len()).expect("few tiles");
            mesh.positions.extend([[x, 0.0, z], [x, 0.0, z + SIDE], [x + SIDE, 0.0, z + SIDE], [x + SIDE, 0.0, z]]);
            mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|i| first + i)));
        }
    }
    mesh
}

/// Unit vertex normals, weighted by the area of the triangles around; zero, for the geometric normal, where they cancel.
fn normals(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| Vec3::from(positions[i as usize]));
        let twice_area = (b - a).cross(c - a);
        triangle.iter().for_each(|&i| sums[i as usize] += twice_area);
    }
    sums.into_iter().map(|sum| sum.normalize_or_zero().to_array()).collect()
}
