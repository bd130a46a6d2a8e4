//! tinybvh's eight-wide BVH, which its bindings offer if the compiler may assume AVX2.
//!
//! The library may crash; a trial in a separate process checks each scene first.

use std::{
    env,
    process::{Command, Stdio},
};

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Ray, Side};
use tinybvh_rs::{INFINITE, Intersector, bvh, bvh8_cpu, mbvh};

use super::engine::{Engine, Entry, Owner, Promise};
use crate::{
    models,
    options::{self, Options},
};

/// Primitives a leaf may hold in the wide layout.
const MAX_LEAF: u32 = 4;

struct Tiny(bvh8_cpu::BVH);

impl Tiny {
    fn build(mesh: &Mesh) -> Result<Self> {
        let corner = |&i: &u32| {
            let [x, y, z] = mesh.positions[i as usize];
            [x, y, z, 0.0]
        };
        let corners: Vec<[f32; 4]> = mesh.triangles.iter().flatten().map(corner).collect();
        let complain = |error: tinybvh_rs::Error| anyhow::anyhow!("tinybvh: {error}");
        let mut binary = bvh::BVH::new_hq(corners.as_slice().into()).map_err(complain)?;
        binary.split_leaves(MAX_LEAF);
        let shallow = mbvh::BVH::new(&binary);
        Ok(Self(bvh8_cpu::BVH::new(&shallow).map_err(complain)?))
    }

    /// Their nearest hit before the ray's end.
    #[inline]
    fn hit(&self, ray: &Ray) -> Option<tinybvh_rs::Intersection> {
        let t_max = ray.t_max.min(INFINITE);
        let mut theirs = PaddedRay {
            ray: tinybvh_rs::Ray {
                origin: ray.origin,
                dir: ray.direction,
                r_d: ray.direction.map(reciprocal),
                hit: tinybvh_rs::Intersection { t: t_max, ..Default::default() },
                ..Default::default()
            },
            _beyond: [0; 64],
        };
        self.0.intersect(&mut theirs.ray);
        (theirs.ray.hit.t < t_max).then_some(theirs.ray.hit)
    }
}

/// A ray with the size and alignment of the library's own ray.
///
/// The bindings' ray (0.1.0-beta.3) is half as long, and their `Ray::new` lets the library clear its full length: it
/// overwrites 64 bytes of the caller's stack. So the fields are filled here, with the direction's length kept so that
/// `t` keeps its unit.
#[repr(C, align(64))]
struct PaddedRay {
    ray: tinybvh_rs::Ray,
    _beyond: [u8; 64],
}

/// The reciprocal as the library computes it, finite for zero components.
fn reciprocal(x: f32) -> f32 {
    if x.abs() > 1e-12 { 1.0 / x } else { INFINITE }
}

impl Engine for Tiny {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, out) in rays.iter().zip(hits) {
            *out = self.hit(ray).map(|hit| Hit {
                t: hit.t,
                u: hit.u,
                v: hit.v,
                primitive: PrimId(hit.prim),
                instance: InstanceId(0),
                side: Side::Front,
            });
        }
    }

    /// The bindings lack the any-hit query: the closest hit before the ray's end replaces it.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, out) in rays.iter().zip(occluded) {
            *out = self.hit(ray).is_some();
        }
    }
}

/// The BVH, if its trial on this scene succeeds.
pub(crate) fn entry<'a>(scene: &str, mesh: &'a Mesh) -> Option<Entry<'a>> {
    survives(scene).then(|| Entry {
        name: "tinybvh BVH8".to_owned(),
        owner: Owner::Peer,
        promise: Promise::Fast,
        is_placed: false,
        is_parallel: false,
        build: Box::new(|_| Ok(Box::new(Tiny::build(mesh)?))),
    })
}

/// Runs the trial in a new process of this program.
fn survives(scene: &str) -> bool {
    let Ok(program) = env::current_exe() else { return false };
    let mut command = Command::new(program);
    command.args([options::TRIAL, "--scenes", scene]).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Traces camera rays and rays from their hits; returning means that nothing crashed.
pub(crate) fn trial(options: &Options) -> Result<()> {
    for name in options.scenes(&[]) {
        let Some(model) = models::load(&name)? else { continue };
        let tiny = Tiny::build(&model.mesh)?;
        let camera = models::camera(&model, canted_fixtures::RESOLUTION);
        let mut hits = vec![None; camera.len()];
        tiny.closest(&camera, &mut hits);
        for rays in models::secondary(&model, &camera, &hits) {
            tiny.closest(&rays, &mut hits[..rays.len()]);
        }
    }
    Ok(())
}
