//! Instances of wide BVHs: the same hits as a loop over all instances, each looping over all triangles.

use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tests::{
    brute,
    closed::{baked, placements},
    instances as oracle, rays, scenes,
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{MollerTrumbore, Ray, Watertight};
use canted_wide::{LaneKernel, TriangleBvh};

use super::setup::{build, few_variants, paths};

/// Every placement twice, alternating between the meshes.
fn placed() -> Vec<Affine> {
    placements().iter().flat_map(|placement| [placement.world_from_object; 2]).collect()
}

fn agrees<K: LaneKernel + Clone>() {
    let meshes = [scenes::needles().remove(0).mesh, scenes::room(3, 20).off_axis()];
    let placed = placed();
    let all_rays: Vec<Ray> = placed
        .iter()
        .zip(0..)
        .flat_map(|(affine, i)| rays::of_all_classes(&baked(&meshes[i % 2], affine), 12, 90 + i as u64))
        .collect();
    let records = meshes.each_ref().map(|mesh| brute::records::<K>(&mesh.positions, &mesh.triangles));
    let trace = |i: usize, ray: &Ray| brute::closest_hit::<K>(&records[i % 2], ray);
    let wants: Vec<_> = all_rays.iter().map(|ray| oracle::closest_hit(&placed, ray, trace)).collect();
    assert!(wants.iter().flatten().count() > 300, "too few rays hit");
    let instances: Vec<Instance> =
        placed.iter().zip([0, 1].into_iter().cycle()).map(|(&a, blas)| Instance::new(blas, a)).collect();
    for (variant, config) in few_variants() {
        for path in paths().0 {
            let bottom: Vec<TriangleBvh<K>> = meshes.iter().map(|mesh| build(mesh, &config).with_path(path)).collect();
            let binary = TopConfig::Binary(VolumeConfig { strategy: Strategy::Dop, fallback: true });
            for top in [TopConfig::Wide(config), binary] {
                let tlas = Tlas::new(bottom.clone(), &instances, top).unwrap();
                for (ray, want) in all_rays.iter().zip(&wants) {
                    let got = (tlas.closest_hit(ray), tlas.occluded(ray));
                    assert_eq!(got, (*want, want.is_some()), "{variant}, {}, {top:?}, {ray:?}", path.name());
                }
            }
        }
    }
}

#[test]
fn watertight_agrees_through_instances() {
    agrees::<Watertight>();
}

#[test]
fn moller_trumbore_agrees_through_instances() {
    agrees::<MollerTrumbore>();
}
