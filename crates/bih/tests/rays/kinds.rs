//! Every generated kind of scene.

use canted_bih::Config;
use canted_fixtures::kinds::{self, RayKind};
use canted_trace::{Ray, Watertight};

use crate::common::{build, config, loop_over_all, rays};

#[test]
fn every_kind_of_scene_agrees_with_the_loop() {
    for kind in kinds::all() {
        let scene = kind.generate(2_000, 11);
        let of_kinds = RayKind::ALL.into_iter().flat_map(|kind| scene.rays(kind, 40, 5));
        let of_kinds = of_kinds.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) });
        let mesh = &scene.meshes[0];
        let rays: Vec<Ray> = of_kinds.chain(rays(mesh, 8)).collect();
        let bihs = [Config::default(), config(1, 1.0)].map(|config| build::<Watertight>(mesh, &config));
        for ray in &rays {
            let want = loop_over_all::<Watertight>(mesh, ray).first().copied();
            for bih in &bihs {
                assert_eq!(bih.closest_hit(ray), want, "{}, {bih:?}, {ray:?}", kind.name);
                assert_eq!(bih.occluded(ray), want.is_some(), "{}, {bih:?}, {ray:?}", kind.name);
            }
        }
    }
}
