//! Extreme costs: hits equal those of testing every triangle. What a BVH reports of itself: counts of visits, and its triangles.

use canted_fixtures as fixtures;
use canted_obb::PrimId;
use canted_trace::{Counts, Intersect, Ray, Sphere, Watertight};
use canted_wide::{Config, Costs, NodeKind, Preset, SimdPath, TraversalCounts, TriangleBvh, WideBvh};

use crate::common::{brute, build, rays, scenes};

/// Default costs with one of them, or all, at each extreme value.
fn extremes() -> Vec<(String, Costs)> {
    let usual = Costs::default();
    let mut all = vec![];
    for value in [f32::INFINITY, f32::NAN, f32::MAX, f32::MIN_POSITIVE, 0.0, -0.0, -1.0, f32::NEG_INFINITY] {
        let costs = [
            ("aligned_node", Costs { aligned_node: value, ..usual }),
            ("oriented_node", Costs { oriented_node: value, ..usual }),
            ("nodes", Costs { aligned_node: value, oriented_node: value, ..usual }),
            ("leaf", Costs { leaf: value, ..usual }),
            ("block", Costs { block: value, ..usual }),
            ("all", Costs { aligned_node: value, oriented_node: value, leaf: value, block: value, ..usual }),
        ];
        all.extend(costs.map(|(name, costs)| (format!("{name} {value}"), costs)));
    }
    for max_leaf in [0, 1, 33, usize::MAX] {
        all.push((format!("max_leaf {max_leaf}"), Costs { max_leaf, ..usual }));
    }
    all
}

#[test]
fn triangles_are_hit_with_any_costs() {
    let scenes = [fixtures::soup(1, 300), fixtures::scaffold_of(1, true, 2), fixtures::identical(100)];
    for mesh in scenes {
        let rays = rays(&mesh, 10, 5);
        let want: Vec<_> = rays.iter().map(|ray| brute::<Watertight>(&mesh, ray).first().copied()).collect();
        for (name, costs) in extremes() {
            for preset in [Preset::Balanced, Preset::Quality] {
                for oriented in [false, true] {
                    let config = Config { costs, oriented, ..Config::preset(preset) };
                    let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap();
                    let hits: Vec<_> = rays.iter().map(|ray| bvh.closest_hit(ray)).collect();
                    assert_eq!(hits, want, "{name}, {preset:?}, oriented {oriented}");
                }
            }
        }
    }
}

#[test]
fn a_bvh_of_any_costs_is_refitted_written_and_read() {
    let mesh = fixtures::soup(1, 300);
    for (name, costs) in extremes() {
        let config = Config { costs, ..Config::default() };
        let mut bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap();
        let refit = bvh.refit(&mesh.positions, &mesh.triangles).unwrap();
        assert!(!refit.drift.is_nan(), "{name}: {refit:?}");
        let bytes = bvh.to_bytes();
        let back = TriangleBvh::from_bytes(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(back.to_bytes(), bytes, "{name}");
    }
}

#[test]
fn primitives_are_hit_with_any_costs() {
    let spheres: Vec<Sphere> =
        (0..100u8).map(|i| Sphere { center: [3.0 * f32::from(i), 0.0, 0.0], radius: 1.0 }).collect();
    for (name, costs) in extremes() {
        let bvh = WideBvh::over_with(spheres.clone(), Config { costs, ..Config::default() }).unwrap();
        for i in 0..100u8 {
            let ray = Ray::new([3.0 * f32::from(i), 5.0, 0.0], [0.0, -1.0, 0.0]);
            let hit = bvh.closest_hit(&ray).map(|hit| (hit.t, hit.primitive.0));
            assert_eq!(hit, Some((4.0, u32::from(i))), "{name}");
        }
    }
}

#[test]
fn an_infinite_cost_disables_a_kind_of_node() {
    let mesh = fixtures::scaffold_of(1, true, 3);
    let n_nodes = |costs: Costs, oriented: bool| {
        let config = Config { costs, oriented, ..Config::default() };
        TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap().sizes().nodes
    };
    let usual = Costs::default();
    let of = |kind: NodeKind, nodes: [usize; 2]| nodes[kind as usize];
    let both = n_nodes(usual, true);
    assert!(of(NodeKind::Aligned, both) > 0 && of(NodeKind::Oriented, both) > 0, "{both:?}");
    for infinite in [f32::INFINITY, f32::NAN] {
        assert_eq!(of(NodeKind::Aligned, n_nodes(Costs { aligned_node: infinite, ..usual }, true)), 0);
        assert_eq!(of(NodeKind::Oriented, n_nodes(Costs { oriented_node: infinite, ..usual }, true)), 0);
        // The last kind cannot be disabled, and its nodes are as full as before.
        assert_eq!(n_nodes(Costs { aligned_node: infinite, ..usual }, false), n_nodes(usual, false));
    }
}

#[test]
fn leaves_hold_one_to_thirty_two_triangles() {
    let mesh = fixtures::soup(1, 300);
    let bytes = |max_leaf: usize| {
        let config = Config { costs: Costs { max_leaf, ..Costs::default() }, ..Config::default() };
        TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap().to_bytes()
    };
    assert_eq!(bytes(0), bytes(1));
    assert_eq!(bytes(33), bytes(32));
    assert_ne!(bytes(1), bytes(32));
}

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
    let n_hits = rays.iter().filter(|ray| bvh.closest_hit(ray).is_some()).count() as u64;
    assert!(n_hits <= visits.exact && visits.exact < counts.triangles, "{visits:?} for {n_hits} hits");
    assert_eq!(bvh.clone().with_path(SimdPath::Scalar).traversal_counts(&rays), visits);
    assert_eq!(bvh.traversal_counts(&[]), TraversalCounts::default());
}

#[test]
fn triangles_are_returned_as_they_were_given_and_those_without_area_as_edges() {
    let (mut n_flat, mut n_others) = (0, 0);
    for (name, mesh) in scenes() {
        let mut corners = |positions: &[[f32; 3]]| -> Vec<[[f32; 3]; 3]> {
            let given = mesh.triangles.iter().map(|t| t.map(|i| positions[i as usize]));
            let expected = given.map(|triangle| {
                let is_flat = canted_obb::is_flat(triangle);
                *(if is_flat { &mut n_flat } else { &mut n_others }) += 1;
                if is_flat { canted_obb::flat_as_edge(triangle) } else { triangle }
            });
            expected.collect()
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
    assert!(n_flat > 0 && n_others > 0, "{n_flat} {n_others}");
    let none = TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap();
    assert!(none.triangles().is_empty());
}
