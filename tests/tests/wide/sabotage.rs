//! The tests of this folder detect boxes that are too small, a moved vertex, a lost triangle and a forged file.

use canted_fixtures::{Mesh, thin_box, torus};
use canted_obb::{Aabb, PrimId};
use canted_tests::{rays, scenes};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Kernel, Ray, ScaledRay, Watertight};
use canted_wide::{Config, Primitive, PrimitiveHit, TriangleBvh, WideBvh};

use super::setup::{build, few_variants, first_difference, loop_over_all};

/// A triangle whose box is too small by `PARTS` in ten million. Rays are padded as for triangles if `PADDED`, else as for
/// primitives with exact hits.
struct Shrunk<const PARTS: u32, const PADDED: bool>([[f32; 3]; 3]);

impl<const PARTS: u32, const PADDED: bool> Primitive for Shrunk<PARTS, PADDED> {
    const ERROR: f32 = if PADDED { HIT_ERROR } else { 0.0 };

    #[expect(clippy::cast_possible_truncation, reason = "boxes are rounded like everything")]
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
    let tree = WideBvh::<Shrunk<PARTS, PADDED>>::build(mesh.triangles.iter().map(shrunk).collect(), &Config::default())
        .unwrap();
    let wants = loop_over_all::<Watertight>(mesh, rays);
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
        let wants = loop_over_all::<Watertight>(&moved, &rays);
        for (variant, config) in few_variants() {
            let tree = build::<Watertight>(&case.mesh, &config);
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
    let wants = loop_over_all::<Watertight>(&mesh, &rays);
    for lost in 0..mesh.triangles.len() {
        let mut fewer = mesh.clone();
        // Indices of the others stay: the lost triangle becomes a point.
        fewer.triangles[lost] = [fewer.triangles[lost][0]; 3];
        let tree = build::<Watertight>(&fewer, &Config::default());
        assert!(first_difference(&tree, &rays, &wants).is_some(), "triangle {lost}");
    }
}

/// A hit that differs by one bit of a weight or in the sign of a zero is a different hit.
#[test]
fn one_bit_is_detected() {
    let mesh = torus(12, 6);
    let rays = rays::of_all_classes(&mesh, 20, 130);
    let tree = build::<Watertight>(&mesh, &Config::default());
    let wants = loop_over_all::<Watertight>(&mesh, &rays);
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
    const HEADER: usize = 176;
    let mesh = torus(12, 6);
    let config = super::setup::of_one_kind(canted_wide::NodeKind::Aligned);
    let config = Config { rotate_mesh: false, ..config };
    let bytes = build::<Watertight>(&mesh, &config).to_bytes();
    assert!(TriangleBvh::<Watertight>::from_bytes(&bytes).is_ok());
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
            TriangleBvh::<Watertight>::from_bytes(&forged).is_err()
        })
        .count();
    assert_eq!(n_refused, 48);
}
