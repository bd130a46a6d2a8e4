//! Rays without pads lose hits: the tests for lost hits can fail.

use canted_fixtures::{Grazing, Mesh};
use canted_trace::{InstanceId, Ray, ScaledRay};

use super::*;
use crate::sink::BestHit;
use crate::{Config, SimdPath, TriangleBvh};

/// The closest hit with pads of the test's choice.
struct Padded<'a> {
    bvh: &'a TriangleBvh,
    pads: Pads,
    ray: &'a Ray,
}

impl Task for Padded<'_> {
    type Output = Option<canted_trace::Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Self::Output {
        let ray = ScaledRay::new(self.ray)?;
        let (query, stack) = (&mut (), &mut Stack::new(self.bvh.nodes.depth));
        let mut best = BestHit::new(query, InstanceId(0));
        let ray = prepare_padded(self.bvh, self.pads, ray);
        trace(simd, self.bvh, &ray, stack, &mut best);
        best.hit(&ray.scaled)
    }
}

/// How many rays get another hit than with the proven pads.
fn n_different(mesh: &Mesh, config: &Config, pads: Pads, path: SimdPath) -> usize {
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles, config).expect("a valid mesh").with_path(path);
    let rays = Grazing::ALL.into_iter().flat_map(|class| canted_fixtures::grazing(mesh, class, 2000, 1));
    rays.map(|ray| Ray::new(ray.origin, ray.direction))
        .filter(|ray| path.run(Padded { bvh: &bvh, pads, ray }) != bvh.closest_hit(ray))
        .count()
}

#[test]
fn rays_without_pads_lose_hits() {
    let none = Pads { aligned: 0.0, rotated: 0.0, oriented: 0.0 };
    let proven = Pads::of(canted_trace::HIT_ERROR);
    let mesh = canted_fixtures::scaffold_of(1, true, 3);
    let flat = canted_fixtures::coplanar_quads(20).off_axis();
    for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
        for (name, mesh, config) in [
            ("aligned nodes", &flat, Config::default().axis_aligned()),
            ("oriented nodes", &flat, Config::default()),
            ("struts", &mesh, Config::default()),
        ] {
            assert_eq!(n_different(mesh, &config, proven, path), 0, "{name}");
            let lost = n_different(mesh, &config, none, path);
            assert!(lost > 0, "{name}, {}: no hit is lost without pads", path.name());
        }
    }
}
