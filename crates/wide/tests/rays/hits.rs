//! Intervals, ties of many triangles and references, lists. Every query is compared with a loop over all triangles in the tests of the
//! workspace.

use canted_obb::PrimId;
use canted_trace::{Crossings, Hit, HitLists, Intersect, Ray, TriangleTest, Watertight};
use canted_wide::{Preset, TriangleBvh};

use crate::common::{brute, build, build_for, paths, rays};

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

#[test]
fn lists_equal_single_rays() {
    let mesh = canted_fixtures::soup(4, 400);
    let mut rays = rays(&mesh, 700, 5);
    rays.push(Ray::new([f32::NAN, 0.0, 0.0], [0.0, 0.0, 1.0]));
    // Through corners, where crossings and hits differ.
    rays.extend(mesh.triangles.iter().map(|t| {
        let target = mesh.positions[t[0] as usize];
        Ray::new([target[0], target[1], target[2] - 4.0], [0.0, 0.0, 1.0])
    }));
    for path in paths() {
        let bvh = build(&mesh, Preset::Balanced).with_path(path);
        let (mut lists, mut hits, mut n_all) = (HitLists::new(), vec![], 0);
        // Old answers must be overwritten.
        bvh.all_hits_listed(&rays[..9], &mut lists);
        bvh.all_hits_listed(&rays, &mut lists);
        assert_eq!(lists.of_rays().count(), rays.len());
        for (ray, own) in rays.iter().zip(lists.of_rays()) {
            bvh.all_hits(ray, &mut hits);
            assert_eq!(own, hits, "{ray:?} {}", path.name());
            n_all += hits.len();
        }
        assert_eq!((n_all, lists.hits().len()), (lists.hits().len(), n_all));
        bvh.crossings_listed(&rays, &mut lists);
        for (ray, own) in rays.iter().zip(lists.of_rays()) {
            bvh.crossings(ray, &mut hits);
            assert_eq!(own, hits, "{ray:?} {}", path.name());
        }
        assert!(lists.hits().len() < n_all && lists.of_rays().count() == rays.len());
    }
    let mut lists = HitLists::new();
    build_for(TriangleTest::MollerTrumbore, &mesh, Preset::Fast).all_hits_listed(&[], &mut lists);
    assert_eq!(lists, HitLists::default());
}

#[test]
#[should_panic(expected = "one answer for each ray")]
fn slices_of_different_length_panic() {
    let bvh = build(&canted_fixtures::fan(3), Preset::Fast);
    bvh.par_closest_hits(&[Ray::new([0.0; 3], [1.0; 3])], &mut []);
}
