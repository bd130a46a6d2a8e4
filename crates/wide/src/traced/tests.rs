//! What happens to rays that are not thickened.

use canted_fixtures::{Grazing, Mesh};
use canted_trace::{InstanceId, Ray, ScaledRay, Watertight};

use super::*;
use crate::answers::One;
use crate::simd::SimdPath;
use crate::{Config, LaneKernel, WideBvh};

/// A tree whose rays get pads of the test's choice.
struct Padded<'a, K: LaneKernel> {
    wide: &'a WideBvh<K>,
    pads: Pads,
}

impl<K: LaneKernel> Traced for Padded<'_, K> {
    type Prepared<S: Simd> = <WideBvh<K> as Traced>::Prepared<S>;
    type Met = <WideBvh<K> as Traced>::Met;

    fn records(&self) -> &Records {
        Traced::records(self.wide)
    }
    fn frame(&self) -> &MeshFrame {
        Traced::frame(self.wide)
    }
    fn reach(&self) -> f32 {
        Traced::reach(self.wide)
    }
    fn pads(&self) -> Pads {
        self.pads
    }
    #[inline(always)]
    fn prepare<S: Simd>(simd: S, ray: &ScaledRay) -> Self::Prepared<S> {
        WideBvh::<K>::prepare(simd, ray)
    }
    #[inline(always)]
    fn leaf<S: Simd, T: HitSink<Self::Met>>(
        &self,
        simd: S,
        prepared: &Self::Prepared<S>,
        ray: &ScaledRay,
        leaf: Leaf,
        take: &mut T,
    ) -> f32 {
        self.wide.leaf(simd, prepared, ray, leaf, take)
    }
}

/// How many rays get another hit than with the pads that are proven.
fn n_different(mesh: &Mesh, config: &Config, pads: Pads, path: SimdPath) -> usize {
    let wide = WideBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, config).expect("a valid mesh");
    let wide = wide.with_path(path);
    let padded = Padded { wide: &wide, pads };
    let rays = Grazing::ALL.into_iter().flat_map(|class| canted_fixtures::grazing(mesh, class, 2000, 1));
    rays.map(|ray| Ray::new(ray.origin, ray.direction))
        .filter(|ray| {
            let one = One::<_, _, true> { tree: &padded, ray, instance: InstanceId(0), query: &mut () };
            path.run(one) != wide.closest_hit(ray)
        })
        .count()
}

#[test]
fn rays_without_pads_lose_hits() {
    let none = Pads { aligned: 0.0, turned: 0.0, lean: 0.0 };
    let proven = Pads::of(canted_trace::HIT_ERROR);
    let straight = Config { oriented: false, rotate_mesh: false, ..Config::default() };
    let mesh = canted_fixtures::scaffold_of(1, true, 3);
    let flat = canted_fixtures::coplanar_quads(20).turned();
    for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
        for (name, mesh, config) in [
            ("box nodes", &flat, straight),
            ("lean nodes", &flat, Config::default()),
            ("struts", &mesh, Config::default()),
        ] {
            assert_eq!(n_different(mesh, &config, proven, path), 0, "{name}");
            let lost = n_different(mesh, &config, none, path);
            assert!(lost > 0, "{name}, {}: nothing is lost without pads", path.name());
        }
    }
}
