//! Devices: test programs whose tests are reported as ignored without one, and a device's answers compared with the CPU's.
//!
//! Let `B` bound the distance of a device hit from its triangle in each coordinate. The device hits every triangle that the CPU
//! hits, at its own `t`: at both `t`, and so at all `t` between, the ray is within `B` of the triangle. So if the device's first
//! hit is later than the CPU's, it still lies within `B` of the CPU's triangle; and if there is none, the end of the ray's interval
//! lies between and does.

use std::process::ExitCode;

use canted_fixtures::device_tests::{self, Test};
use canted_gpu::{Choice, DeviceHit, Gpu, HIT_ERROR, Limits, Outcome, TracedScene, block_on};
use canted_trace::{Hit, Ray};

use crate::brute::{SQRT_3, distance};

pub use crate::brute::device_hit_error as error_of_instance;

/// Runs the tests of a program.
pub fn run_tests(tests: impl IntoIterator<Item = Vec<Test>>) -> ExitCode {
    device_tests::run(block_on(Gpu::open(&Choice::Best)), tests)
}

/// The best adapter.
///
/// # Panics
/// There is none.
#[must_use]
pub fn gpu() -> Gpu {
    block_on(Gpu::open(&Choice::Best)).unwrap_or_else(|error| panic!("{error}"))
}

/// The best adapter with storage bindings limited to this many bytes.
///
/// # Panics
/// There is none.
#[must_use]
pub fn lowered(most: u64) -> Gpu {
    let lower = |limits| Limits { max_storage_buffer_binding_size: most, ..limits };
    block_on(Gpu::with_limits(&Choice::Best, lower)).unwrap_or_else(|error| panic!("{error}"))
}

type Corners = [[f64; 3]; 3];

/// Triangle positions and error bounds.
pub struct World<'a> {
    /// World-space corners of a triangle of an instance.
    pub corners: &'a dyn Fn(u32, u32) -> Corners,
    /// `B` for a ray and an instance.
    pub error: &'a dyn Fn(&Ray, u32) -> f64,
}

/// Number of rays by kind of answer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// The same triangle.
    pub n_same: usize,
    /// Another triangle, within the bound.
    pub n_ties: usize,
    /// A hit only on the device, within the bound.
    pub n_besides: usize,
    /// A miss only on the device, at the end of the interval.
    pub n_at_ends: usize,
    /// A miss on both.
    pub n_missed: usize,
    /// No answer from the device.
    pub n_cut: usize,
    /// Greatest distance of a hit from its triangle, relative to the bound.
    pub off: f64,
}

fn greatest(v: [f32; 3]) -> f64 {
    v.iter().map(|x| f64::from(x.abs())).fold(0.0, f64::max)
}

/// `B` of a BVH over triangles in world space with coordinates of at most `reach`.
#[must_use]
pub fn error_of_one_level(ray: &Ray, reach: f64) -> f64 {
    f64::from(HIT_ERROR) * (greatest(ray.origin) + reach)
}

impl World<'_> {
    /// Distance of a point of the ray from a triangle, relative to the bound.
    fn off(&self, ray: &Ray, t: f32, instance: u32, primitive: u32) -> f64 {
        let off = distance(ray.at(f64::from(t)), (self.corners)(instance, primitive));
        off / (SQRT_3 * (self.error)(ray, instance))
    }

    fn is_on(&self, ray: &Ray, t: f32, instance: u32, primitive: u32) -> bool {
        self.off(ray, t, instance, primitive) <= 1.0
    }

    /// Compares the answers for a ray and counts them.
    ///
    /// # Errors
    /// A lost hit, or one beyond the bound.
    pub fn check(
        &self,
        ray: &Ray,
        cpu: Option<Hit>,
        device: Outcome<Option<DeviceHit>>,
        tally: &mut Tally,
    ) -> Result<(), String> {
        let Outcome::Complete(device) = device else {
            tally.n_cut += 1;
            return Ok(());
        };
        if let Some(hit) = device {
            if !(hit.t >= ray.t_min && hit.t <= ray.t_max) {
                return Err(format!("{ray:?} is hit outside of its interval: {hit:?}"));
            }
            let off = self.off(ray, hit.t, hit.instance, hit.primitive);
            if off.is_nan() || off > 1.0 {
                return Err(format!("{ray:?}: {hit:?} is off its triangle"));
            }
            tally.off = tally.off.max(off);
        }
        let Some(cpu) = cpu else {
            tally.n_besides += usize::from(device.is_some());
            tally.n_missed += usize::from(device.is_none());
            return Ok(());
        };
        let (instance, primitive) = (cpu.instance.0, cpu.primitive.0);
        let ends_on =
            || [ray.t_min, ray.t_max].iter().any(|t| t.is_finite() && self.is_on(ray, *t, instance, primitive));
        match device {
            Some(hit) if hit.t > cpu.t && !self.is_on(ray, hit.t, instance, primitive) && !ends_on() => {
                return Err(format!("{ray:?}: {cpu:?} is lost, {hit:?} behind it found"));
            }
            Some(hit) if (hit.instance, hit.primitive) == (instance, primitive) => tally.n_same += 1,
            Some(_) => tally.n_ties += 1,
            None if ends_on() => tally.n_at_ends += 1,
            None => return Err(format!("{ray:?}: {cpu:?} is lost")),
        }
        Ok(())
    }

    /// Traces all rays on the device, with both queries, and compares the answers with `on_cpu`.
    ///
    /// # Errors
    /// The first wrong answer, or an error of the device.
    pub fn check_all(
        &self,
        gpu: &Gpu,
        scene: &TracedScene,
        rays: &[Ray],
        on_cpu: impl Fn(&Ray) -> Option<Hit>,
        tally: &mut Tally,
    ) -> Result<(), String> {
        let expected: Vec<Option<Hit>> = rays.iter().map(on_cpu).collect();
        self.check_each(gpu, scene, rays, &expected, tally)
    }

    /// Checks the hits and occlusion of all rays, whose hits on the CPU are known.
    ///
    /// # Errors
    /// As for [`World::check_all`].
    pub fn check_each(
        &self,
        gpu: &Gpu,
        scene: &TracedScene,
        rays: &[Ray],
        expected: &[Option<Hit>],
        tally: &mut Tally,
    ) -> Result<(), String> {
        let hits = block_on(scene.closest_hits(gpu, rays)).map_err(|error| error.to_string())?;
        let occluded = block_on(scene.occluded(gpu, rays)).map_err(|error| error.to_string())?;
        assert_eq!([hits.len(), occluded.len(), expected.len()], [rays.len(); 3]);
        for (((ray, &on_cpu), hit), occluded) in rays.iter().zip(expected).zip(hits).zip(occluded) {
            self.check(ray, on_cpu, hit, tally)?;
            match (hit, occluded) {
                (Outcome::Complete(hit), Outcome::Complete(occluded)) if hit.is_some() != occluded => {
                    return Err(format!("{ray:?}: {hit:?}, and occluded is {occluded}"));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

impl Tally {
    /// Rays with a hit on both, among those that were answered.
    #[must_use]
    pub fn n_hits(&self) -> usize {
        self.n_same + self.n_ties
    }

    /// Prints the counts.
    ///
    /// # Panics
    /// Too little was tested.
    #[track_caller]
    #[expect(clippy::print_stderr, reason = "the share of ties is reported")]
    pub fn report(&self, name: &str) {
        eprintln!("{name}: {self:?}");
        assert!(self.n_hits() > 100 && self.n_missed > 0, "{name}: {self:?}");
        assert!(self.n_cut * 10 < self.n_hits(), "{name}: {self:?}");
    }
}
