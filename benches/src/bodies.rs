//! Bodies that touch, distances and casts: `canted-collide` and the distance queries of `WideBvh`, compared with parry3d by `--peers`.
//!
//! ```text
//! two meshes, a pose -> touching pairs, distance;  points -> nearest;  a sphere -> first contact
//! ```
//!
//! Both work on one thread, in turn. parry3d computes with `f32`, so its counts of pairs differ where triangles all but touch; ours are exact for the vertices as
//! they are mapped.

use std::fmt::Write;
use std::hint::black_box;

use anyhow::Result;
use canted_collide::{Pose, cast_sphere, distance, pairs};
use canted_fixtures::{Mesh, Rotation, SplitMix64, displaced_icosphere, grid, icosphere, scaffold, torus, truss};
use canted_trace::Ray;
use canted_wide::TriangleBvh;

use crate::options::Options;
use crate::timing::{median, time};

/// A mesh and its name.
struct Scene {
    name: &'static str,
    mesh: Mesh,
}

fn scenes() -> Vec<Scene> {
    let scene = |name, mesh| Scene { name, mesh };
    vec![
        scene("blob", displaced_icosphere(1, 5)),
        scene("torus", torus(160, 64)),
        scene("terrain", grid(1, [100, 100])),
        scene("scaffold", scaffold(1, true)),
        scene("truss", truss(1)),
    ]
}

/// Points in the bounds of a mesh.
fn points(mesh: &Mesh, n: usize) -> Vec<[f32; 3]> {
    let (mut rng, [min, max]) = (SplitMix64::new(3), mesh.bounds());
    (0..n).map(|_| std::array::from_fn(|k| min[k] + (max[k] - min[k]) * rng.unit() as f32)).collect()
}

/// Milliseconds of a contender in each round.
#[derive(Default)]
struct Times(Vec<f64>);

impl Times {
    fn add<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (result, seconds) = time(work);
        self.0.push(1e3 * seconds.cpu);
        result
    }

    fn median(&self) -> f64 {
        median(&self.0)
    }
}

/// One row of the table.
fn row(out: &mut String, query: &str, scene: &str, ours: &Times, peer: &Times, notes: &str) {
    let (own, other) = (ours.median(), peer.median());
    let peers = if peer.0.is_empty() { "| | ".to_owned() } else { format!("| {other:.2} | {:.2} ", own / other) };
    let _ = writeln!(out, "| {query} | {scene} | {own:.2} {peers}| {notes} |");
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let _ = writeln!(
        out,
        "\n## Bodies\n\nMilliseconds of one thread, medians of {} rounds after a warm-up, in turn with parry3d where it is built in. Pairs: all touching \
         triangles of a mesh and the same mesh, rotated off its axes and moved by a tenth of its size. Distance: by three sizes. Nearest: \
         20,000 points in the bounds, one by one, and as a slice along a grid of 96^3 / 64. Sphere: 5,000 spheres of a hundredth of the size, from outside \
         toward points in the bounds.\n\n| query | scene | ours | parry3d | ours / parry3d | |\n| --- | --- | --- | --- | --- | --- |",
        options.rounds
    );
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| -> Result<()> {
        for Scene { name, mesh } in scenes() {
            of_scene(out, name, &mesh, options)?;
        }
        contacts(out, options)
    })
}

/// Times of large meshes that touch more and more: they should follow the pairs, not the triangles.
fn contacts(out: &mut String, options: &Options) -> Result<()> {
    let mut all = vec![];
    for level in if options.is_quick { [4, 6] } else { [6, 8] } {
        let mesh = icosphere(level);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles)?;
        for depth in [1e-4, 1e-3, 1e-2, 1e-1] {
            let pose = Pose::translation([2.0 - depth, 0.0, 0.0]);
            let (mut times, mut found) = (Times::default(), vec![]);
            (0..=options.rounds).for_each(|_| times.add(|| pairs(&bvh, Pose::IDENTITY, &bvh, pose, &mut found)));
            all.push((mesh.triangles.len(), depth, found.len(), times.median()));
        }
    }
    let _ = writeln!(
        out,
        "\n### Contacts of large meshes\n\nA sphere and a copy of it that overlap by a part of the radius, one thread.\n\n| triangles of each | overlap | pairs | ms | µs a pair |\n\
         | --- | --- | --- | --- | --- |"
    );
    for (n, depth, n_pairs, ms) in all {
        let _ = writeln!(out, "| {n} | {depth} | {n_pairs} | {ms:.3} | {:.2} |", 1e3 * ms / n_pairs.max(1) as f64);
    }
    Ok(())
}

fn of_scene(out: &mut String, name: &str, mesh: &Mesh, options: &Options) -> Result<()> {
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles)?;
    let size = mesh.diagonal();
    let rotation = Rotation::off_axis();
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| rotation.apply(axis));
    let at = |by: f64| Pose { columns: [columns[0], columns[1], columns[2], [by, 0.7 * by, 0.4 * by]] };
    let (near, far) = (at(0.1 * size), at(3.0 * size));
    let peer = peer::Peer::new(mesh);
    let points = points(mesh, 20_000);
    let rays: Vec<Ray> = points[..5000]
        .iter()
        .map(|&to| {
            let from = [0, 1, 2].map(|k| to[k] + [1.5, 0.7, 2.0][k] * size as f32);
            Ray::new(from, std::array::from_fn(|k| to[k] - from[k]))
        })
        .collect();
    let radius = 0.01 * size;
    let row_of_grid = grid_points(mesh);
    let mut times: [[Times; 2]; 5] = Default::default();
    let (mut found, mut counts) = (vec![], [0; 2]);
    for round in 0..=options.rounds {
        let mut now: [[Times; 2]; 5] = Default::default();
        now[0][0].add(|| pairs(&bvh, Pose::IDENTITY, &bvh, near, &mut found));
        now[1][0].add(|| black_box(distance(&bvh, Pose::IDENTITY, &bvh, far, f64::INFINITY)));
        now[2][0].add(|| {
            points.iter().for_each(|&point| {
                black_box(bvh.nearest_point(point, f32::INFINITY));
            })
        });
        let mut nearest = vec![None; row_of_grid.len()];
        now[3][0].add(|| bvh.nearest_point_many(&row_of_grid, f32::INFINITY, &mut nearest));
        now[4][0].add(|| {
            rays.iter().for_each(|ray| {
                black_box(cast_sphere(&bvh, ray, radius));
            })
        });
        counts[0] = found.len();
        if let Some(peer) = &peer {
            counts[1] = now[0][1].add(|| peer.pairs(&near));
            now[1][1].add(|| black_box(peer.distance(&far)));
            now[2][1].add(|| points.iter().for_each(|&point| peer.nearest(point)));
            now[3][1].add(|| row_of_grid.iter().for_each(|&point| peer.nearest(point)));
            now[4][1].add(|| rays.iter().for_each(|ray| peer.cast_sphere(ray, radius as f32)));
        }
        if round > 0 {
            for (all, now) in times.iter_mut().flatten().zip(now.into_iter().flatten()) {
                all.0.extend(now.0);
            }
        }
    }
    let [n, of_peer] = counts;
    let n_triangles = mesh.triangles.len();
    let notes = match peer {
        Some(_) => format!("{n_triangles} triangles; {n} pairs, parry3d {of_peer}"),
        None => format!("{n_triangles} triangles; {n} pairs"),
    };
    for ((query, notes), [ours, peer]) in
        [("pairs", &*notes), ("distance", ""), ("nearest", ""), ("nearest, grid", ""), ("sphere", "")]
            .into_iter()
            .zip(&times)
    {
        row(out, query, name, ours, peer, notes);
    }
    Ok(())
}

/// Every 64th row of a grid of 96 points in each direction.
fn grid_points(mesh: &Mesh) -> Vec<[f32; 3]> {
    let [min, max] = mesh.bounds();
    let at = |k: usize, i: usize| min[k] + (max[k] - min[k]) * i as f32 / 95.0;
    (0..96 * 96)
        .step_by(64)
        .flat_map(|row| (0..96).map(move |i| [i, row % 96, row / 96]))
        .map(|[x, y, z]| [at(0, x), at(1, y), at(2, z)])
        .collect()
}

#[cfg(feature = "peers")]
mod peer {
    use canted_collide::Pose;
    use canted_fixtures::Mesh;
    use canted_trace::Ray;
    use parry3d::bounding_volume::BoundingVolume;
    use parry3d::math::{Isometry, Point, Vector};
    use parry3d::na::{Matrix3, Rotation3, Translation3, UnitQuaternion};
    use parry3d::query::{self, PointQuery, ShapeCastOptions};
    use parry3d::shape::{Ball, TriMesh};

    pub(super) struct Peer(TriMesh);

    /// A pose that rotates and translates.
    fn isometry(Pose { columns: [x, y, z, w] }: &Pose) -> Isometry<f32> {
        let entry = |j: usize, i: usize| [x, y, z][j][i] as f32;
        let matrix = Matrix3::from_fn(|i, j| entry(j, i));
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
        Isometry::from_parts(Translation3::new(w[0] as f32, w[1] as f32, w[2] as f32), rotation)
    }

    impl Peer {
        pub(super) fn new(mesh: &Mesh) -> Option<Self> {
            let points = mesh.positions.iter().map(|&[x, y, z]| Point::new(x, y, z)).collect();
            TriMesh::new(points, mesh.triangles.clone()).ok().map(Self)
        }

        /// Pairs of leaves by their boxes, then of triangles.
        pub(super) fn pairs(&self, pose: &Pose) -> usize {
            let (mesh, pose) = (&self.0, isometry(pose));
            let identity = Isometry::identity();
            mesh.bvh()
                .leaf_pairs(mesh.bvh(), |one, other| one.aabb().intersects(&other.aabb().transform_by(&pose)))
                .filter(|&(one, other)| {
                    query::intersection_test(&identity, &mesh.triangle(one), &pose, &mesh.triangle(other)) == Ok(true)
                })
                .count()
        }

        pub(super) fn distance(&self, pose: &Pose) -> f32 {
            query::distance(&Isometry::identity(), &self.0, &isometry(pose), &self.0).unwrap_or(f32::NAN)
        }

        pub(super) fn nearest(&self, [x, y, z]: [f32; 3]) {
            std::hint::black_box(self.0.project_local_point(&Point::new(x, y, z), false));
        }

        pub(super) fn cast_sphere(&self, ray: &Ray, radius: f32) {
            let [x, y, z] = ray.origin;
            let [u, v, w] = ray.direction;
            let (identity, rest) = (Isometry::identity(), Vector::zeros());
            let from = Isometry::translation(x, y, z);
            let options = ShapeCastOptions::default();
            let hit = query::cast_shapes(
                &from,
                &Vector::new(u, v, w),
                &Ball::new(radius),
                &identity,
                &rest,
                &self.0,
                options,
            );
            let _ = std::hint::black_box(hit);
        }
    }
}

/// Without peers.
#[cfg(not(feature = "peers"))]
mod peer {
    use canted_collide::Pose;
    use canted_fixtures::Mesh;
    use canted_trace::Ray;

    pub(super) enum Peer {}

    impl Peer {
        pub(super) fn new(_: &Mesh) -> Option<Self> {
            None
        }

        pub(super) fn pairs(&self, _: &Pose) -> usize {
            match *self {}
        }

        pub(super) fn distance(&self, _: &Pose) -> f32 {
            match *self {}
        }

        pub(super) fn nearest(&self, _: [f32; 3]) {
            match *self {}
        }

        pub(super) fn cast_sphere(&self, _: &Ray, _: f32) {
            match *self {}
        }
    }
}
