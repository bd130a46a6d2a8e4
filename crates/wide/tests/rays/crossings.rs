//! Crossings: one for each surface, also through edges and vertices.

use canted_fixtures::{Mesh, SplitMix64};
use canted_obb::PrimId;
use canted_trace::{Crossings, Hit, HitLists, InstanceId, Intersect, Ray, Side, Watertight, alternate_sides};
use canted_wide::{Preset, TriangleBvh};

use crate::common::{brute, build, paths};

fn crossings(bvh: &TriangleBvh, ray: &Ray) -> Vec<Hit> {
    let mut hits = vec![];
    bvh.crossings(ray, &mut hits);
    hits
}

/// Crossings inward minus crossings outward.
fn balance(hits: &[Hit]) -> i32 {
    hits.iter().map(|hit| if hit.side == Side::Front { 1 } else { -1 }).sum()
}

/// Rays that pass exactly through vertices or points of edges of `mesh`.
///
/// Vertices must lie on multiples of 2^-10 below 8: origin, difference and shear factors are then exact.
fn exact_rays(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    let steps = [-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0];
    (0..n)
        .map(|_| {
            let triangle = mesh.triangles[rng.below(mesh.triangles.len())].map(|v| mesh.positions[v as usize]);
            let (a, b) = (triangle[rng.below(3)], triangle[rng.below(3)]);
            let target: [f32; 3] = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
            let mut direction: [f32; 3] = std::array::from_fn(|_| steps[rng.below(7)]);
            direction[rng.below(3)] = if rng.below(2) == 0 { 1.0 } else { -1.0 };
            Ray::new(std::array::from_fn(|k| target[k] - 32.0 * direction[k]), direction)
        })
        .collect()
}

/// The mesh with its vertices moved to a grid, so that sums and differences are exact.
fn on_grid(mut mesh: Mesh) -> Mesh {
    for x in mesh.positions.iter_mut().flatten() {
        *x = (*x * 64.0).round() / 64.0;
    }
    mesh
}

fn closed() -> [(&'static str, Mesh); 4] {
    [
        ("icosphere", on_grid(canted_fixtures::icosphere(2))),
        ("bumps", on_grid(canted_fixtures::displaced_icosphere(1, 3))),
        ("torus", on_grid(canted_fixtures::torus(24, 12))),
        ("box", canted_fixtures::thin_box(0.5)),
    ]
}

#[test]
fn closed_meshes_are_left_as_often_as_entered() {
    for (name, mesh) in closed() {
        assert_eq!(mesh.open_edge(), None, "{name} is closed");
        let bvh = build(&mesh, Preset::Balanced);
        let (mut through_edges, mut odd) = (0, 0);
        for ray in exact_rays(&mesh, 4000, 3) {
            let hits = crossings(&bvh, &ray);
            assert_eq!(balance(&hits), 0, "{name} {ray:?} {hits:?}");
            let all = brute::<Watertight>(&mesh, &ray);
            through_edges += usize::from(all.len() > hits.len());
            odd += usize::from(balance(&all) != 0);
            // Each crossing is a hit, and none twice.
            assert!(hits.iter().all(|hit| all.contains(hit)), "{name} {ray:?}");
            assert!(hits.windows(2).all(|pair| pair[0].t <= pair[1].t), "{name} {ray:?}");
        }
        // The check would fail for all hits: these rays pass through edges and vertices.
        assert!(through_edges > 1000 && odd > 100, "{name}: {through_edges}, {odd}");
    }
}

/// A ray that touches an edge of the outline enters and leaves at one `t`.
#[test]
fn where_t_is_equal_ways_in_and_out_take_turns() {
    // (rays, rays with two crossings of one `t`)
    let mut counts = [0; 2];
    for (name, mesh) in closed().into_iter().chain([("sphere", canted_fixtures::icosphere(3))]) {
        for bvh in [Preset::Fast, Preset::Quality].map(|preset| build(&mesh, preset)) {
            let mut rays = exact_rays(&mesh, 3000, 8);
            // Across an edge, so that it may be a part of the outline.
            for (i, ray) in rays.iter_mut().enumerate() {
                let [a, b, c] = mesh.triangles[i % mesh.triangles.len()].map(|v| mesh.positions[v as usize]);
                let middle: [f32; 3] = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
                let direction: [f32; 3] =
                    std::array::from_fn(|k| if i % 2 == 0 { c[k] - middle[k] } else { ray.direction[k] });
                *ray = Ray::new(std::array::from_fn(|k| middle[k] - 8.0 * direction[k]), direction);
            }
            let mut lists = HitLists::new();
            bvh.crossings_listed(&rays, &mut lists);
            for (ray, hits) in rays.iter().zip(lists.of_rays()) {
                assert_eq!(hits, crossings(&bvh, ray), "{name} {ray:?}");
                let ties: Vec<usize> = (1..hits.len()).filter(|&i| hits[i - 1].t == hits[i].t).collect();
                counts[0] += 1;
                counts[1] += usize::from(!ties.is_empty());
                let (starts_inside, is_on) = (bvh.contains(ray.origin), bvh.signed_distance(ray.origin) == 0.0);
                for i in ties.into_iter().filter(|_| !is_on) {
                    // An even number of crossings before: as at the start.
                    let is_first_in = hits[i - 1].side == Side::Front;
                    assert_eq!(is_first_in, (i % 2 == 1) != starts_inside, "{name} {ray:?} {hits:?}");
                    assert_ne!(hits[i - 1].side, hits[i].side, "{name} {ray:?} {hits:?}");
                }
            }
        }
    }
    assert!(counts[1] > 20, "{counts:?}");
    // From inside, the first crossing is a way out.
    let hit =
        |t: f32, side: Side, id: u32| Hit { t, u: 0.0, v: 0.0, primitive: PrimId(id), instance: InstanceId(0), side };
    let (front, back) = (Side::Front, Side::Back);
    for (given, expected) in [
        (vec![(1.0, back, 0), (1.0, front, 1)], [1, 0].as_slice()),
        (vec![(1.0, back, 0), (1.0, front, 1), (2.0, back, 2)], &[0, 1, 2]),
        (vec![(1.0, front, 0), (2.0, front, 1), (2.0, back, 2), (3.0, back, 3)], &[0, 2, 1, 3]),
        (vec![(1.0, front, 0), (1.0, front, 1), (1.0, back, 2), (1.0, back, 3)], &[0, 2, 1, 3]),
        (vec![(1.0, front, 0), (1.0, front, 1)], &[0, 1]),
    ] {
        let mut hits: Vec<Hit> = given.iter().map(|&(t, side, id)| hit(t, side, id)).collect();
        alternate_sides(&mut hits);
        assert_eq!(hits.iter().map(|hit| hit.primitive.0).collect::<Vec<_>>(), expected, "{given:?}");
    }
}

#[test]
fn from_inside_a_convex_mesh_is_crossed_once() {
    let mesh = on_grid(canted_fixtures::icosphere(2));
    for path in paths() {
        let bvh = build(&mesh, Preset::Quality).with_path(path);
        for vertex in &mesh.positions {
            // From the center through each vertex, and from far outside through two vertices at once.
            let hits = crossings(&bvh, &Ray::new([0.0; 3], *vertex));
            assert_eq!((hits.len(), hits[0].t, hits[0].side), (1, 1.0, Side::Back), "{vertex:?}");
            let hits = crossings(&bvh, &Ray::new(vertex.map(|x| 3.0 * x), vertex.map(|x| -x)));
            assert_eq!((hits.len(), hits[0].t), (2, 2.0), "{vertex:?}");
            assert_eq!([hits[0].side, hits[1].side], [Side::Front, Side::Back]);
        }
    }
}

#[test]
fn crossings_of_a_folded_mesh_are_those_of_a_slightly_moved_ray() {
    // Rounding an icosphere this coarsely folds and flattens it; it stays closed.
    let mut mesh = canted_fixtures::displaced_icosphere(5, 3);
    for x in mesh.positions.iter_mut().flatten() {
        *x = (*x * 4.0).round();
    }
    let bvh = build(&mesh, Preset::Balanced);
    let (mut touched, mut crossed) = (0, 0);
    for x in -5i8..=5 {
        for y in -5i8..=5 {
            let (x, y) = (f32::from(x), f32::from(y));
            for down in [1.0, -1.0] {
                let at = |x: f32, y: f32| Ray::new([x, y, -16.0 * down], [0.0, 0.0, down]);
                let hits = crossings(&bvh, &at(x, y));
                let moved = brute::<Watertight>(&mesh, &at(x + 2f32.powi(-9), y + 2f32.powi(-18)));
                // Positions differ by less than edges do, and primitives at edges.
                let sides = |hits: &[Hit]| hits.iter().map(|hit| hit.side == Side::Front).collect::<Vec<_>>();
                let count = |hits: &[Hit], is_front| sides(hits).into_iter().filter(|&f| f == is_front).count();
                for is_front in [true, false] {
                    assert_eq!(count(&hits, is_front), count(&moved, is_front), "{x} {y} {hits:?} {moved:?}");
                }
                crossed += usize::from(!hits.is_empty());
                touched += usize::from(hits.is_empty() && bvh.occluded(&at(x, y)));
            }
        }
    }
    assert!(crossed > 100 && touched > 5, "{crossed} rays cross, {touched} only touch");
}

#[test]
fn a_plane_is_crossed_once_where_triangles_share_edges() {
    let mesh = canted_fixtures::coplanar_quads(8);
    let bvh = build(&mesh, Preset::Balanced);
    for x in 0..=16u8 {
        for y in 0..=16u8 {
            let ray = Ray::new([0.5 * f32::from(x), 0.5 * f32::from(y), 3.0], [0.0, 0.0, -2.0]);
            let hits = crossings(&bvh, &ray);
            // The lower half of the border belongs to the plane.
            if x < 16 && y < 16 {
                assert_eq!(hits.len(), 1, "{ray:?} {hits:?}");
                assert_eq!(Some(hits[0]), bvh.closest_hit(&ray), "the lowest primitive");
            } else {
                assert_eq!((hits.len(), bvh.occluded(&ray)), (0, true), "{ray:?} {hits:?}");
            }
        }
    }
}

#[test]
fn two_layers_count_twice_and_intervals_are_closed() {
    let one = canted_fixtures::coplanar_quads(4);
    let n = one.positions.len() as u32;
    let mut mesh = one.clone();
    mesh.positions.extend(one.positions.iter().map(|&[x, y, _]| [x, y, 1.0]));
    mesh.triangles.extend(one.triangles.iter().map(|t| t.map(|v| v + n)));
    let bvh = build(&mesh, Preset::Balanced);
    let ray = Ray::new([2.0, 2.0, 4.0], [0.0, 0.0, -1.0]);
    let ts = |ray: &Ray| crossings(&bvh, ray).iter().map(|hit| hit.t).collect::<Vec<_>>();
    assert_eq!(ts(&ray), [3.0, 4.0]);
    assert_eq!(ts(&Ray { t_max: 3.0, ..ray }), [3.0]);
    assert_eq!(ts(&Ray { t_min: 3.5, ..ray }), [4.0]);
    assert_eq!(ts(&Ray { t_min: 5.0, ..ray }), []);
    // Equal copies are as many surfaces.
    let mut twice = one.clone();
    twice.triangles.extend(&one.triangles);
    let bvh = build(&twice, Preset::Balanced);
    assert_eq!(crossings(&bvh, &ray).len(), 2);
}
