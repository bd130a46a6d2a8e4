//! Distances, overlaps and containment of instances, compared with loops over all triangles in world space.

use std::sync::Arc;

use canted_fixtures::{Mesh, SplitMix64};
use canted_obb::Affine;
use canted_tlas::{Instance, NearestSurface, Tlas};
use canted_trace::{Convex, InstanceId, Overlaps, closest_to_zero};
use canted_wide::{Preset, TriangleBvh};

use crate::oracle::affine;

/// Rotations, shears, mirrors and scales, at moderate and great distances.
fn scene(rng: &mut SplitMix64, spread: f64) -> (Vec<Mesh>, Vec<Instance>) {
    let meshes = vec![canted_fixtures::soup(3, 40), canted_fixtures::icosphere(1)];
    let maps: [[[f64; 3]; 3]; 5] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]],
        [[2.0, 0.0, 0.0], [1.5, 0.5, 0.0], [0.0, 0.0, 1.0]],
        [[-1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.1]],
        [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]],
    ];
    let instances = (0..10).map(|i| {
        let [x, y, z] = maps[i % 5];
        Instance::new((i % 2) as u32, affine([x, y, z, rng.signed3().map(|x| x * spread)]))
    });
    (meshes, instances.collect())
}

fn tlas_of(meshes: &[Mesh], instances: &[Instance], preset: Preset) -> Tlas<Arc<TriangleBvh>> {
    let build = |mesh: &Mesh| Arc::new(TriangleBvh::build_with(&mesh.positions, &mesh.triangles, preset).unwrap());
    Tlas::new(meshes.iter().map(build).collect(), instances, Default::default()).unwrap()
}

/// A triangle of an instance in world space, relative to a point.
fn in_world(mesh: &Mesh, triangle: usize, map: &Affine, point: [f64; 3]) -> [[f64; 3]; 3] {
    let [x, y, z, w] = map.columns.map(|column| column.map(f64::from));
    mesh.triangles[triangle].map(|vertex| {
        let v = mesh.positions[vertex as usize].map(f64::from);
        std::array::from_fn(|k| x[k] * v[0] + y[k] * v[1] + z[k] * v[2] + (w[k] - point[k]))
    })
}

/// All triangles by distance, instance and number.
fn by_distance(meshes: &[Mesh], instances: &[Instance], point: [f64; 3]) -> Vec<(f64, u32, u32)> {
    let mut all = vec![];
    for (i, instance) in (0..).zip(instances) {
        let mesh = &meshes[instance.blas as usize];
        for t in 0..mesh.triangles.len() {
            let closest = closest_to_zero(&in_world(mesh, t, &instance.world_from_object, point));
            all.push((closest.distance_squared.sqrt(), i, t as u32));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    all
}

#[test]
fn nearest_triangles_are_those_of_a_loop() {
    let mut rng = SplitMix64::new(17);
    let mut n_instances = [0; 10];
    for spread in [0.0, 2.0, 1e4] {
        let (meshes, instances) = scene(&mut rng, spread);
        for preset in [Preset::Fast, Preset::Quality] {
            let tlas = tlas_of(&meshes, &instances, preset);
            let (mut nearest, mut within) = (vec![], vec![]);
            for i in 0..60 {
                let point = rng.signed3().map(|x| x * (spread + 2.0) * if i % 9 == 0 { 1e6 } else { 1.0 });
                let all = by_distance(&meshes, &instances, point);
                for k in [1, 3, 20] {
                    tlas.nearest_points(point, k, f64::INFINITY, &mut nearest);
                    let found: Vec<_> = nearest.iter().map(|n| (n.distance, n.instance.0, n.primitive.0)).collect();
                    assert_eq!(found, all[..k], "{spread}, {point:?}");
                }
                n_instances[all[0].1 as usize] += 1;
                let radius = all[7].0;
                tlas.nearest_points(point, usize::MAX, radius, &mut nearest);
                assert_eq!(nearest.len(), all.iter().filter(|found| found.0 <= radius).count());
                tlas.overlapping_sphere(point, radius, &mut within);
                let mut expected: Vec<_> = nearest.iter().map(|n| (n.instance, n.primitive)).collect();
                expected.sort_unstable();
                assert_eq!(within, expected);
                let NearestSurface { distance, position, .. } = nearest[0];
                let offset: [f64; 3] = std::array::from_fn(|k| position[k] - point[k]);
                let length = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
                let size = point.iter().fold(distance, |most, x| most.max(x.abs()));
                assert!((length - distance).abs() <= 1e-14 * size, "{length} {distance}");
            }
        }
    }
    assert!(n_instances.iter().filter(|&&n| n > 0).count() >= 8, "{n_instances:?}");
}

#[test]
fn points_without_an_answer() {
    let (meshes, instances) = scene(&mut SplitMix64::new(1), 1.0);
    let tlas = tlas_of(&meshes, &instances, Preset::Fast);
    for point in [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0]] {
        assert_eq!(tlas.nearest_point(point, f64::INFINITY), None);
        assert!(!tlas.contains(point));
    }
    for max_distance in [-1.0, f64::NAN] {
        assert_eq!(tlas.nearest_point([0.0; 3], max_distance), None);
    }
    let nothing = tlas_of(&meshes, &[], Preset::Fast);
    assert_eq!((nearest_of(&nothing), nothing.contains([0.0; 3])), (None, false));
    // So far away that object space would overflow.
    let small = tlas_of(&meshes, &[Instance::new(1, Affine::scale([1e-6; 3]))], Preset::Fast);
    assert!((small.nearest_point([0.0, 0.0, 3e38], f64::INFINITY).unwrap().distance - 3e38).abs() < 1e24);
}

fn nearest_of(tlas: &Tlas<Arc<TriangleBvh>>) -> Option<NearestSurface> {
    tlas.nearest_point([0.0; 3], f64::INFINITY)
}

#[test]
fn overlaps_are_those_of_regions_in_object_space() {
    let mut rng = SplitMix64::new(23);
    let (meshes, instances) = scene(&mut rng, 1.0);
    let tlas = tlas_of(&meshes, &instances, Preset::Balanced);
    let (mut found, mut counts) = (vec![], [0; 2]);
    for _ in 0..200 {
        let center = rng.signed3().map(|x| (1.5 * x) as f32);
        let size = 0.4 * rng.unit() as f32;
        let region = Convex::from_aabb(center.map(|x| x - size), center.map(|x| x + size));
        tlas.overlapping(&region, &mut found);
        for (i, instance) in (0..).zip(&instances) {
            let mesh = &meshes[instance.blas as usize];
            for t in 0..mesh.triangles.len() {
                // Rounded to f32, which decides but for triangles that all but touch.
                let vertices = in_world(mesh, t, &instance.world_from_object, [0.0; 3]).map(|v| v.map(|x| x as f32));
                let grown = |by: f32| Convex::from_aabb(center.map(|x| x - size - by), center.map(|x| x + size + by));
                let is_found = found.iter().any(|&(instance, primitive)| (instance.0, primitive.0) == (i, t as u32));
                let [inner, outer] = [-1e-5, 1e-5].map(|by| grown(by).overlaps_triangle(&vertices));
                assert!(is_found || !inner || size < 1e-5, "{center:?} {size}: {i} {t} is missing");
                assert!(!is_found || outer, "{center:?} {size}: {i} {t} is found");
                counts[usize::from(is_found)] += 1;
            }
        }
        assert!(found.is_sorted());
        assert_eq!(tlas.first_overlapping(&region), found.first().copied());
        assert_eq!((tlas.overlaps(&region), tlas.count_overlapping(&region)), (!found.is_empty(), found.len()));
        let mut near = vec![];
        tlas.each_instance_in(&region.bounds(), |instance| {
            near.push(instance);
            std::ops::ControlFlow::Continue(())
        });
        near.sort_unstable();
        let meets = |id: &InstanceId, by: f32| {
            let (own, other) = (tlas.instance_bounds(*id).unwrap(), region.bounds());
            (0..3).all(|k| own.min[k] <= other.max[k] + by && other.min[k] <= own.max[k] + by)
        };
        assert!((0..10).map(InstanceId).filter(|id| meets(id, 0.0)).all(|id| near.contains(&id)));
        assert!(near.iter().all(|id| meets(id, 1e-4)), "no instance that is far away");
    }
    assert!(counts[1] > 500, "{counts:?}");
}

#[test]
fn a_point_is_inside_of_any_instance() {
    let meshes = [canted_fixtures::icosphere(3)];
    let at = |x: f32, scale: f32| {
        Instance::new(0, Affine::scale([scale, scale, -scale]).then(&Affine::translation([x, 0.0, 0.0])))
    };
    // The second overlaps the first; all are mirrored.
    let tlas = tlas_of(&meshes, &[at(0.0, 1.0), at(1.0, 1.0), at(1000.0, 100.0)], Preset::Fast);
    for (x, expected) in
        [(-1.1, false), (-0.9, true), (0.5, true), (1.9, true), (2.1, false), (905.0, true), (1101.0, false)]
    {
        assert_eq!(tlas.contains([x, 0.0, 0.0]), expected, "{x}");
        // Only instances whose box has the point are asked.
        assert_eq!(tlas.contains_with([x, 0.0, 0.0], |_, _, _| true), expected, "{x}");
    }
}

/// Beside a triangle that is much larger than the steps, roundings are greater than those of the points: nothing is lost.
#[test]
fn slices_of_points_beside_a_wall() {
    let wall = Mesh {
        positions: vec![[1068.0, 8814.0, -9348.0], [-2058.0, -3954.0, 4983.0], [16370.0, -8537.0, 352.0]],
        triangles: vec![[0, 1, 2]],
    };
    let tlas = tlas_of(&[wall], &[Instance::new(0, Affine::IDENTITY)], Preset::Fast);
    let steps = [0.5, 1.0, -0.25, -2.0, 4.0];
    let points: Vec<[f64; 3]> =
        (0..1000).map(|i| [1.0, 2.0, 2.0].map(|n| n * steps[i % 5] * (1.0 + 0.37 * i as f64))).collect();
    let mut nearest = vec![None; points.len()];
    tlas.nearest_point_many(&points, f64::INFINITY, &mut nearest);
    for (&point, nearest) in points.iter().zip(&nearest) {
        assert!(nearest.is_some() && *nearest == tlas.nearest_point(point, f64::INFINITY), "{point:?}");
    }
}

/// Answers of slices are those of single points, and signs those of containment.
#[test]
fn slices_of_points() {
    let mut rng = SplitMix64::new(40);
    let (meshes, instances) = scene(&mut rng, 1.5);
    let tlas = tlas_of(&meshes, &instances, Preset::Balanced);
    // A coherent row, then points anywhere, some of them bad.
    let mut points: Vec<[f64; 3]> = (0..200).map(|i| [0.02 * f64::from(i) - 2.0, 0.3, 0.1]).collect();
    points.extend((0..200).map(|_| rng.signed3().map(|x| 3.0 * x)));
    points[70] = [f64::NAN, 0.0, 0.0];
    points[90] = [0.0, f64::INFINITY, 0.0];
    for max_distance in [f64::INFINITY, 0.3] {
        let (mut nearest, mut parallel) = (vec![None; points.len()], vec![None; points.len()]);
        tlas.nearest_point_many(&points, max_distance, &mut nearest);
        tlas.par_nearest_point_many(&points, max_distance, &mut parallel);
        let singles: Vec<_> = points.iter().map(|&point| tlas.nearest_point(point, max_distance)).collect();
        assert_eq!((&nearest, &parallel), (&singles, &singles));
        assert!(nearest.iter().flatten().count() > 50);
    }
    let (mut inside, mut parallel) = (vec![false; points.len()], vec![false; points.len()]);
    tlas.contains_many(&points, &mut inside);
    tlas.par_contains_many(&points, &mut parallel);
    assert_eq!(inside, points.iter().map(|&point| tlas.contains(point)).collect::<Vec<_>>());
    assert!(inside == parallel && inside.contains(&true));
    let (mut distances, mut parallel) = (vec![0.0; points.len()], vec![0.0; points.len()]);
    tlas.signed_distance_many(&points, &mut distances);
    tlas.par_signed_distance_many(&points, &mut parallel);
    for (i, &point) in points.iter().enumerate() {
        assert!(
            distances[i].to_bits() == parallel[i].to_bits()
                && distances[i].to_bits() == tlas.signed_distance(point).to_bits()
        );
        if let Some(nearest) = tlas.nearest_point(point, f64::INFINITY) {
            assert_eq!(
                (distances[i].abs(), distances[i] < 0.0),
                (nearest.distance, inside[i] && nearest.distance > 0.0)
            );
        }
    }
    assert!(distances[70].is_nan() && distances[90] == f64::INFINITY);
}

/// Instances of a closed mesh that overlap wind twice; mirrored ones count negatively.
#[test]
fn winding_numbers_add_up() {
    let meshes = [canted_fixtures::icosphere(2)];
    let at = |x: f32, scale: [f32; 3]| Instance::new(0, Affine::scale(scale).then(&Affine::translation([x, 0.0, 0.0])));
    let instances = [at(0.0, [1.0; 3]), at(1.0, [1.0, 2.0, 0.5]), at(5.0, [-1.0, 1.0, 1.0]), at(0.0, [0.0; 3])];
    let tlas = tlas_of(&meshes, &instances, Preset::Balanced);
    let winding = tlas.blas()[0].winding_numbers();
    for (x, expected) in [(-0.5, 1.0), (0.5, 2.0), (1.5, 1.0), (3.0, 0.0), (5.0, -1.0)] {
        let number = tlas.winding_number_with([x, 0.05, 0.02], |_, _, point| winding.number(point, 1e-9));
        assert!((number - expected).abs() < 1e-7, "{x}: {number}, not {expected}");
    }
    assert!(tlas.winding_number_with([f64::NAN, 0.0, 0.0], |_, _, _| 1.0).is_nan());
    assert_eq!(tlas.instance_bounds(InstanceId(3)), None, "a scale by zero hides");
}
