//! Moved instances rebuild only the top level.

use std::sync::atomic::{AtomicUsize, Ordering};

use canted_bvh2::Bvh2;
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, Obb};
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Query, Ray, Watertight};

use super::setup::{all_rays, build, crowd, instances, meshes};

/// A bottom level that counts calls; `set_instances` has no way to rebuild it.
struct Counted {
    inner: Bvh2<Watertight>,
    n_bounds: AtomicUsize,
    n_rays: AtomicUsize,
}

impl Counted {
    fn new(inner: Bvh2<Watertight>) -> Self {
        Self { inner, n_bounds: AtomicUsize::new(0), n_rays: AtomicUsize::new(0) }
    }

    /// Calls since the last take: for bounds, for rays.
    fn take(&self) -> (usize, usize) {
        (self.n_bounds.swap(0, Ordering::Relaxed), self.n_rays.swap(0, Ordering::Relaxed))
    }
}

impl Blas for Counted {
    fn bounds(&self) -> Obb {
        self.n_bounds.fetch_add(1, Ordering::Relaxed);
        self.inner.bounds()
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.n_rays.fetch_add(1, Ordering::Relaxed);
        self.inner.closest_hit_with(ray_object, instance, query)
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.n_rays.fetch_add(1, Ordering::Relaxed);
        self.inner.occluded_with(ray_object, instance, query)
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        self.n_rays.fetch_add(1, Ordering::Relaxed);
        self.inner.all_hits_with(ray_object, instance, query, hits);
    }
}

const TOP: TopConfig = TopConfig::Binary(VolumeConfig { strategy: Strategy::Dop, fallback: true });

fn tlas(instances: &[Instance]) -> Tlas<Counted> {
    let [soup, torus] = meshes();
    let bottom = vec![Counted::new(build(&soup, Strategy::Dop)), Counted::new(build(&torus, Strategy::Combined))];
    Tlas::new(bottom, instances, TOP).unwrap()
}

fn hits(tlas: &Tlas<Counted>, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tlas.closest_hit(ray)).collect()
}

/// All instances rotated by a quarter turn about z and shifted.
fn moved(placed: &[Affine]) -> Vec<Affine> {
    let turn = |[x, y, z]: [f32; 3]| [-y, x, z];
    let shift = |[x, y, z]: [f32; 3]| [x + 0.5, y - 0.25, z + 1.0];
    placed
        .iter()
        .map(|affine| {
            let [x, y, z, origin] = affine.columns.map(turn);
            Affine { columns: [x, y, z, shift(origin)] }
        })
        .collect()
}

#[test]
fn set_instances_queries_each_bound_once_and_traces_nothing() {
    let placed = crowd();
    let mut tlas = tlas(&instances(&placed));
    let asked = |tlas: &Tlas<Counted>| tlas.blas().iter().map(Counted::take).collect::<Vec<_>>();
    assert_eq!(asked(&tlas), [(placed.len() / 2, 0); 2]);
    let before: Vec<*const Counted> = tlas.blas().iter().map(std::ptr::from_ref).collect();
    tlas.set_instances(&instances(&moved(&placed))).unwrap();
    assert_eq!(asked(&tlas), [(placed.len() / 2, 0); 2]);
    assert_eq!(tlas.blas().iter().map(std::ptr::from_ref).collect::<Vec<_>>(), before);
    // The counters work.
    hits(&tlas, &all_rays(&moved(&placed), 1));
    assert!(asked(&tlas).iter().all(|&(n_bounds, n_rays)| n_bounds == 0 && n_rays > 100));
}

#[test]
fn moved_instances_equal_a_fresh_build() {
    let placed = crowd();
    let after = moved(&placed);
    let rays = [all_rays(&placed, 5), all_rays(&after, 5)].concat();
    let mut tlas_moved = tlas(&instances(&placed));
    let before = hits(&tlas_moved, &rays);
    tlas_moved.set_instances(&instances(&after)).unwrap();
    let fresh = hits(&tlas(&instances(&after)), &rays);
    assert_eq!(hits(&tlas_moved, &rays), fresh);
    assert_ne!(before, fresh);
    // Fewer instances, then none, then all again.
    tlas_moved.set_instances(&instances(&placed[..3])).unwrap();
    assert_eq!(hits(&tlas_moved, &rays), hits(&tlas(&instances(&placed[..3])), &rays));
    tlas_moved.set_instances(&[]).unwrap();
    assert_eq!((tlas_moved.n_instances(), hits(&tlas_moved, &rays)), (0, vec![None; rays.len()]));
    tlas_moved.set_instances(&instances(&placed)).unwrap();
    assert_eq!(hits(&tlas_moved, &rays), before);
}

#[test]
fn rejected_instances_leave_the_old_ones() {
    let placed = crowd();
    let rays = all_rays(&placed, 2);
    let mut tlas = tlas(&instances(&placed));
    let before = hits(&tlas, &rays);
    let mut bad = instances(&moved(&placed));
    bad[9].world_from_object.columns[0] = [0.0; 3];
    assert!(tlas.set_instances(&bad).is_err());
    assert_eq!((tlas.n_instances(), hits(&tlas, &rays)), (placed.len(), before));
}
