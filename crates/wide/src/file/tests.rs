//! Forged files: whatever their words and checksum, they are rejected or they are valid BVHs.

use std::collections::BTreeMap;

use canted_fixtures::{self as fixtures, Mesh, SplitMix64};
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Intersect, Kernel, Ray, ReferencePoint, ScaledRay, Watertight};

use super::*;
use crate::leaf::StoredTriangles;
use crate::node::checked::Hierarchy;
use crate::node::{LeafLayout, NodeKind};
use crate::{Flaw, TriangleBvh};

fn build(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

fn load(bytes: &[u8]) -> Result<TriangleBvh, LoadError> {
    TriangleBvh::from_bytes(bytes)
}

fn hierarchy(bvh: &TriangleBvh) -> Hierarchy {
    Hierarchy::of(&bvh.nodes, bvh.leaves.halves.len(), &LeafLayout::BLOCKS).unwrap()
}

/// The bytes with a correct checksum.
fn signed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - CHECKSUM_BYTES;
    let sum = checksum(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&sum);
    bytes
}

/// The BVH with records changed by `change`, as a file.
fn forged(bvh: &TriangleBvh, change: impl FnOnce(&mut TriangleBvh)) -> Vec<u8> {
    let mut bvh = bvh.clone();
    change(&mut bvh);
    bvh.to_bytes()
}

fn rays(mesh: &Mesh) -> Vec<Ray> {
    let of = |class| fixtures::grazing(mesh, class, 20, 3);
    let rays = fixtures::Grazing::ALL.into_iter().flat_map(of);
    rays.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }).collect()
}

/// Hits by testing every triangle of the BVH's own blocks.
fn brute(triangles: &StoredTriangles, ray: &Ray) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let prepared = Watertight::prepare(&ray);
    let mut best: Option<Hit> = None;
    for (corners, &primitive) in triangles.corners.iter().zip(&triangles.ids) {
        let Some(hit) = Watertight::intersect(&prepared, &ray, &Watertight::record(*corners), ray.t_max) else {
            continue;
        };
        let hit = Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side };
        if best.is_none_or(|best| hit.before(&best)) {
            best = Some(hit);
        }
    }
    best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
}

/// Whether all of `rays` hit what testing every stored triangle hits.
fn agrees(bvh: &TriangleBvh, rays: &[Ray]) -> bool {
    let hierarchy = hierarchy(bvh);
    let triangles = StoredTriangles::read(&hierarchy, &bvh.leaves.halves);
    rays.iter().all(|ray| {
        let hit = brute(&triangles, ray);
        bvh.closest_hit(ray) == hit && bvh.occluded(ray) == hit.is_some()
    })
}

/// Replaces a few words of the file by others of the file, similar ones, or special values.
fn mangle(bytes: &mut [u8], rng: &mut SplitMix64) {
    const SPECIAL: [u32; 8] = [0, 1, u32::MAX, 0x7fff_ffff, 0x7fc0_0000, 0x7f80_0000, 0x8000_0000, 0x4000_0000];
    let n_words = (bytes.len() - CHECKSUM_BYTES) / 4;
    let word = |bytes: &[u8], i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap());
    for _ in 0..=rng.below(3) {
        // Half of all changes are in the first nodes and the header, which matter most.
        let at = if rng.below(2) == 0 { rng.below(n_words.min(140)) } else { rng.below(n_words) };
        let other = rng.below(n_words);
        let new = match rng.below(4) {
            0 => word(bytes, at) ^ 1 << rng.below(32),
            1 => word(bytes, other),
            2 => SPECIAL[rng.below(8)],
            _ => word(bytes, at).wrapping_add(1),
        };
        if rng.below(4) == 0 {
            // The old one goes there, so that ids of triangles or words of children are exchanged.
            let old = word(bytes, at).to_le_bytes();
            bytes[4 * other..4 * other + 4].copy_from_slice(&old);
        }
        bytes[4 * at..4 * at + 4].copy_from_slice(&new.to_le_bytes());
    }
}

#[test]
fn mangled_files_with_correct_checksums_are_rejected_or_valid() {
    let (mut n_accepted, mut rejected) = (0, BTreeMap::new());
    for (mesh, seed) in [(fixtures::soup(1, 40), 1), (fixtures::scaffold_of(1, true, 2), 2), (fixtures::soup(3, 3), 3)]
    {
        let (bytes, rays) = (build(&mesh).to_bytes(), rays(&mesh));
        let mut rng = SplitMix64::new(seed);
        for _ in 0..1_000 {
            let mut mangled = bytes.clone();
            mangle(&mut mangled, &mut rng);
            match load(&signed(mangled)) {
                Ok(bvh) => {
                    assert!(agrees(&bvh, &rays));
                    n_accepted += 1;
                }
                Err(error) => {
                    let name: String = format!("{error:?}").chars().take_while(|c| *c != '{').collect();
                    *rejected.entry(name).or_insert(0) += 1;
                    assert!(!error.to_string().contains('\n'));
                }
            }
        }
    }
    assert!(n_accepted > 20, "{n_accepted} of 3,000 accepted");
    // Most kinds of errors occurred; the others are forged below.
    assert!(rejected.len() >= 10, "{rejected:?}");
}

#[test]
fn boxes_that_would_lose_a_hit_are_rejected() {
    let mesh = fixtures::scaffold_of(1, true, 3);
    let bvh = build(&mesh);
    let hierarchy = hierarchy(&bvh);
    for kind in [NodeKind::Aligned, NodeKind::Oriented] {
        let node = hierarchy.nodes.iter().find(|node| node.kind == kind).expect("both kinds exist");
        let rows: &[usize] = if kind == NodeKind::Aligned { &[0, 1, 2, 3, 4, 5] } else { &[3, 4, 8, 9, 13, 14] };
        for &row in rows {
            for step in [f32::next_up, f32::next_down] {
                let bytes = forged(&bvh, |bvh| {
                    let rows: &mut [[f32; 8]] = bytemuck::cast_slice_mut(&mut bvh.nodes.lines[node.line..]);
                    rows[row][1] = step(rows[row][1]);
                });
                let error = load(&bytes).err();
                assert_eq!(error, Some(Flaw::Box { line: node.line, slot: 1 }.into()), "{kind:?} row {row}");
            }
        }
    }
}

#[test]
fn a_bvh_that_loses_hits_is_detected() {
    let mesh = fixtures::scaffold_of(1, true, 2);
    let mut bvh = build(&mesh);
    assert!(agrees(&bvh, &rays(&mesh)));
    let first = hierarchy(&bvh).nodes[0].line;
    let rows: &mut [[f32; 8]] = bytemuck::cast_slice_mut(&mut bvh.nodes.lines[first..]);
    rows[4] = rows[4].map(|x| x * 0.5);
    rows[5] = rows[5].map(|x| x * 0.5);
    assert!(!agrees(&bvh, &rays(&mesh)));
}

#[test]
fn triangles_are_checked_by_id_and_vertex() {
    let mesh = fixtures::soup(4, 30);
    let bvh = build(&mesh);
    let hierarchy = hierarchy(&bvh);
    let leaf = hierarchy.leaves.iter().find(|leaf| (2..5).contains(&leaf.places.len())).expect("a leaf of a few");
    let triangles = StoredTriangles::read(&hierarchy, &bvh.leaves.halves);
    let [a, b] = [0, 1].map(|i| triangles.ids[leaf.places.start + i]);
    let lane = crate::node::PART_LANES * leaf.part(&LeafLayout::BLOCKS);
    let error = |word: usize, value: u32| {
        load(&forged(&bvh, |bvh| bvh.leaves.halves[leaf.unit(&LeafLayout::BLOCKS)].0[word + lane] = value)).err()
    };
    assert_eq!(error(36, 30), Some(Flaw::Primitive { primitive: PrimId(30), n_primitives: 30 }.into()));
    assert_eq!(error(36, b.0), Some(Flaw::Different { primitive: b }.into()));
    assert_eq!(error(0, f32::NAN.to_bits()), Some(Flaw::NotFinite { primitive: a }.into()));
    let alone = forged(&build(&fixtures::soup(4, 1)), |bvh| bvh.leaves.halves[0].0[39] = 1);
    assert_eq!(load(&alone).err(), Some(Flaw::Lane { block: 0 }.into()));
    let more = forged(&bvh, |bvh| bvh.n_primitives += 1);
    assert_eq!(load(&more).unwrap_err(), LoadError::Count { n_expected: 31, n_found: 30 });
    let fewer = forged(&bvh, |bvh| bvh.n_primitives -= 1);
    assert_eq!(load(&fewer).unwrap_err(), Flaw::Primitive { primitive: PrimId(29), n_primitives: 29 }.into());
    let deeper = forged(&bvh, |bvh| bvh.nodes.depth -= 1);
    assert!(matches!(load(&deeper), Err(LoadError::Depth { .. })));
    let larger = forged(&bvh, |bvh| bvh.bounds.max[2] *= 2.0);
    assert!(matches!(load(&larger), Err(LoadError::Bounds { .. })));
    let longer = forged(&bvh, |bvh| bvh.frame.rows[1][1] = 1.1);
    assert!(matches!(load(&longer), Err(LoadError::Flaw(Flaw::Row { line: None, .. }))));
    let beyond = forged(&bvh, |bvh| bvh.frame.reference = ReferencePoint::new([1.0, 0.0, 0.0]).unwrap());
    assert!(matches!(load(&beyond), Err(LoadError::Flaw(Flaw::Box { .. }))));
    let mut bytes = bvh.to_bytes();
    for x in [f32::NAN, 2.0 * ReferencePoint::MAX] {
        bytes[152..156].copy_from_slice(&x.to_le_bytes());
        assert!(matches!(load(&signed(bytes.clone())), Err(LoadError::Reference { .. })));
    }
    let costless = forged(&bvh, |bvh| bvh.baseline.costs.leaf = f32::NAN);
    assert!(matches!(load(&costless), Err(LoadError::Cost { .. })));
}

#[test]
fn the_header_has_the_documented_size() {
    let bytes = build(&fixtures::soup(1, 10)).to_bytes();
    let header = Header::read(&bytes).unwrap();
    let mut written = vec![];
    header.write(&mut written);
    assert_eq!(written.len(), HEADER_BYTES);
    assert_eq!(written, bytes[..HEADER_BYTES]);
}
