//! The body in a scene that can be rendered.
//! Also here: closed meshes, the lattice of phyxels inside of one, and surfels that follow the phyxels.

use std::f64::consts::TAU;

use anyhow::{Result, ensure};
use canted_obb::{Aabb, Affine};
use canted_renderer::{SceneBvh, SceneBvhConfig, UpdateOptions, Updates};
use canted_scene::{Camera, Instance, Light, Material as Paint, MaterialId, Mesh, MeshId, Part, Scene};
use canted_wide::{Preset, TriangleBvh};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    Floor, Material,
    body::{Body, BodyError},
    neighbors::{Grid, distance_squared, kernel, vector},
};

/// Acceleration by gravity, m/s².
const GRAVITY: [f64; 3] = [0.0, -9.81, 0.0];

/// Stripes of the body, and tiles along a side of the floor.
const N_STRIPES: u32 = 16;
const N_TILES: u32 = 24;

/// An elastic body that falls onto a floor at height 0, and the scene of it.
pub struct Simulation {
    /// The body.
    pub body: Body,
    /// Mesh 0 is the surface of the body, mesh 1 the floor.
    pub scene: Scene,
    /// The acceleration structure of the scene, updated with it.
    pub prepared: SceneBvh,
    surface: Surface,
    floor: Floor,
}

impl Simulation {
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
        let prepared = SceneBvh::build(&scene, &SceneBvhConfig::default())?;
        Ok(Self { body, scene, prepared, surface, floor })
    }

    /// Moves the body through a time, then its mesh, then updates the acceleration structure. Returns the number of time steps, and
    /// what was updated.
    ///
    /// # Errors
    /// A simulation that diverged; a scene that cannot be traced.
    pub fn advance(&mut self, seconds: f64, options: &UpdateOptions) -> Result<(u32, Updates)> {
        let n_steps = self.step(seconds)?;
        self.carry();
        Ok((n_steps, self.prepared.update(&self.scene, options)?))
    }

    /// Moves the body alone. Returns the number of time steps.
    ///
    /// # Errors
    /// [`BodyError::Diverged`].
    pub fn step(&mut self, seconds: f64) -> Result<u32, BodyError> {
        self.body.advance(seconds, GRAVITY, Some(self.floor))
    }

    /// Moves the mesh to where the body is, with its normals.
    pub fn carry(&mut self) {
        let mesh = &mut self.scene.meshes[0];
        mesh.positions = self.surface.positions(&self.body);
        mesh.normals = Some(normals(&mesh.positions, &mesh.triangles));
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
            let [x, z] = [tile % N_TILES, tile / N_TILES].map(|i| SIDE * (i as f32 - 0.5 * N_TILES as f32));
            let first = u32::try_from(mesh.positions.len()).expect("few tiles");
            mesh.positions.extend([[x, 0.0, z], [x, 0.0, z + SIDE], [x + SIDE, 0.0, z + SIDE], [x + SIDE, 0.0, z]]);
            mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|i| first + i)));
        }
    }
    mesh
}

/// Unit vertex normals, weighted by the area of the triangles around; zero, for the geometric normal, where they cancel.
#[must_use]
pub fn normals(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| Vec3::from(positions[i as usize]));
        let twice_area = (b - a).cross(c - a);
        triangle.iter().for_each(|&i| sums[i as usize] += twice_area);
    }
    sums.into_iter().map(|sum| sum.normalize_or_zero().to_array()).collect()
}

/// A triangle mesh, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertices, m.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// A torus around the point at `height` on the y axis, which rolls about z and is then tilted about x by an angle.
///
/// `n[0]` rings of `n[1]` vertices each; triangles are listed ring by ring.
#[must_use]
pub fn torus([major, minor]: [f64; 2], n: [u32; 2], height: f64, tilt_rad: f64) -> TriangleMesh {
    let angle = |i: u32, n: u32| (TAU * f64::from(i) / f64::from(n)).sin_cos();
    let (sin_tilt, cos_tilt) = tilt_rad.sin_cos();
    let vertex = |i: u32, j: u32| {
        let ((sin_i, cos_i), (sin_j, cos_j)) = (angle(i, n[0]), angle(j, n[1]));
        let from_axis = major + minor * cos_j;
        let [x, y, z] = [from_axis * cos_i, from_axis * sin_i, minor * sin_j];
        [x, height + cos_tilt * y - sin_tilt * z, sin_tilt * y + cos_tilt * z].map(|x| x as f32)
    };
    let rings = || (0..n[0]).flat_map(|i| (0..n[1]).map(move |j| (i, j)));
    let index = |i: u32, j: u32| (i % n[0]) * n[1] + j % n[1];
    let quad = |(i, j): (u32, u32)| {
        let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    TriangleMesh {
        positions: rings().map(|(i, j)| vertex(i, j)).collect(),
        triangles: rings().flat_map(quad).collect(),
    }
}

/// Centers of all cells of a cubic lattice that are inside of a closed mesh. The lattice starts at the least corner of its bounds.
///
/// # Errors
/// A spacing that is not above zero, or gives more than 2^24 cells; invalid geometry, by index.
pub fn lattice_inside(mesh: &TriangleMesh, spacing: f64) -> Result<Vec<[f32; 3]>> {
    const MAX_CELLS: f64 = (1 << 24) as f64;
    let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Preset::Fast)?;
    let bounds = Aabb::from_points(mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize]));
    let n = std::array::from_fn(|k| ((f64::from(bounds.max[k]) - f64::from(bounds.min[k])) / spacing).ceil());
    let [nx, ny, nz]: [f64; 3] = n;
    ensure!(spacing > 0.0 && nx * ny * nz <= MAX_CELLS, "spacing {spacing} m of phyxels: use a larger one");
    let counter = |n: f64| {
        let n = n as u32;
        0..n
    };
    let mut centers = Vec::new();
    for i in counter(nx) {
        for j in counter(ny) {
            for k in counter(nz) {
                let cell = [i, j, k].map(|i| (f64::from(i) + 0.5) * spacing);
                centers.push(std::array::from_fn(|k| (f64::from(bounds.min[k]) + cell[k]) as f32));
            }
        }
    }
    let mut inside = vec![false; centers.len()];
    bvh.par_contains_many(&centers, &mut inside);
    Ok(centers.into_iter().zip(inside).filter_map(|(center, is_inside)| is_inside.then_some(center)).collect())
}

/// A phyxel that moves a surfel.
struct Anchor {
    phyxel: u32,
    /// The weights of a surfel sum to 1.
    weight: f64,
    /// From the phyxel to the surfel, at rest.
    offset: DVec3,
}

/// The surfels of a body: vertices of a mesh that follow the phyxels.
pub struct Surface {
    rest: Vec<DVec3>,
    anchors: Vec<Vec<Anchor>>,
}

impl Surface {
    /// Surfels at the given rest positions, each moved by all phyxels in whose radius of action it is.
    ///
    /// # Errors
    /// [`BodyError::Detached`] where a surfel, possibly one that is not finite, is in the radius of action of no phyxel.
    pub fn new(body: &Body, positions: &[[f32; 3]]) -> Result<Self, BodyError> {
        let phyxels: Vec<[f32; 3]> = body.rest.iter().map(|rest| rest.to_array().map(|x| x as f32)).collect();
        let radius = body.radii.iter().copied().fold(0.0, f64::max);
        let grid = Grid::new(&phyxels, radius);
        let anchors = positions.iter().enumerate().map(|(surfel, &position)| {
            let mut anchors: Vec<Anchor> = grid
                .within(position, radius)
                .into_iter()
                .map(|phyxel| {
                    let i = phyxel as usize;
                    let weight = kernel(distance_squared(phyxels[i], position), body.radii[i]);
                    Anchor { phyxel, weight, offset: vector(position) - body.rest[i] }
                })
                .filter(|anchor| anchor.weight > 0.0)
                .collect();
            let sum: f64 = anchors.iter().map(|anchor| anchor.weight).sum();
            anchors.iter_mut().for_each(|anchor| anchor.weight /= sum);
            if anchors.is_empty() { Err(BodyError::Detached { surfel, position }) } else { Ok(anchors) }
        });
        Ok(Self { anchors: anchors.collect::<Result<_, _>>()?, rest: positions.iter().copied().map(vector).collect() })
    }

    /// Positions of the surfels as the body is deformed, m, rounded to `f32`.
    ///
    /// Each phyxel moves a surfel by its own displacement and gradient, as in Müller et al.; a surfel takes the weighted mean. An
    /// affine motion of the phyxels moves the surfels alike.
    #[must_use]
    pub fn positions(&self, body: &Body) -> Vec<[f32; 3]> {
        let gradient = |i| body.gradient(i, &body.displacements);
        let gradients: Vec<DMat3> = (0..body.n_phyxels()).into_par_iter().map(gradient).collect();
        let moved = self.rest.par_iter().zip(&self.anchors).map(|(&rest, anchors)| {
            let displacement: DVec3 = anchors
                .iter()
                .map(|&Anchor { phyxel, weight, offset }| {
                    let i = phyxel as usize;
                    weight * (body.displacements[i] + gradients[i] * offset)
                })
                .sum();
            (rest + displacement).to_array().map(|x| x as f32)
        });
        moved.collect()
    }
}
