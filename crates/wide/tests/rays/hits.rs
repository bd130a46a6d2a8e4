//! Hits equal those of testing every triangle, bit for bit.

use canted_obb::PrimId;
use canted_trace::{Counts, Crossings, Hit, Intersect, Kernel, MollerTrumbore, Ray, TriangleTest, Watertight};
use canted_wide::{Preset, SimdPath, TraversalCounts, TriangleBvh};

use crate::common::{brute, build, build_for, paths, rays, scenes};

/// `test` traced, compared with `B` tested on every triangle.
fn equals_brute_force<B: Kernel<Record = [[f32; 3]; 3]>>(test: TriangleTest) {
    let paths = paths();
    for (name, mesh) in scenes() {
        let rays = rays(&mesh, 60, 7);
        let want: Vec<Vec<Hit>> = rays.iter().map(|ray| brute::<B>(&mesh, ray)).collect();
        for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
            let mut bvh = build_for(test, &mesh, preset);
            for &path in &paths {
                bvh = bvh.with_path(path);
                let mut hits = vec![];
                for (i, (ray, want)) in rays.iter().zip(&want).enumerate() {
                    let at = || format!("{name}, {preset:?}, {}, ray {i} {ray:?}", path.name());
                    assert_eq!(bvh.closest_hit(ray), want.first().copied(), "{}", at());
                    assert_eq!(bvh.occluded(ray), !want.is_empty(), "{}", at());
                    bvh.all_hits(ray, &mut hits);
                    assert_eq!(&hits, want, "{}", at());
                }
            }
        }
    }
}

#[test]
fn watertight_hits_equal_brute_force() {
    equals_brute_force::<Watertight>(TriangleTest::Watertight);
}

#[test]
fn moller_trumbore_hits_equal_brute_force() {
    equals_brute_force::<MollerTrumbore>(TriangleTest::MollerTrumbore);
}

/// By contract its hits are those of Möller and Trumbore, whose records brute force can make.
#[test]
fn baldwin_weber_hits_equal_brute_force() {
    equals_brute_force::<MollerTrumbore>(TriangleTest::BaldwinWeber);
}

#[test]
fn enough_rays_hit_and_enough_miss() {
    for (name, mesh) in scenes() {
        let rays = rays(&mesh, 60, 7);
        let hit = rays.iter().filter(|ray| !brute::<Watertight>(&mesh, ray).is_empty()).count();
        let least = if name == "slivers" { 5 } else { 60 };
        assert!((least..rays.len() - 10).contains(&hit), "{name}: {hit} of {} rays hit", rays.len());
    }
}

#[test]
fn an_empty_bvh_is_never_hit() {
    let mesh = canted_fixtures::Mesh::default();
    for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
        let bvh = build(&mesh, preset);
        let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
        let mut hits = hits_of_one_triangle();
        bvh.all_hits(&ray, &mut hits);
        assert_eq!((bvh.closest_hit(&ray), bvh.occluded(&ray), hits.len()), (None, false, 0));
        bvh.crossings(&ray, &mut hits);
        assert!(hits.is_empty());
    }
}

fn hits_of_one_triangle() -> Vec<Hit> {
    let mesh = canted_fixtures::identical(1);
    let bvh = build(&mesh, Preset::Balanced);
    let mut hits = vec![];
    bvh.all_hits(&Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]), &mut hits);
    assert_eq!(hits.len(), 1);
    assert_eq!(hits[0].primitive, PrimId(0));
    hits
}

#[test]
fn of_a_hundred_thousand_equal_triangles_the_lowest_is_hit() {
    let mesh = canted_fixtures::identical(100_000);
    let ray = Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]);
    for preset in [Preset::Fast, Preset::Balanced] {
        let bvh = build(&mesh, preset);
        assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.primitive), Some(PrimId(0)), "{preset:?}");
        let mut hits = vec![];
        bvh.all_hits(&ray, &mut hits);
        assert_eq!(hits.len(), 100_000, "{preset:?}");
        assert!(hits.iter().enumerate().all(|(i, hit)| hit.primitive.index() == i));
        bvh.crossings(&ray, &mut hits);
        assert_eq!(hits.len(), 100_000, "as many surfaces, {preset:?}");
        assert!(bvh.occluded(&ray));
    }
}

#[test]
fn intervals_are_closed_for_both_zeros() {
    let mesh = canted_fixtures::coplanar_quads(4);
    for path in paths() {
        let bvh = build(&mesh, Preset::Balanced).with_path(path);
        let (start, above) = ([1.3, 2.2, 0.0], [1.3, 2.2, 2.0]);
        let down = [0.0, -0.0, -1.0];
        let hits = |ray: Ray| bvh.closest_hit(&ray).map(|hit| hit.t);
        // From the surface itself, with an interval of nothing but zeros.
        for t_min in [0.0, -0.0] {
            for t_max in [0.0, -0.0, f32::INFINITY] {
                assert_eq!(hits(Ray { t_min, t_max, ..Ray::new(start, down) }), Some(0.0), "{t_min:?} {t_max:?}");
            }
        }
        assert_eq!(hits(Ray { t_min: 2.0, t_max: 2.0, ..Ray::new(above, down) }), Some(2.0));
        assert_eq!(hits(Ray { t_min: 2.0f32.next_up(), ..Ray::new(above, down) }), None);
        assert_eq!(hits(Ray { t_max: 2.0f32.next_down(), ..Ray::new(above, down) }), None);
        assert_eq!(hits(Ray { t_min: 3.0, t_max: 1.0, ..Ray::new(above, down) }), None);
        assert_eq!(hits(Ray { t_max: f32::NAN, ..Ray::new(above, down) }), None);
        assert_eq!(hits(Ray::new(above, [0.0; 3])), None);
    }
}

#[test]
fn ties_go_to_the_lowest_primitive() {
    // Four squares share each integer point: up to eight triangles at the same t.
    let mesh = canted_fixtures::coplanar_quads(9);
    let bvh = build(&mesh, Preset::Quality);
    for x in 0..=9u8 {
        for y in 0..=9u8 {
            let ray = Ray::new([f32::from(x), f32::from(y), 1.0], [0.0, 0.0, -1.0]);
            let want = brute::<Watertight>(&mesh, &ray);
            assert!(want.iter().all(|hit| hit.t == 1.0) && !want.is_empty());
            assert_eq!(bvh.closest_hit(&ray), want.first().copied());
        }
    }
}

/// A binary tree as spatial splits make them: triangles are in several leaves.
#[test]
fn triangles_with_many_references_are_reported_once() {
    let mesh = canted_fixtures::soup(8, 300);
    let (corners, bounds) = canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles).expect("a valid mesh");
    // Three references each, in an order that puts them far apart.
    let n = corners.len() as u32;
    let leaves: Vec<PrimId> = (0..3 * n).map(|i| PrimId(i.wrapping_mul(7919) % n)).collect();
    let codes = (0..leaves.len() as u64).collect();
    let tree = canted_lbvh::radix(canted_lbvh::Sorted { codes, leaves });
    let wide = TriangleBvh::from_tree(&tree, &corners, &bounds, Preset::Balanced).expect("few triangles");
    for ray in rays(&mesh, 100, 3) {
        let want = brute::<Watertight>(&mesh, &ray);
        let mut hits = vec![];
        wide.all_hits(&ray, &mut hits);
        assert_eq!(hits, want);
        assert_eq!((wide.closest_hit(&ray), wide.occluded(&ray)), (want.first().copied(), !want.is_empty()));
        // A soup has no edges in common but those of a triangle with itself.
        wide.crossings(&ray, &mut hits);
        assert!(hits.len() <= want.len() && hits.iter().all(|hit| want.contains(hit)));
        assert!(hits.windows(2).all(|pair| pair[0].before(&pair[1])), "none twice");
    }
}

// What a BVH reports of itself: counts of visits, and its triangles.

#[test]
fn traversal_counts_are_the_tests_that_a_query_counts() {
    let mesh = canted_fixtures::scaffold(1, false);
    let bvh = build(&mesh, Preset::Fast);
    let rays: Vec<Ray> = canted_fixtures::object_views(&mesh)[0]
        .rays(24)
        .iter()
        .map(|ray| Ray::new(ray.origin, ray.direction))
        .collect();
    let mut counts = Counts::default();
    for ray in &rays {
        bvh.closest_hit_with(ray, &mut counts);
    }
    let visits = bvh.traversal_counts(&rays);
    assert_eq!(8 * visits.nodes.iter().sum::<u64>(), counts.boxes);
    assert!(visits.nodes.iter().all(|&n| n > 0), "{visits:?}");
    let most = counts.triangles.div_ceil(8) + visits.leaves;
    assert!(visits.leaves <= visits.blocks && visits.blocks <= most, "{visits:?} for {counts:?}");
    assert_eq!(bvh.clone().with_path(SimdPath::Scalar).traversal_counts(&rays), visits);
    assert_eq!(bvh.traversal_counts(&[]), TraversalCounts::default());
}

#[test]
fn triangles_are_returned_as_they_were_given() {
    for (name, mesh) in scenes() {
        let corners = |positions: &[[f32; 3]]| -> Vec<[[f32; 3]; 3]> {
            mesh.triangles.iter().map(|t| t.map(|i| positions[i as usize])).collect()
        };
        for preset in [Preset::Fast, Preset::Quality] {
            let mut bvh = build(&mesh, preset);
            let check = |bvh: &TriangleBvh, want: &[[[f32; 3]; 3]]| {
                assert_eq!(bvh.triangles(), want, "{name}");
                for (id, want) in (0..).map(PrimId).zip(want) {
                    assert_eq!(bvh.triangle(id), *want, "{name}");
                }
            };
            check(&bvh, &corners(&mesh.positions));
            check(&TriangleBvh::from_bytes(&bvh.to_bytes()).unwrap(), &corners(&mesh.positions));
            let moved: Vec<_> = mesh.positions.iter().map(|p| p.map(|x| 1.0 - x)).collect();
            bvh.refit(&moved, &mesh.triangles).unwrap();
            check(&bvh, &corners(&moved));
        }
    }
    let none = TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap();
    assert!(none.triangles().is_empty());
}
