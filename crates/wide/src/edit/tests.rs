//! Links, and what finds a box that was not written.

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Intersect, Ray};

use super::tree::Tree;
use crate::node::{CacheLine, DecodedWord, Flaw};
use crate::{LoadError, WideBvh};

fn random_box(rng: &mut SplitMix64) -> Aabb {
    let (center, half) = (rng.signed3().map(|x| (10.0 * x) as f32), rng.signed3().map(|x| (0.5 * x.abs()) as f32));
    Aabb { min: [0, 1, 2].map(|k| center[k] - half[k]), max: [0, 1, 2].map(|k| center[k] + half[k]) }
}

fn boxes(n: usize, rng: &mut SplitMix64) -> Vec<Aabb> {
    (0..n).map(|_| random_box(rng)).collect()
}

/// Links as they are kept up to date equal those that a first change finds.
#[test]
fn links_are_kept_up_to_date() {
    let mut rng = SplitMix64::new(1);
    let mut bvh = WideBvh::over(boxes(400, &mut rng)).unwrap();
    for step in 0..600 {
        let id = PrimId(rng.below(bvh.n_primitives()) as u32);
        match step % 3 {
            0 => drop(bvh.insert(random_box(&mut rng)).unwrap()),
            1 => drop(bvh.remove(id).unwrap()),
            _ => drop(bvh.move_one(id, random_box(&mut rng)).unwrap()),
        }
        if step % 50 == 49 {
            let mut other = bvh.clone();
            other.nodes.links = None;
            Tree::open(&mut other).close();
            let (kept, found) = (bvh.nodes.links.as_ref().unwrap(), other.nodes.links.as_ref().unwrap());
            assert_eq!(kept.holders, found.holders);
            let is_used = |node: &usize| !kept.free_nodes.contains(&(*node as u32));
            for node in (0..kept.nodes.len()).filter(is_used) {
                assert_eq!(kept.nodes[node], found.nodes[node], "node {node}");
            }
            let sorted = |free: &[u32]| {
                let mut free = free.to_vec();
                free.sort_unstable();
                free
            };
            assert_eq!(sorted(&kept.free_nodes), sorted(&found.free_nodes));
            assert_eq!(sorted(&kept.free_places), sorted(&found.free_places));
            for (kept, found) in [(kept.area, found.area), (kept.weighted, found.weighted), (kept.visits, found.visits)]
            {
                assert!((kept.get() - found.get()).abs() <= 1e-9 * found.get(), "{kept:?} {found:?}");
            }
        }
    }
}

/// Records as they were before a change, in one of the nodes above it: loads report the box, and rays lose the hit.
#[test]
fn a_node_that_is_not_refitted_is_detected() {
    let mut rng = SplitMix64::new(2);
    let before = WideBvh::over(boxes(2000, &mut rng)).unwrap();
    let mut changed = before.clone();
    let far = Aabb { min: [30.0; 3], max: [31.0; 3] };
    // Within its node's neighbors no box above would change.
    let id = changed.insert(far).unwrap();
    let ray = Ray::new([30.5, 30.5, 100.0], [0.0, 0.0, -1.0]);
    assert_eq!(changed.closest_hit(&ray).map(|hit| (hit.t, hit.primitive)), Some((69.0, id)));
    assert!(WideBvh::<Aabb>::from_bytes(&changed.to_bytes()).is_ok());
    let links = changed.nodes.links.clone().unwrap();
    let mut node = links.nodes[links.holders[id.index()] as usize].parent;
    let mut n = 0;
    while node != crate::node::NO_NODE {
        let mut broken = changed.clone();
        let lines = 4 * node as usize..4 * node as usize + 3;
        // Its six rows of boxes.
        let old: Vec<CacheLine> = before.nodes.lines[lines.clone()].to_vec();
        assert_ne!(broken.nodes.lines[lines.clone()], old);
        broken.nodes.lines[lines].copy_from_slice(&old);
        let error = WideBvh::<Aabb>::from_bytes(&broken.to_bytes()).unwrap_err();
        assert!(matches!(error, LoadError::Flaw(Flaw::Box { .. })), "{error}");
        assert_eq!(broken.closest_hit(&ray), None);
        node = links.nodes[node as usize].parent;
        n += 1;
    }
    assert!(n > 0 && matches!(changed.nodes.root.kind(), DecodedWord::Node(..)), "{n}");
}
