use std::path::Path;

use canted_fixtures::{self as fixtures, Mesh, SplitMix64};
use canted_tiles::{OpenOptions, TileWriter, TiledBvh, WriteOptions, Written};
use canted_trace::Ray;
use canted_wide::TriangleBvh;

/// A mesh with what it is for.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) mesh: Mesh,
}

/// Soups with ties across tiles, duplicates, equal centroids, and coordinates far from the origin.
pub(crate) fn cases() -> Vec<Case> {
    let case = |name, mesh| Case { name, mesh };
    let mut doubled = fixtures::soup(7, 150);
    // Every triangle three times: equal t on copies, which tiles of one triangle separate.
    doubled.triangles = doubled.triangles.repeat(3);
    vec![
        case("soup", fixtures::soup(1, 300)),
        case("duplicates", doubled),
        case("equal centroids", fixtures::equal_centroids(64)),
        case("closed", fixtures::icosphere(3)),
        case("edges across tiles", fixtures::grid(1, [12, 12])),
        case("far", fixtures::scaffold_of(1, true, 2).placed(|[x, y, z]| [x + 3e5, y - 2e6, z + 1e4])),
        case("oriented", fixtures::scaffold_of(1, true, 2)),
        case("one", fixtures::soup(3, 1)),
        case("none", Mesh::default()),
    ]
}

pub(crate) fn corners(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

/// Writes a mesh as about `n_tiles` tiles.
pub(crate) fn write(folder: &Path, mesh: &Mesh, n_tiles: usize) -> Written {
    let corners = corners(mesh);
    let options = WriteOptions { tile_triangles: corners.len().div_ceil(n_tiles).max(1), ..WriteOptions::default() };
    let mut writer = TileWriter::create(folder, options).unwrap();
    // In parts, as from a file.
    corners.chunks(37).for_each(|part| writer.push(part).unwrap());
    writer.finish(&mut |_| ()).unwrap()
}

pub(crate) fn open(folder: &Path, memory: u64) -> TiledBvh {
    TiledBvh::open(folder, OpenOptions { memory, ..OpenOptions::default() }).unwrap()
}

pub(crate) fn whole(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

/// Rays between points around the mesh, rays at vertices and centroids, grazing rays, and rays of any kind that never hit.
pub(crate) fn rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    let bvh = whole(mesh);
    let (aabb, mut rng) = (bvh.aabb(), SplitMix64::new(11));
    let (center, extent) =
        if mesh.triangles.is_empty() { ([0.0; 3], [1.0; 3]) } else { (aabb.center(), aabb.extent()) };
    let mut point = |scale: f64| -> [f32; 3] {
        std::array::from_fn(|k| (center[k] + (rng.unit() - 0.5) * scale * extent[k].max(1e-3)) as f32)
    };
    let between = |a: [f32; 3], b: [f32; 3]| Ray::new(a, std::array::from_fn::<f32, 3, _>(|k| b[k] - a[k]));
    let mut rays: Vec<Ray> = (0..n).map(|_| between(point(3.0), point(1.0))).collect();
    for triangle in corners(mesh).iter().take(n / 4) {
        let [a, b, c] = *triangle;
        let from = point(3.0);
        rays.extend([between(from, a), between(from, b).between(0.0, 1.0), between(from, c).between(1.0, 2.0)]);
        rays.push(between(from, std::array::from_fn(|k| (a[k] + b[k]) / 2.0)));
        rays.push(Ray::new([a[0], a[1], a[2] - 10.0], [0.0, 0.0, 1e-20]));
        rays.push(Ray::new([b[0], b[1], b[2] + 10.0], [-0.0, 0.0, -1e20]));
    }
    if !mesh.triangles.is_empty() {
        for class in fixtures::Grazing::ALL {
            let grazing = fixtures::grazing(mesh, class, 20, 3).into_iter();
            rays.extend(grazing.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }));
        }
    }
    rays.push(Ray::new([f32::NAN; 3], [1.0; 3]));
    rays.push(Ray::new([0.0; 3], [0.0; 3]));
    rays
}

/// Points around the mesh, on vertices, and points that are not finite.
pub(crate) fn points(mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut points: Vec<[f32; 3]> = rays(mesh, 200).iter().map(|ray| ray.origin).collect();
    points.extend(
        corners(mesh)
            .iter()
            .take(100)
            .map(|[a, b, c]| std::array::from_fn::<f32, 3, _>(|k| (a[k] + b[k] + c[k]) / 3.0)),
    );
    points.extend(mesh.positions.iter().take(50));
    points.extend([[f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0]]);
    points
}
