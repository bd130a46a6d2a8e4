//! What a BVH reports of itself: counts of visits, and its triangles.

use canted_fixtures as fixtures;
use canted_obb::PrimId;
use canted_trace::{Counts, Intersect, Ray};
use canted_wide::{Preset, SimdPath, TraversalCounts, TriangleBvh};

use crate::common::{build, scenes};

#[test]
fn traversal_counts_are_the_tests_that_a_query_counts() {
    let mesh = fixtures::scaffold(1, false);
    let bvh = build(&mesh, Preset::Fast);
    let rays: Vec<Ray> =
        fixtures::object_views(&mesh)[0].rays(24).iter().map(|ray| Ray::new(ray.origin, ray.direction)).collect();
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
