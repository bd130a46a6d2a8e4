//! Overlaps of solids: spheres are balls, or shells where asked; boxes are solid. The oracle computes in the frame of the region.

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Convex, Overlaps, Sphere};
use canted_wide::{DistanceShape, WideBvh};

/// The least and the greatest distance of points of a box from a point, by coordinates in its frame, which is orthonormal.
fn distances(obb: &Obb, point: [f32; 3]) -> [f64; 2] {
    let (mut least, mut greatest) = (0.0, 0.0);
    for k in 0..3 {
        let row = obb.frame[k].map(f64::from);
        let along: f64 = (0..3).map(|i| row[i] * (f64::from(point[i]) - f64::from(obb.center[i]))).sum();
        let half = f64::from(obb.half_extents[k]);
        least += (along.abs() - half).max(0.0).powi(2);
        greatest += (along.abs() + half).powi(2);
    }
    [least, greatest].map(f64::sqrt)
}

fn obbs(rng: &mut SplitMix64, n: usize) -> Vec<Obb> {
    // Rotations whose rows are orthonormal but for single precision.
    let rows = |a: f32| [[a.cos(), a.sin(), 0.0], [-a.sin(), a.cos(), 0.0], [0.0, 0.0, 1.0]];
    (0..n)
        .map(|i| Obb {
            center: rng.signed3().map(|x| 4.0 * x as f32),
            frame: if i % 3 == 0 { Obb::IDENTITY_FRAME } else { rows(i as f32) },
            half_extents: std::array::from_fn(|k| if i % 7 == k { 0.0 } else { 1.5 * rng.unit() as f32 }),
        })
        .collect()
}

fn spheres(rng: &mut SplitMix64, n: usize) -> Vec<Sphere> {
    (0..n)
        .map(|_| Sphere { center: rng.signed3().map(|x| 4.0 * x as f32), radius: 2.0 * (rng.unit() as f32).powi(2) })
        .collect()
}

fn numbers(n: usize, is_in: impl Fn(usize) -> bool) -> Vec<PrimId> {
    (0..n).filter(|&i| is_in(i)).map(|i| PrimId(u32::try_from(i).unwrap())).collect()
}

#[test]
fn spheres_are_balls_and_shells_where_asked() {
    let mut rng = SplitMix64::new(21);
    let spheres = spheres(&mut rng, 400);
    let bvh = WideBvh::over(spheres.clone()).unwrap();
    let (mut found, mut n) = (vec![], [0; 4]);
    for obb in obbs(&mut rng, 300) {
        let region = Convex::from_obb(&obb);
        // Frames in single precision, and corners: decided beyond this.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
        let ranges: Vec<[f64; 2]> = spheres.iter().map(|sphere| distances(&obb, sphere.center)).collect();
        let radius = |i: usize| f64::from(spheres[i].radius);
        let is_clear = |i: usize| !ranges[i].iter().any(|&distance| near(distance, radius(i)));
        let clear = |ids: &[PrimId]| ids.iter().copied().filter(|id| is_clear(id.index())).collect::<Vec<_>>();
        bvh.overlapping_obb(&obb, &mut found).unwrap();
        let balls = numbers(spheres.len(), |i| is_clear(i) && ranges[i][0] < radius(i));
        assert_eq!(clear(&found), balls, "{obb:?}");
        assert_eq!(bvh.count_overlapping(&region), found.len());
        bvh.overlapping_surfaces(&region, &mut found);
        let shells = numbers(spheres.len(), |i| is_clear(i) && ranges[i][0] < radius(i) && radius(i) < ranges[i][1]);
        assert_eq!(clear(&found), shells, "{obb:?}");
        // What would be answered for the bounds of the spheres, which must not be the answer.
        let boxes = spheres.iter().filter(|sphere| {
            let [min, max] = [-1.0, 1.0].map(|side| sphere.center.map(|x| x + side * sphere.radius));
            region.overlaps_aabb(&Aabb { min, max })
        });
        for (sum, more) in n.iter_mut().zip([balls.len(), shells.len(), boxes.count(), 1]) {
            *sum += more;
        }
    }
    let [n_balls, n_shells, n_boxes, _] = n;
    assert!(n_shells + 40 < n_balls && n_balls + 500 < n_boxes, "{n:?}");
}

/// By hand: a pyramid, and a region without volume.
#[test]
fn balls_and_other_regions() {
    let face = |s: f32, z: f32| [[-s, -s, z], [s, -s, z], [s, s, z], [-s, s, z]];
    let pyramid = Convex::from_frustum(face(0.0, 0.0), face(1.0, 1.0));
    let quad = Convex::from_frustum(face(1.0, 0.0), face(1.0, 0.0));
    let point = Convex::from_frustum([[1.0, 2.0, 2.0]; 4], [[1.0, 2.0, 2.0]; 4]);
    let empty = Convex::from_aabb(Aabb::EMPTY.min, Aabb::EMPTY.max);
    // The side of the pyramid is the plane x = z, so (2, 0, 0) is the root of 2 away from it, beside (1, 0, 1).
    let cases = [
        (&pyramid, [2.0, 0.0, 0.0], 1.414, false),
        (&pyramid, [2.0, 0.0, 0.0], 1.4145, true),
        (&pyramid, [0.0, 0.0, 0.75], 0.0, true),
        (&pyramid, [0.0, 0.0, -0.5], 0.5, true),
        (&pyramid, [0.0, 0.0, -0.5], 0.49, false),
        (&pyramid, [0.0, 0.0, 0.5], 90.0, true),
        (&quad, [0.0, 0.0, 0.25], 0.25, true),
        (&quad, [0.0, 0.0, 0.25], 0.24, false),
        (&quad, [2.0, 2.0, 0.0], 1.414, false),
        (&quad, [2.0, 2.0, 0.0], 1.415, true),
        (&point, [0.0, 0.0, 0.0], 3.0, true),
        (&point, [0.0, 0.0, 0.0], 2.999, false),
        (&empty, [0.0, 0.0, 0.0], 1e9, false),
    ];
    for (region, center, radius, expected) in cases {
        let sphere = Sphere { center, radius };
        assert_eq!(sphere.overlaps(region), expected, "{sphere:?}");
        let bvh = WideBvh::over(vec![sphere]).unwrap();
        assert_eq!(bvh.overlaps(region), expected, "{sphere:?}");
    }
}

/// Every solid contains what is inside of it.
#[test]
fn small_questions_inside_of_solids() {
    let mut found = vec![];
    let ball = WideBvh::over(vec![Sphere { center: [5.0, 0.0, 0.0], radius: 3.0 }]).unwrap();
    let cube = WideBvh::over(vec![Aabb { min: [2.0, -3.0, -3.0], max: [8.0, 3.0, 3.0] }]).unwrap();
    for x in [4.0, 5.0, 6.5] {
        ball.overlapping_sphere([x, 0.0, 0.0], 0.25, &mut found);
        assert_eq!(found.len(), 1);
        cube.overlapping_sphere([x, 0.0, 0.0], 0.25, &mut found);
        assert_eq!(found.len(), 1);
        let region = Convex::from_aabb([x, -0.1, -0.1], [x + 0.2, 0.1, 0.1]);
        assert!(ball.overlaps(&region) && cube.overlaps(&region));
        ball.overlapping_surfaces(&region, &mut found);
        assert!(found.is_empty());
        cube.overlapping_surfaces(&region, &mut found);
        assert!(found.is_empty());
    }
    let through = Convex::from_aabb([7.9, -0.1, -0.1], [9.0, 0.1, 0.1]);
    ball.overlapping_surfaces(&through, &mut found);
    assert_eq!(found.len(), 1);
    cube.overlapping_surfaces(&through, &mut found);
    assert_eq!(found.len(), 1);
    // A corner of the bounds of the ball is not in it.
    assert!(!ball.overlaps(&Convex::from_aabb([7.5, 2.5, 2.5], [8.0, 3.0, 3.0])));
    ball.overlapping_sphere([9.5, 0.0, 0.0], 1.5, &mut found);
    assert_eq!(found.len(), 1, "touching counts");
    ball.overlapping_sphere([9.5, 0.0, 0.0], 1.49, &mut found);
    assert!(found.is_empty());
}

#[test]
fn boxes_are_solid_and_far_ones_too() {
    let mut rng = SplitMix64::new(33);
    for (scale, offset) in [(1.0_f32, 0.0_f32), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e5)] {
        let boxes: Vec<Aabb> = (0..300)
            .map(|_| {
                let min: [f32; 3] = rng.signed3().map(|x| scale * (4.0 * x as f32) + offset);
                Aabb { min, max: min.map(|x| x + scale * rng.unit() as f32) }
            })
            .collect();
        let bvh = WideBvh::over(boxes.clone()).unwrap();
        let (mut found, mut n) = (vec![], 0);
        for _ in 0..100 {
            let center = rng.signed3().map(|x| scale * (4.0 * x as f32) + offset);
            let radius = scale * rng.unit() as f32;
            bvh.overlapping_sphere(center, radius, &mut found);
            let within = |i: usize| {
                let gap = |k: usize| {
                    let [x, min, max] = [center[k], boxes[i].min[k], boxes[i].max[k]].map(f64::from);
                    (min - x).max(x - max).max(0.0).powi(2)
                };
                (gap(0) + gap(1) + gap(2)).sqrt() <= f64::from(radius)
            };
            assert_eq!(found, numbers(boxes.len(), within));
            n += found.len();
        }
        assert!(n > 100);
    }
}

#[test]
fn inverted_boxes_are_errors_and_empty_ones_overlap_nothing() {
    let ball = WideBvh::over(vec![Sphere { center: [0.5; 3], radius: 3.0 }]).unwrap();
    let mut found = vec![PrimId(7)];
    let error = ball.overlapping_aabb([0.0, 1.0, 0.0], [1.0, 0.5, 1.0], &mut found).unwrap_err();
    assert_eq!((error.axis, error.min, error.max), (1, 1.0, 0.5));
    assert_eq!(
        error.to_string(),
        "a box from 1 to 0.5 in y is inverted; exchange both, or use Aabb::EMPTY for an empty box"
    );
    assert!(found.is_empty(), "nothing is found");
    assert_eq!(ball.overlapping_aabb(Aabb::EMPTY.min, Aabb::EMPTY.max, &mut found), Ok(()));
    assert!(found.is_empty());
    let obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0, 1.0, -0.5] };
    let error = ball.overlapping_obb(&obb, &mut found).unwrap_err();
    assert_eq!((error.axis, error.max), (2, -0.5));
    // A box of one point is none of these.
    assert_eq!(ball.overlapping_aabb([0.5; 3], [0.5; 3], &mut found), Ok(()));
    assert_eq!(found.len(), 1);
}
