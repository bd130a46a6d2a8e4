//! Transforms, and rays that graze what they place.

use canted_fixtures::{Grazing, Mesh, Rotation, SplitMix64, grazing, soup, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{BuildConfig, Instance, MeshBlas};
use canted_trace::{Kernel, Ray};

/// The columns of a rotation times a diagonal, then a shift.
#[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
pub(crate) fn affine(turn: &Rotation, scale: [f64; 3], shift: [f32; 3]) -> Affine {
    let column = |j: usize| turn.rows.map(|row| (row[j] * scale[j]) as f32);
    Affine { columns: [column(0), column(1), column(2), shift] }
}

/// A transform of each kind, by name, alone and piled on others.
pub(crate) fn transforms() -> Vec<(&'static str, Affine)> {
    let turn = Rotation::turn();
    let far = [1e7, -1e7, 3e6];
    let shear = Affine { columns: [[1.0, 0.0, 0.0], [0.7, 1.0, 0.0], [-0.4, 0.9, 1.0], [0.2, 0.1, -0.3]] };
    vec![
        ("identity", Affine::IDENTITY),
        ("rotation", affine(&turn, [1.0; 3], [0.3, -0.2, 0.5])),
        ("mirror", affine(&Rotation::IDENTITY, [-1.0, 1.0, 1.0], [0.1, 0.0, 0.0])),
        ("unequal scale", affine(&turn, [3.0, 0.2, 1.5], [-0.5, 0.4, 0.0])),
        ("shear", shear),
        ("scale 1e-3", affine(&turn, [1e-3; 3], [0.4, 0.4, 0.4])),
        ("scale 1e3, mirrored", affine(&turn, [1e3, 1e3, -1e3], [-300.0, -200.0, 100.0])),
        ("far", affine(&turn, [50.0, 60.0, 40.0], far)),
        ("far, large", affine(&Rotation::IDENTITY, [1e4, -1e4, 2e4], far)),
        ("far, sheared", Affine { columns: [[90.0, 10.0, 0.0], [50.0, 100.0, 0.0], [-40.0, 9.0, 80.0], far] }),
    ]
}

/// Every kind of transform, and a heap of small turned copies that overlap each other.
pub(crate) fn crowd() -> Vec<Affine> {
    let mut rng = SplitMix64::new(31);
    let mut placed: Vec<Affine> = transforms().into_iter().map(|(_, affine)| affine).collect();
    placed.extend((0..40).map(|_| {
        let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
        let scale = std::array::from_fn(|_| 0.3 + rng.unit());
        #[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
        let shift = rng.signed3().map(|x| x as f32);
        affine(&turn, scale, shift)
    }));
    placed
}

/// Two bottom levels that instances take in turn.
pub(crate) fn meshes() -> [Mesh; 2] {
    [soup(5, 120), torus(10, 6)]
}

/// The bottom level of an instance.
pub(crate) fn blas_of(instance: usize) -> usize {
    instance % 2
}

pub(crate) fn instances(placed: &[Affine]) -> Vec<Instance> {
    let blas = |i: usize| u32::try_from(blas_of(i)).unwrap();
    placed.iter().enumerate().map(|(i, &affine)| Instance::still(blas(i), affine)).collect()
}

pub(crate) fn build<K: Kernel>(mesh: &Mesh, strategy: Strategy) -> MeshBlas<K> {
    let volumes = VolumeConfig { strategy, fallback: true };
    MeshBlas::build(&mesh.positions, &mesh.triangles, &BuildConfig { volumes, ..BuildConfig::default() }).unwrap()
}

/// Rays that graze the image of `mesh`, `n` of each class, half of them ending or beginning near where they aim.
pub(crate) fn rays(mesh: &Mesh, world_from_object: &Affine, n: usize, seed: u64) -> Vec<Ray> {
    let positions = mesh.positions.iter().map(|&p| world_from_object.point(p)).collect();
    let image = Mesh { positions, triangles: mesh.triangles.clone() };
    Grazing::ALL
        .into_iter()
        .flat_map(|class| grazing(&image, class, n, seed))
        .enumerate()
        .map(|(i, ray)| {
            let (t_min, t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY), (0.0, f32::INFINITY)][i % 4];
            Ray { origin: ray.origin, direction: ray.direction, t_min, t_max }
        })
        .collect()
}

/// Rays at every instance of a scene.
pub(crate) fn all_rays(placed: &[Affine], n: usize) -> Vec<Ray> {
    let meshes = meshes();
    placed
        .iter()
        .enumerate()
        .zip(60..)
        .flat_map(|((i, affine), seed)| rays(&meshes[blas_of(i)], affine, n, seed))
        .collect()
}
