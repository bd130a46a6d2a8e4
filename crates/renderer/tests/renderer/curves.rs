//! Curves beside triangles: surfaces of tubes, and pictures of them.

use canted_film::Pixel;
use canted_obb::Affine;
use canted_renderer::{BvhKind, Cone, Integrator, Levels, PrepareError, SceneBvh, SceneBvhConfig, Settings, Surfaces};
use canted_scene::{CurveSegments, CurveShape, Curves, Mesh, MeshClose, Scene};
use canted_trace::{Intersect as _, Ray, position_at};

use super::common::{
    Vector, camera, cuboid, dot, film_of, floor, gray, mesh, place, prepared, rays_from_all_around, scene, settings,
    sub, under, unit,
};

/// A mesh of curves.
fn curves(positions: Vec<[f32; 3]>, radii: Vec<f32>, segments: CurveSegments) -> Mesh {
    Mesh { curves: Some(Curves { radii, segments, shape: CurveShape::Tube }), ..mesh(positions, vec![], 0) }
}

/// A cone with spherical ends, a ball, and an arch.
fn shapes() -> [Mesh; 3] {
    let ends = vec![[-1.0, -0.2, 0.0], [1.0, 0.3, 0.1]];
    let arch = vec![[-1.0, 0.0, 0.0], [-0.5, 1.0, 0.2], [0.5, 1.0, -0.2], [1.0, 0.0, 0.0]];
    [
        curves(ends.clone(), vec![0.5, 0.2], CurveSegments::Linear(vec![[0, 1]])),
        curves(ends, vec![0.8, 0.2], CurveSegments::Linear(vec![[0, 0]])),
        curves(arch, vec![0.3, 0.25, 0.2, 0.3], CurveSegments::Cubic(vec![[0, 1, 2, 3]])),
    ]
}

/// Whatever the transform, normals are perpendicular to the surface, and points lie on it: neighboring rays see the plane of the normal.
#[test]
fn normals_are_those_of_the_surface() {
    let moved = Affine { columns: [[0.8, 0.1, 0.0], [0.0, 1.1, 0.0], [0.0, 0.0, 1.0], [0.1, 0.2, 0.0]] };
    let sheared = Affine { columns: [[1.0, 0.0, 0.0], [0.7, 1.0, 0.2], [0.0, 0.0, 2.0], [0.0; 3]] };
    let mirrored = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
    let mut n_hits = 0;
    for shape in shapes() {
        for map in [Affine::IDENTITY, moved, sheared, mirrored] {
            let mut stage = scene(vec![shape.clone()], vec![gray(0.5)]);
            stage.instances = vec![place(0, map)];
            let bvh = prepared(&stage, Levels::Auto);
            let surfaces = Surfaces::new(&stage);
            for ray in rays_from_all_around(300) {
                let Some(hit) = bvh.closest_hit(&ray) else { continue };
                let surface = surfaces.at_ray(&hit, &ray, Cone::ZERO);
                let direction = unit(ray.direction.map(f64::from));
                let along_ray = sub(surface.position, ray.origin.map(f64::from));
                let off = dot(along_ray, along_ray) - dot(along_ray, direction).powi(2);
                assert!(off.abs() < 1e-10, "{off:e} beside the ray");
                assert!(dot(surface.normal, direction) <= 1e-3);
                // A ray beside it, unless it grazes.
                let cosine = -dot(surface.normal, direction);
                if cosine < 0.3 {
                    continue;
                }
                const STEP: f32 = 1e-3;
                for axis in 0..3 {
                    let mut beside = ray;
                    beside.origin[axis] += STEP;
                    let Some(other) = bvh.closest_hit(&beside) else { continue };
                    let there = surfaces.at_ray(&other, &beside, Cone::ZERO);
                    let edge = sub(there.position, surface.position);
                    // Another part of the arch.
                    if dot(edge, edge) > 1e-4 {
                        continue;
                    }
                    let height = dot(edge, surface.normal).abs();
                    // Twice the step squared over the least radius of curvature.
                    assert!(height < 1e-4, "{height:e} above the plane: {ray:?}");
                    n_hits += 1;
                }
            }
        }
    }
    assert!(n_hits > 500, "{n_hits}");
}

fn furnace(stage: &Scene, integrator: Integrator, bounces: u32) -> Vec<Vector> {
    let stage = under([1.0; 3], stage.clone());
    let settings = Settings { integrator, ..settings(12, 12, 6, bounces) };
    let bvh = prepared(&stage, Levels::Auto);
    let film = film_of(&stage, &bvh, &camera([2.0, 3.0, 4.0], [-0.5, -0.05, 0.0], 3.0), &settings);
    assert_eq!(film.n_dropped(), 0);
    film.pixels().iter().map(Pixel::mean).collect()
}

/// From a convex curve every bounce escapes.
#[test]
fn convex_curves_in_a_white_furnace_show_their_albedo() {
    for shape in &shapes()[..2] {
        for integrator in [Integrator::Hybrid, Integrator::Path] {
            let stage = scene(vec![shape.clone()], vec![gray(0.625)]);
            for pixel in furnace(&stage, integrator, 2) {
                assert!(pixel.iter().all(|x| (x - 0.625).abs() < 1e-5), "{pixel:?}");
            }
        }
    }
}

/// An arch of albedo 1 scatters between its parts, and nothing is lost or gained.
#[test]
fn white_curves_vanish_in_a_white_furnace() {
    let stage = scene(vec![shapes()[2].clone()], vec![gray(1.0)]);
    for pixel in furnace(&stage, Integrator::Path, 60) {
        assert!(pixel.iter().all(|x| (x - 1.0).abs() < 1e-4), "{pixel:?}");
    }
}

/// Points have colors, mixed along the curve.
#[test]
fn colors_of_points_are_mixed() {
    let mut shape = curves(vec![[0.0; 3], [4.0, 0.0, 0.0]], vec![0.5; 2], CurveSegments::Linear(vec![[0, 1]]));
    shape.colors = Some(vec![[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]);
    let stage = scene(vec![shape], vec![gray(1.0)]);
    let ray = Ray::new([1.0, 0.0, 5.0], [0.0, 0.0, -1.0]);
    let hit = prepared(&stage, Levels::Auto).closest_hit(&ray).unwrap();
    let surface = Surfaces::new(&stage).at_ray(&hit, &ray, Cone::ZERO);
    assert_eq!((surface.bsdf.base_color, surface.normal), ([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]));
    assert!((surface.position[2] - 0.5).abs() < 1e-12 && surface.is_front);
    assert_eq!(surface.along, Some([4.0, 0.0, 0.0]));
}

/// A thick curve as a box would be: in front of a floor, and between it and the light.
#[test]
fn curves_and_triangles_are_under_one_top() {
    let tube = curves(vec![[-3.0, 1.0, 0.0], [3.0, 1.0, 0.0]], vec![0.5; 2], CurveSegments::Linear(vec![[0, 1]]));
    let stage = scene(vec![floor(10.0, 0.0, 0), tube, cuboid([4.0, 0.0, -1.0], [5.0, 1.0, 1.0], 0)], vec![gray(0.5)]);
    let bvh = prepared(&stage, Levels::One);
    let hit = |x: f32| {
        let ray = Ray::new([x, 5.0, 0.0], [0.0, -1.0, 0.0]);
        bvh.closest_hit(&ray).map(|hit| (hit.instance.0, hit.t))
    };
    assert_eq!([hit(0.0), hit(4.5), hit(3.75)], [Some((1, 3.5)), Some((2, 4.0)), Some((0, 5.0))]);
    assert_eq!(stage.bounds_world().max, [10.0, 1.5, 10.0]);
    let config = SceneBvhConfig { kind: BvhKind::KdTree, ..SceneBvhConfig::default() };
    assert_eq!(SceneBvh::build(&stage, &config).err(), Some(PrepareError::Curves));
}

/// The same mesh, with points and radii at a time between those of the mesh and those at shutter close.
fn at_time(mesh: &Mesh, time: f32) -> Mesh {
    let mut now = mesh.clone();
    let close = now.close.take().expect("it moves");
    let curves = now.curves.as_mut().expect("curves");
    for (point, close) in now.positions.iter_mut().zip(&close.positions) {
        *point = position_at(point, close, time);
    }
    for (radius, close) in curves.radii.iter_mut().zip(close.radii.as_ref().expect("radii")) {
        [*radius, ..] = position_at(&[*radius; 3], &[*close; 3], time);
    }
    now
}

/// At each time, hits and surfaces are those of curves that do not move: tubes, ribbons and patches, below an instance that is not the identity.
#[test]
fn moving_curves_are_those_of_the_time_of_a_ray() {
    let arch = vec![[-1.0, 0.0, 0.0], [-0.5, 1.0, 0.2], [0.5, 1.0, -0.2], [1.0, 0.0, 0.0]];
    let lifted =
        |points: &[[f32; 3]]| points.iter().map(|&[x, y, z]| [x * 0.8, y + 0.9 * x, z + 0.7]).collect::<Vec<_>>();
    let sheet: Vec<[f32; 3]> =
        (0..16).map(|k| [(k / 4) as f32 - 1.5, (k % 4) as f32 - 1.5, 0.3 * (k % 3) as f32]).collect();
    let moving = |positions: Vec<[f32; 3]>, segments: CurveSegments, shape: CurveShape| {
        let radii: Vec<f32> = (0..positions.len()).map(|i| 0.2 + 0.05 * i as f32).collect();
        let close = MeshClose {
            positions: lifted(&positions),
            radii: Some(radii.iter().map(|radius| 1.5 * radius).collect()),
            ..MeshClose::default()
        };
        let tubes = curves(positions, radii, segments);
        Mesh { curves: tubes.curves.map(|curves| Curves { shape, ..curves }), close: Some(close), ..tubes }
    };
    let straight = || CurveSegments::Linear(vec![[0, 1], [1, 2], [2, 3]]);
    let cubic = || CurveSegments::Cubic(vec![[0, 1, 2, 3]]);
    let patch = || CurveSegments::Patches(vec![std::array::from_fn(|k| k as u32)]);
    let shapes = [
        moving(arch.clone(), straight(), CurveShape::Tube),
        moving(arch.clone(), cubic(), CurveShape::Tube),
        moving(arch.clone(), straight(), CurveShape::Ribbon),
        moving(arch, cubic(), CurveShape::Ribbon),
        moving(sheet, patch(), CurveShape::Tube),
    ];
    let map = Affine { columns: [[0.8, 0.1, 0.0], [0.0, 1.1, 0.0], [0.0, 0.0, 1.0], [0.1, 0.2, 0.0]] };
    for shape in shapes {
        let placed = |mesh: Mesh| {
            let mut stage = scene(vec![mesh], vec![gray(0.5)]);
            stage.instances = vec![place(0, map)];
            stage
        };
        let stage = placed(shape.clone());
        let (bvh, surfaces) = (prepared(&stage, Levels::Auto), Surfaces::new(&stage));
        let (mut n_hits, mut n_other) = (0, 0);
        for time in [0.0, 0.3, 1.0] {
            let still = placed(at_time(&shape, time));
            let (still_bvh, still_surfaces) = (prepared(&still, Levels::Auto), Surfaces::new(&still));
            for ray in rays_from_all_around(300).map(|ray| ray.at_time(time)) {
                let hit = bvh.closest_hit(&ray);
                assert_eq!(hit, still_bvh.closest_hit(&ray), "{time} {ray:?}");
                n_other += usize::from(bvh.closest_hit(&ray.at_time(time + 0.4)) != hit);
                let Some(hit) = hit else { continue };
                n_hits += 1;
                let [a, b] = [&surfaces, &still_surfaces].map(|all| all.at_ray(&hit, &ray, Cone::ZERO));
                assert_eq!((a.position, a.normal, a.along), (b.position, b.normal, b.along));
                assert!(a.offset >= b.offset);
            }
        }
        assert!(n_hits > 100 && n_other > 50, "{n_hits} hits, {n_other} others at another time");
        let bounds = stage.bounds_world();
        for time in [0.0, 1.0] {
            let at = placed(at_time(&shape, time)).bounds_world();
            assert!((0..3).all(|k| bounds.min[k] <= at.min[k] && at.max[k] <= bounds.max[k]), "{time}");
        }
    }
}
