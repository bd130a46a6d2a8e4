//! Instances of kd-trees have the hits of instances of BVHs.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, SplitMix64, grazing, torus};
use canted_kdtree::{Config, KdTree, Traversal};
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Ray, Watertight};

#[test]
fn instances_of_kd_trees_have_the_hits_of_bvhs() {
    let mesh = torus(12, 9);
    let mut rng = SplitMix64::new(4);
    let instances: Vec<Instance> = (0..12)
        .map(|_| {
            #[expect(clippy::cast_possible_truncation, reason = "any numbers")]
            let columns = [0; 4].map(|_| [0; 3].map(|_| (rng.unit() * 4.0 - 2.0) as f32));
            Instance::new(0, Affine { columns })
        })
        .collect();
    let bvh = Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &BuildConfig::default()).unwrap();
    let of_bvhs = Tlas::new(vec![bvh], &instances, TopConfig::default()).unwrap();
    for traversal in [Traversal::Stack, Traversal::Ropes] {
        let config = Config { traversal, traversal_cost: 0.1, ..Config::default() };
        let tree = KdTree::<Watertight>::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        let of_trees = Tlas::new(vec![tree], &instances, TopConfig::default()).unwrap();
        let (mut n_hit, mut hits, mut want) = (0, vec![], vec![]);
        for ray in Grazing::ALL.into_iter().flat_map(|class| grazing(&mesh, class, 400, 8)) {
            let ray = Ray::new(ray.origin, ray.direction);
            of_trees.all_hits(&ray, &mut hits);
            of_bvhs.all_hits(&ray, &mut want);
            assert_eq!(hits, want, "{ray:?}");
            assert_eq!(of_trees.closest_hit(&ray), of_bvhs.closest_hit(&ray), "{ray:?}");
            assert_eq!(of_trees.occluded(&ray), !want.is_empty(), "{ray:?}");
            n_hit += usize::from(!want.is_empty());
        }
        assert!(n_hit > 500, "{n_hit} rays hit");
    }
}
