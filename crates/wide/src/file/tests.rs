//! Forged files: whatever their words say and whatever the checksum, they are refused or they are trees.

use std::collections::BTreeMap;

use canted_fixtures::{self as fixtures, Mesh, SplitMix64};
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Kernel, Ray, ScaledRay, Watertight};

use super::*;
use crate::layout::NodeKind;
use crate::refit::{Outline, Triangles};
use crate::{Config, Flaw};

fn build(mesh: &Mesh) -> WideBvh<Watertight> {
    WideBvh::build(&mesh.positions, &mesh.triangles, &Config::default()).unwrap()
}

fn load(bytes: &[u8]) -> Result<WideBvh<Watertight>, LoadError> {
    WideBvh::from_bytes(bytes)
}

/// The bytes with the checksum that they should have.
fn signed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - CHECKSUM_BYTES;
    let sum = checksum(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&sum);
    bytes
}

/// The tree with records changed by `change`, as a file.
fn forged(wide: &WideBvh<Watertight>, change: impl FnOnce(&mut WideBvh<Watertight>)) -> Vec<u8> {
    let mut wide = wide.clone();
    change(&mut wide);
    wide.to_bytes()
}

fn rays(mesh: &Mesh) -> Vec<Ray> {
    let of = |class| fixtures::grazing(mesh, class, 20, 3);
    let rays = fixtures::Grazing::ALL.into_iter().flat_map(of);
    rays.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }).collect()
}

/// Hits by trying every triangle that the tree's own blocks hold.
fn brute(triangles: &Triangles, ray: &Ray) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let prepared = Watertight::prepare(&ray);
    let mut best: Option<Hit> = None;
    for (corners, &primitive) in triangles.corners.iter().zip(&triangles.primitives) {
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

/// Whether all of `rays` hit what trying every stored triangle hits.
fn agrees(wide: &WideBvh<Watertight>, rays: &[Ray]) -> bool {
    let outline = Outline::of(&wide.records).unwrap();
    let triangles = Triangles::read(&outline, &wide.records.halves);
    rays.iter().all(|ray| {
        let hit = brute(&triangles, ray);
        wide.closest_hit(ray) == hit && wide.occluded(ray) == hit.is_some()
    })
}

/// A few words of the file replaced by ones that are there elsewhere, near, or strange.
fn mangle(bytes: &mut [u8], rng: &mut SplitMix64) {
    const STRANGE: [u32; 8] = [0, 1, u32::MAX, 0x7fff_ffff, 0x7fc0_0000, 0x7f80_0000, 0x8000_0000, 0x4000_0000];
    let n_words = (bytes.len() - CHECKSUM_BYTES) / 4;
    let word = |bytes: &[u8], i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap());
    for _ in 0..=rng.below(3) {
        // Half of all changes in the first nodes and the header, where most depends on each word.
        let at = if rng.below(2) == 0 { rng.below(n_words.min(140)) } else { rng.below(n_words) };
        let other = rng.below(n_words);
        let new = match rng.below(4) {
            0 => word(bytes, at) ^ 1 << rng.below(32),
            1 => word(bytes, other),
            2 => STRANGE[rng.below(8)],
            _ => word(bytes, at).wrapping_add(1),
        };
        if rng.below(4) == 0 {
            // The old one goes there, so that numbers of triangles or words of children change places.
            let old = word(bytes, at).to_le_bytes();
            bytes[4 * other..4 * other + 4].copy_from_slice(&old);
        }
        bytes[4 * at..4 * at + 4].copy_from_slice(&new.to_le_bytes());
    }
}

#[test]
fn mangled_files_with_right_checksums_are_refused_or_whole() {
    let (mut n_taken, mut refused) = (0, BTreeMap::new());
    for (mesh, seed) in [(fixtures::soup(1, 40), 1), (fixtures::scaffold_of(1, true, 2), 2), (fixtures::soup(3, 3), 3)]
    {
        let (bytes, rays) = (build(&mesh).to_bytes(), rays(&mesh));
        let mut rng = SplitMix64::new(seed);
        for _ in 0..1_000 {
            let mut mangled = bytes.clone();
            mangle(&mut mangled, &mut rng);
            match load(&signed(mangled)) {
                Ok(wide) => {
                    assert!(agrees(&wide, &rays));
                    n_taken += 1;
                }
                Err(error) => {
                    let name: String = format!("{error:?}").chars().take_while(|c| *c != '{').collect();
                    *refused.entry(name).or_insert(0) += 1;
                    assert!(!error.to_string().contains('\n'));
                }
            }
        }
    }
    assert!(n_taken > 20, "{n_taken} of 3,000 taken");
    // Most kinds of refusal came up; the rest is forged by hand below.
    assert!(refused.len() >= 10, "{refused:?}");
}

#[test]
fn boxes_that_would_lose_a_hit_are_refused() {
    let mesh = fixtures::scaffold_of(1, true, 3);
    let wide = build(&mesh);
    let outline = Outline::of(&wide.records).unwrap();
    for kind in [NodeKind::Aligned, NodeKind::Oriented] {
        let node = outline.nodes.iter().find(|node| node.kind == kind).expect("both kinds are there");
        let rows: &[usize] = if kind == NodeKind::Aligned { &[0, 1, 2, 3, 4, 5] } else { &[3, 4, 8, 9, 13, 14] };
        for &row in rows {
            for step in [f32::next_up, f32::next_down] {
                let bytes = forged(&wide, |wide| {
                    let rows: &mut [[f32; 8]] = bytemuck::cast_slice_mut(&mut wide.records.lines[node.line..]);
                    rows[row][1] = step(rows[row][1]);
                });
                let error = load(&bytes).err();
                assert_eq!(error, Some(Flaw::Box { line: node.line, slot: 1 }.into()), "{kind:?} row {row}");
            }
        }
    }
}

#[test]
fn a_tree_that_loses_hits_would_be_noticed() {
    let mesh = fixtures::scaffold_of(1, true, 2);
    let mut wide = build(&mesh);
    assert!(agrees(&wide, &rays(&mesh)));
    let first = Outline::of(&wide.records).unwrap().nodes[0].line;
    let rows: &mut [[f32; 8]] = bytemuck::cast_slice_mut(&mut wide.records.lines[first..]);
    rows[4] = rows[4].map(|x| x * 0.5);
    rows[5] = rows[5].map(|x| x * 0.5);
    assert!(!agrees(&wide, &rays(&mesh)));
}

#[test]
fn triangles_are_checked_by_number_and_vertex() {
    let mesh = fixtures::soup(4, 30);
    let wide = build(&mesh);
    let outline = Outline::of(&wide.records).unwrap();
    let leaf = outline.leaves.iter().find(|leaf| (2..5).contains(&leaf.places.len())).expect("a leaf of a few");
    let triangles = Triangles::read(&outline, &wide.records.halves);
    let [a, b] = [0, 1].map(|i| triangles.primitives[leaf.places.start + i]);
    let lane = crate::layout::PART_LANES * leaf.part();
    let error = |word: usize, value: u32| {
        load(&forged(&wide, |wide| wide.records.halves[leaf.half()].0[word + lane] = value)).err()
    };
    assert_eq!(error(36, 30), Some(Flaw::Primitive { primitive: PrimId(30), n_triangles: 30 }.into()));
    assert_eq!(error(36, b.0), Some(Flaw::Different { primitive: b }.into()));
    assert_eq!(error(0, f32::NAN.to_bits()), Some(Flaw::NotFinite { primitive: a }.into()));
    let alone = forged(&build(&fixtures::soup(4, 1)), |wide| wide.records.halves[0].0[39] = 1);
    assert_eq!(load(&alone).err(), Some(Flaw::Lane { block: 0 }.into()));
    let more = forged(&wide, |wide| wide.n_triangles += 1);
    assert_eq!(load(&more).unwrap_err(), LoadError::Count { n_told: 31, n_places: 30 });
    let fewer = forged(&wide, |wide| wide.n_triangles -= 1);
    assert_eq!(load(&fewer).unwrap_err(), Flaw::Primitive { primitive: PrimId(29), n_triangles: 29 }.into());
    let deeper = forged(&wide, |wide| wide.records.depth -= 1);
    assert!(matches!(load(&deeper), Err(LoadError::Depth { .. })));
    let wider = forged(&wide, |wide| wide.bounds.max[2] *= 2.0);
    assert!(matches!(load(&wider), Err(LoadError::Bounds { .. })));
    let longer = forged(&wide, |wide| wide.frame.rows[1][1] = 1.1);
    assert!(matches!(load(&longer), Err(LoadError::Flaw(Flaw::Row { line: None, .. }))));
    let priceless = forged(&wide, |wide| wide.wear.costs.leaf = f32::NAN);
    assert!(matches!(load(&priceless), Err(LoadError::Cost { .. })));
}

#[test]
fn the_header_is_as_long_as_the_table_says() {
    let bytes = build(&fixtures::soup(1, 10)).to_bytes();
    let header = Header::read(&bytes).unwrap();
    let mut written = vec![];
    header.write(&mut written);
    assert_eq!(written.len(), HEADER_BYTES);
    assert_eq!(written, bytes[..HEADER_BYTES]);
}
