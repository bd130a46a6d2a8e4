//! No lost hit: the BVH returns the same bits as a loop over all triangles.
//!
//! Every strategy, with and without fallback, every kernel, rays through vertices and edges, in face planes, axis-parallel, from
//! far away. Not covered here: instances (`instances.rs`), pictures (`threads.rs`).

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, grazing};
use canted_lbvh::{Bits, Strategy, VolumeConfig};
use canted_tests::{brute, scenes};
use canted_trace::{BaldwinWeber, Counts, InstanceId, Kernel, MollerTrumbore, Ray, Watertight};

fn rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![Ray::new([0.0; 3], [1.0, 0.0, 0.0])];
    }
    let mut rays = vec![];
    for (class, seed) in Grazing::ALL.into_iter().zip(20..) {
        rays.extend(grazing(mesh, class, n, seed).into_iter().map(|ray| Ray {
            origin: ray.origin,
            direction: ray.direction,
            t_min: 0.0,
            t_max: ray.t_max,
        }));
    }
    // Signs of zero and powers of two in the direction's length must not matter.
    let variants: Vec<Ray> = rays
        .iter()
        .step_by(5)
        .map(|ray| Ray { direction: ray.direction.map(|d| if d == 0.0 { -0.0 } else { d * 2.0f32.powi(-40) }), ..*ray })
        .collect();
    rays.extend(variants);
    rays
}

fn agrees<K: Kernel>(name: &str, mesh: &Mesh, configs: &[VolumeConfig], n: usize) {
    let rays = rays(mesh, n);
    let records = brute::records::<K>(&mesh.positions, &mesh.triangles);
    let wants: Vec<_> = rays.iter().map(|ray| brute::closest_hit::<K>(&records, ray)).collect();
    for &volumes in configs {
        let config = BuildConfig { bits: Bits::B63, volumes };
        let blas = Bvh2::<K>::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        for (ray, want) in rays.iter().zip(&wants) {
            let got = blas.closest_hit(ray);
            assert_eq!(got, *want, "{name}, {volumes:?}, {ray:?}");
            assert_eq!(blas.occluded(ray), want.is_some(), "{name}, {volumes:?}, {ray:?}");
        }
    }
}

fn every_strategy() -> Vec<VolumeConfig> {
    Strategy::ALL
        .into_iter()
        .flat_map(|strategy| [true, false].map(|fallback| VolumeConfig { strategy, fallback }))
        .collect()
}

#[test]
fn watertight_loses_no_hit() {
    for case in scenes::cases() {
        agrees::<Watertight>(&case.name, &case.mesh, &every_strategy(), 40);
    }
}

#[test]
fn moller_trumbore_loses_no_hit() {
    for case in scenes::cases() {
        agrees::<MollerTrumbore>(&case.name, &case.mesh, &every_strategy(), 15);
    }
}

#[test]
fn baldwin_weber_loses_no_hit() {
    for case in scenes::cases() {
        agrees::<BaldwinWeber>(&case.name, &case.mesh, &every_strategy(), 15);
    }
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    let mesh = &scenes::shapes()[0].mesh;
    let config = BuildConfig {
        volumes: VolumeConfig { strategy: Strategy::Combined, fallback: true },
        ..BuildConfig::default()
    };
    let hits = |exponent: i32| -> Vec<_> {
        let scale = 2.0f32.powi(exponent);
        let positions: Vec<_> = mesh.positions.iter().map(|p| p.map(|x| x * scale)).collect();
        let blas = Bvh2::<Watertight>::build(&positions, &mesh.triangles, &config).unwrap();
        let scaled = |ray: &Ray| Ray { origin: ray.origin.map(|x| x * scale), ..*ray };
        let mut counts = Counts::default();
        let hits: Vec<_> = rays(mesh, 50)
            .iter()
            .map(|ray| {
                blas.closest_hit_with(&scaled(ray), InstanceId(0), &mut counts)
                    .map(|h| (h.t / scale, h.u, h.v, h.primitive))
            })
            .collect();
        assert!(hits.iter().flatten().count() > 100);
        hits
    };
    for exponent in [-40, -20, 20, 40] {
        assert_eq!(hits(exponent), hits(0), "2^{exponent}");
    }
}

#[test]
fn traversal_does_fewer_tests_than_the_loop() {
    let mesh = &scenes::shapes()[2].mesh;
    let blas = Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &BuildConfig::default()).unwrap();
    let rays = rays(mesh, 100);
    let (mut closest, mut any) = (Counts::default(), Counts::default());
    for ray in &rays {
        blas.closest_hit_with(ray, InstanceId(0), &mut closest);
        blas.occluded_with(ray, InstanceId(0), &mut any);
    }
    let all = (rays.len() * mesh.triangles.len()) as u64;
    assert!(closest.triangles * 10 < all, "{closest:?} of {all}");
    assert!(any.triangles <= closest.triangles, "{any:?} {closest:?}");
}
