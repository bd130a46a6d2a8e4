//! Wide BVHs: `t`, `u`, `v` and primitive have the same bits as in a loop over all triangles.
//!
//! Every preset, with and without oriented nodes, in a local frame of the mesh, with nodes of a single kind, on every available
//! SIMD path, with every kernel; rays through vertices and edges, in face planes, axis-parallel, from inside, from up to 10,000
//! mesh sizes away; coordinates of 1e7, scales from 2^-60 to 2^60; instances. The last tests show that boxes that are too small, a moved
//! vertex, a lost triangle and a forged file are detected. Not covered here: slices, filters, ordered all-hits queries, refit and files
//! (tests of `canted-wide`).

use canted_fixtures::{Grazing, Mesh, coplanar_quads, displaced_icosphere, scaffold_of, soup, thin_box, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Aabb, Affine, PrimId};
use canted_tests::{
    brute,
    closed::placements,
    rays,
    scenes::{self, Case, baked},
    variants::{
        agrees, binary_top, build, every_variant, few_variants, first_difference, loop_over_all, of_one_kind, paths,
        single_kind_variants,
    },
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Intersect, Kernel, Ray, ScaledRay, TriangleTest, Watertight};
use canted_wide::{Config, Primitive, PrimitiveHit, SimdPath, TriangleBvh, WideBvh};

/// Rays of every class, and from inside.
fn all_rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    [rays::of_all_classes(mesh, n, 20), rays::from_inside(mesh, 2 * n, 30)].concat()
}

#[test]
fn watertight_loses_no_hit() {
    for case in scenes::cases().iter().chain(&scenes::needles()) {
        agrees(TriangleTest::Watertight, &case.name, &case.mesh, &every_variant(), &all_rays(&case.mesh, 20));
    }
}

#[test]
fn other_triangle_tests_lose_no_hit() {
    for Case { name, mesh } in scenes::cases().iter().chain(&scenes::needles()) {
        for test in [TriangleTest::MollerTrumbore, TriangleTest::BaldwinWeber] {
            agrees(test, name, mesh, &few_variants(), &all_rays(mesh, 10));
        }
    }
}

#[test]
fn rays_exactly_in_the_planes_of_faces_lose_no_hit() {
    for case in scenes::cases().iter().chain(&scenes::needles()) {
        let mesh = rays::on_lattice(&case.mesh);
        let rays = rays::in_planes(&mesh, 150, 40);
        agrees(TriangleTest::Watertight, &case.name, &mesh, &few_variants(), &rays);
        agrees(TriangleTest::MollerTrumbore, &case.name, &mesh, &few_variants()[..2], &rays);
    }
}

/// Rotated flat boxes and rotated rooms.
fn rotated() -> Vec<Case> {
    let case = |name: &str, mesh: Mesh| Case { name: name.to_owned(), mesh: mesh.off_axis() };
    vec![
        case("rotated quads", coplanar_quads(12)),
        case("rotated flat box", thin_box(0.0)),
        case("rotated room", scenes::room(3, 60)),
    ]
}

#[test]
fn rotated_meshes_lose_no_hit_in_local_frames() {
    let mut n_rotated = 0;
    for case in rotated() {
        agrees(TriangleTest::Watertight, &case.name, &case.mesh, &every_variant(), &all_rays(&case.mesh, 60));
        agrees(TriangleTest::MollerTrumbore, &case.name, &case.mesh, &few_variants(), &all_rays(&case.mesh, 20));
        for (_, config) in few_variants() {
            let tree = build(&case.mesh, &config);
            let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            n_rotated += usize::from(tree.frame() != rows && tree.sizes().nodes[0] > 0);
        }
    }
    assert!(n_rotated > 0, "no BVH has aligned nodes in a local frame");
}

/// The tests above cover every node kind that builds produce, on every SIMD path.
#[test]
#[expect(clippy::print_stderr, reason = "unavailable paths are reported")]
fn every_node_kind_is_tested() {
    let (there, missing) = paths();
    assert!(there.contains(&SimdPath::Scalar) && there.len() + missing.len() == SimdPath::ALL.len());
    for name in missing {
        eprintln!("not tested: {name} is not available");
    }
    // First nodes of each requested kind, then those of each kind in the BVHs of the presets.
    let (mut asked, mut preset) = ([0; 2], [0; 2]);
    for case in scenes::needles() {
        for (i, (_, config)) in single_kind_variants().iter().enumerate() {
            asked[i] += build(&case.mesh, config).sizes().nodes[i];
        }
        let nodes = build(&case.mesh, &Config::default()).sizes().nodes;
        preset = [0, 1].map(|i| preset[i] + nodes[i]);
    }
    assert!(asked.iter().all(|&n| n > 100), "{asked:?}");
    assert!(preset[1] > 0, "node kinds of the presets: {preset:?}");
}

#[test]
fn enough_rays_hit_and_enough_miss() {
    for case in scenes::needles() {
        let rays = all_rays(&case.mesh, 20);
        let tree = build(&case.mesh, &Config::default());
        let n_hits = rays.iter().filter(|ray| tree.occluded(ray)).count();
        assert!(n_hits > 20 && rays.len() - n_hits > 5, "{}: {n_hits} of {} rays hit", case.name, rays.len());
    }
}

/// Shapes of small and large extent, thin, flat, and not axis-parallel.
fn shapes() -> Vec<Case> {
    let case = |name: &str, mesh: Mesh| Case { name: name.to_owned(), mesh };
    let mut shapes = scenes::needles();
    shapes.push(case("soup", soup(7, 300)));
    shapes.push(case("torus", torus(24, 8)));
    shapes.push(case("rotated room", scenes::room(3, 40).off_axis()));
    shapes.push(case("rotated flat box", thin_box(0.0).off_axis()));
    shapes.push(case("displaced icosphere", displaced_icosphere(3, 2)));
    shapes
}

#[test]
fn rays_from_up_to_ten_thousand_sizes_away_lose_no_hit() {
    for Case { name, mesh } in shapes() {
        for (sizes, seed) in [(1e2, 50), (1e3, 51), (1e4, 52)] {
            let rays = rays::from_afar(&mesh, sizes, 300, seed);
            agrees(TriangleTest::Watertight, &format!("{name}, from {sizes:e} sizes"), &mesh, &every_variant(), &rays);
            agrees(
                TriangleTest::MollerTrumbore,
                &format!("{name}, from {sizes:e} sizes"),
                &mesh,
                &few_variants()[1..],
                &rays,
            );
        }
    }
}

/// Enough rays from afar hit something, or the test above proves nothing.
#[test]
fn rays_from_afar_hit() {
    for Case { name, mesh } in shapes().iter().filter(|case| ["soup", "torus"].contains(&&*case.name)) {
        for sizes in [1e2, 1e3, 1e4] {
            let rays = rays::from_afar(mesh, sizes, 300, 50);
            let n_hits = loop_over_all(mesh, TriangleTest::Watertight, &rays).iter().flatten().count();
            assert!(n_hits > 150, "{name}, from {sizes:e} sizes: {n_hits} hits");
        }
    }
}

#[test]
fn coordinates_of_1e7_lose_no_hit() {
    for Case { name, mesh } in shapes() {
        // Adjacent f32 values are 1 apart at 1e7, so small shapes are flat along one axis, or along all but one.
        let placements: [(&str, Mesh); 5] = [
            ("at 1e7", mesh.placed(|p| [p[0] * 50.0 + 1e7, p[1] * 50.0 - 1e7, p[2] * 50.0 + 1e7])),
            ("at 1e7 along x, 1e-3 across", mesh.placed(|p| [p[0] * 20.0 + 1e7, p[1] * 1e-3, p[2] * 1e-3])),
            ("at 1e7 along x and y, 1e-3 along z", mesh.placed(|p| [p[0] + 1e7, p[1] * 30.0 - 1e7, p[2] * 1e-3])),
            ("1e7 long, 1e-3 thick", mesh.placed(|p| [p[0] * 1e7, p[1] * 1e7, p[2] * 1e-3])),
            ("size 1e-3 near 1e7", mesh.placed(|p| p.map(|x| x * 1e-3)).joined(&mesh.placed(|p| p.map(|x| x * 1e7)))),
        ];
        for (placement, mesh) in placements {
            let classes = [Grazing::Vertices, Grazing::Edges, Grazing::Planes, Grazing::Axes];
            let mut rays = rays::of_classes(&mesh, &classes, 40, 60);
            rays.extend(rays::from_inside(&mesh, 150, 61));
            rays.extend(rays::from_afar(&mesh, 1e2, 60, 62));
            agrees(TriangleTest::Watertight, &format!("{name}, {placement}"), &mesh, &few_variants(), &rays);
        }
    }
}

#[test]
fn scales_of_1e_6_and_1e6_lose_no_hit() {
    for Case { name, mesh } in shapes() {
        for scale in [1e-6, 1e6] {
            let mesh = mesh.placed(|p| p.map(|x| x * scale));
            let mut rays = rays::of_all_classes(&mesh, 60, 70);
            rays.extend(rays::from_inside(&mesh, 200, 71));
            agrees(TriangleTest::Watertight, &format!("{name}, {scale:e}"), &mesh, &every_variant(), &rays);
        }
    }
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    // Small enough that rays at 2^60 start within the promised 2^62.
    let meshes = [soup(7, 300), scaffold_of(1, true, 3), scenes::room(3, 40).off_axis()];
    for mesh in meshes.map(|mesh| mesh.placed(|p| p.map(|x| x / 16.0))) {
        let classes = [Grazing::Vertices, Grazing::Edges, Grazing::Planes, Grazing::Axes];
        let rays = rays::of_classes(&mesh, &classes, 60, 80);
        let wants = loop_over_all(&mesh, TriangleTest::Watertight, &rays);
        assert!(wants.iter().flatten().count() > 50);
        for exponent in (-60..=60).step_by(12) {
            let scale = 2.0f32.powi(exponent);
            let scaled = mesh.placed(|p| p.map(|x| x * scale));
            // Scales only the ray's origin; its target is then `scale` times as far, in units of the direction.
            let rays: Vec<_> = rays
                .iter()
                .map(|ray| Ray {
                    origin: ray.origin.map(|x| x * scale),
                    t_min: ray.t_min * scale,
                    t_max: ray.t_max * scale,
                    ..*ray
                })
                .collect();
            let wants: Vec<_> = wants.iter().map(|hit| hit.map(|hit| Hit { t: hit.t * scale, ..hit })).collect();
            for (variant, config) in few_variants() {
                let tree = build(&scaled, &config);
                for path in paths().0 {
                    let difference = first_difference(&tree.clone().with_path(path), &rays, &wants);
                    assert_eq!(difference, None, "2^{exponent}, {variant}, {}", path.name());
                }
            }
        }
    }
}

/// Every placement twice, alternating between the meshes.
fn placed() -> Vec<Affine> {
    placements().iter().flat_map(|placement| [placement.world_from_object; 2]).collect()
}

fn instances_agree(test: TriangleTest) {
    let meshes = [scenes::needles().remove(0).mesh, scenes::room(3, 20).off_axis()];
    let placed = placed();
    let rays_at_all: Vec<Ray> = placed
        .iter()
        .zip(0..)
        .flat_map(|(affine, i)| rays::of_all_classes(&baked(&meshes[i % 2], affine), 12, 90 + i as u64))
        .collect();
    let in_mesh = meshes.each_ref().map(|mesh| brute::of_mesh(mesh, test));
    let trace = |i: usize, ray: &Ray| in_mesh[i % 2](ray);
    let wants: Vec<_> = rays_at_all.iter().map(|ray| brute::closest_hit_of_instances(&placed, ray, trace)).collect();
    assert!(wants.iter().flatten().count() > 300, "too few rays hit");
    let instances: Vec<Instance> =
        placed.iter().zip([0, 1].into_iter().cycle()).map(|(&a, blas)| Instance::new(blas, a)).collect();
    for (variant, config) in few_variants() {
        for path in paths().0 {
            let config = Config { test, ..config };
            let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &config).with_path(path)).collect();
            let binary = binary_top(VolumeConfig { strategy: Strategy::Dop, fallback: true });
            for top in [TopConfig::Wide(config), binary] {
                let tlas = Tlas::new(bottom.clone(), &instances, top.clone()).unwrap();
                let difference = first_difference(&tlas, &rays_at_all, &wants);
                assert_eq!(difference, None, "{variant}, {}, {top:?}", path.name());
            }
        }
    }
}

#[test]
fn watertight_agrees_through_instances() {
    instances_agree(TriangleTest::Watertight);
}

#[test]
fn moller_trumbore_agrees_through_instances() {
    instances_agree(TriangleTest::MollerTrumbore);
}

/// A triangle whose box is too small by `PARTS` in ten million. Rays are padded as for triangles if `PADDED`, else as for
/// primitives with exact hits.
struct Shrunk<const PARTS: u32, const PADDED: bool>([[f32; 3]; 3]);

impl<const PARTS: u32, const PADDED: bool> Primitive for Shrunk<PARTS, PADDED> {
    const ERROR: f32 = if PADDED { HIT_ERROR } else { 0.0 };

    fn bounds(&self) -> Aabb {
        let of =
            |pick: fn(f32, f32) -> f32| std::array::from_fn(|k| pick(pick(self.0[0][k], self.0[1][k]), self.0[2][k]));
        let (min, max): ([f32; 3], [f32; 3]) = (of(f32::min), of(f32::max));
        let moved = |from: f32, to: f32| {
            (f64::from(from) + 0.5e-7 * f64::from(PARTS) * (f64::from(to) - f64::from(from))) as f32
        };
        Aabb {
            min: std::array::from_fn(|k| moved(min[k], max[k])),
            max: std::array::from_fn(|k| moved(max[k], min[k])),
        }
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let hit = Watertight::intersect(&Watertight::prepare(ray), ray, &Watertight::record(self.0), t_max)?;
        Some(PrimitiveHit { t: hit.t, u: hit.u, v: hit.v, side: hit.side })
    }
}

/// Number of rays for which the BVH over shrunk triangles differs from the loop.
fn n_lost<const PARTS: u32, const PADDED: bool>(mesh: &Mesh, rays: &[Ray]) -> usize {
    let shrunk = |t: &[u32; 3]| Shrunk::<PARTS, PADDED>(t.map(|index| mesh.positions[index as usize]));
    let tree = WideBvh::over(mesh.triangles.iter().map(shrunk).collect()).unwrap();
    let wants = loop_over_all(mesh, TriangleTest::Watertight, rays);
    rays.iter().zip(&wants).filter(|(ray, want)| tree.closest_hit(ray) != **want).count()
}

/// The same traversal and padding as for triangles, but the boxes decide.
#[test]
fn boxes_too_small_by_a_millionth_lose_hits() {
    let meshes = [thin_box(1.0), scenes::room(3, 40), torus(24, 8), scenes::needles().remove(0).mesh];
    let (mut lost_of_ten, mut lost_of_one) = (0, 0);
    for mesh in meshes.map(|mesh| rays::on_lattice(&mesh)) {
        let rays = [rays::of_all_classes(&mesh, 300, 100), rays::from_inside(&mesh, 1_500, 101)].concat();
        assert_eq!(n_lost::<0, true>(&mesh, &rays), 0, "correct boxes lose no hit");
        lost_of_ten += n_lost::<100, true>(&mesh, &rays);
        // Padding for the triangle test's own error tolerates a millionth.
        lost_of_one += n_lost::<10, false>(&mesh, &rays);
    }
    assert!(lost_of_ten > 0 && lost_of_one > 0, "{lost_of_ten}, {lost_of_one} hits were lost");
}

#[test]
fn a_vertex_moved_by_the_last_bit_is_detected() {
    for case in scenes::needles().iter().filter(|case| case.name != "needles") {
        let rays = rays::of_all_classes(&case.mesh, 40, 110);
        let mut moved = case.mesh.clone();
        moved.positions.iter_mut().for_each(|p| p[0] = p[0].next_up());
        let wants = loop_over_all(&moved, TriangleTest::Watertight, &rays);
        for (variant, config) in few_variants() {
            let tree = build(&case.mesh, &config);
            assert!(first_difference(&tree, &rays, &wants).is_some(), "{}, {variant}", case.name);
            // After a refit to those vertices the answers agree.
            let mut tree = tree;
            tree.refit(&moved.positions, &moved.triangles).unwrap();
            assert_eq!(first_difference(&tree, &rays, &wants), None, "{}, {variant}", case.name);
        }
    }
}

#[test]
fn each_lost_triangle_is_detected() {
    let mesh = torus(12, 6);
    let rays = rays::of_all_classes(&mesh, 300, 120);
    let wants = loop_over_all(&mesh, TriangleTest::Watertight, &rays);
    for lost in 0..mesh.triangles.len() {
        let mut fewer = mesh.clone();
        // Indices of the others stay: the lost triangle becomes a point.
        fewer.triangles[lost] = [fewer.triangles[lost][0]; 3];
        let tree = build(&fewer, &Config::default());
        assert!(first_difference(&tree, &rays, &wants).is_some(), "triangle {lost}");
    }
}

/// A hit that differs by one bit of a weight or in the sign of a zero is a different hit.
#[test]
fn one_bit_is_detected() {
    let mesh = torus(12, 6);
    let rays = rays::of_all_classes(&mesh, 20, 130);
    let tree = build(&mesh, &Config::default());
    let wants = loop_over_all(&mesh, TriangleTest::Watertight, &rays);
    assert_eq!(first_difference(&tree, &rays, &wants), None);
    let changes: [fn(&mut Hit); 5] = [
        |hit| hit.t = hit.t.next_up(),
        |hit| hit.u = if hit.u == 0.0 { -hit.u } else { hit.u.next_up() },
        |hit| hit.v = if hit.v == 0.0 { -hit.v } else { hit.v.next_up() },
        |hit| hit.primitive = PrimId(hit.primitive.0 ^ 1),
        |hit| hit.instance = InstanceId(1),
    ];
    for i in (0..rays.len()).filter(|&i| wants[i].is_some()) {
        for change in changes {
            let mut wrong = wants.clone();
            wrong[i].as_mut().map(change);
            assert!(first_difference(&tree, &rays, &wrong).is_some(), "ray {i}");
        }
    }
}

/// FNV-1a, the files' checksum against accidents; the reader must detect everything else.
fn checksum(bytes: &[u8]) -> [u8; 8] {
    let sum = bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    sum.to_le_bytes()
}

/// Box planes moved inward in a file with a correct checksum: the reader rejects it.
#[test]
fn files_with_boxes_too_small_by_a_millionth_are_rejected() {
    const HEADER: usize = 192;
    let mesh = torus(12, 6);
    let config = of_one_kind(canted_wide::NodeKind::Aligned);
    let config = Config { rotate_mesh: false, ..config };
    let bytes = build(&mesh, &config).to_bytes();
    assert!(TriangleBvh::from_bytes(&bytes).is_ok());
    // Rows of the root, eight children each: lo x, hi x, lo y and so on.
    let n_refused = (0..48)
        .filter(|number| {
            let mut forged = bytes.clone();
            let at = HEADER + 4 * number;
            let plane = f32::from_le_bytes(forged[at..at + 4].try_into().unwrap());
            let inward = if number / 8 % 2 == 0 { 1e-6 } else { -1e-6 };
            forged[at..at + 4].copy_from_slice(&(plane + inward).to_le_bytes());
            let end = forged.len() - 8;
            let sum = checksum(&forged[..end]);
            forged[end..].copy_from_slice(&sum);
            TriangleBvh::from_bytes(&forged).is_err()
        })
        .count();
    assert_eq!(n_refused, 48);
}
