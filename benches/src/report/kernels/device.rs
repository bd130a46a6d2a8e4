//! Single tests on a device: triangles and nodes with the code of the traversal, without the traversal.

use anyhow::{Result, ensure};
use canted_gpu::{AdapterKind, Choice, DeviceRay, Gpu, SceneInput, TracedScene, Variant};
use canted_trace::{Ray, ScaledRay};
use canted_wide::TriangleBvh;

use super::contest::{Answer, LANES, Tested};
use crate::report::{model::Effort, samples::Samples};

/// The miss marker of the kernels.
const NONE: u32 = u32::MAX;

/// Bits of an entry that contain the box index; clearing them makes entries slightly earlier.
const BOX_BITS: u32 = 7;

/// A device and the number of rays per dispatch.
pub(super) struct Device {
    pub(super) gpu: Gpu,
    n_rays: usize,
}

impl Device {
    /// Opens the best device; otherwise adds the reason to `skipped`.
    pub(super) fn open(effort: Effort, skipped: &mut Vec<String>) -> Option<Self> {
        match Gpu::open(&Choice::Best) {
            Ok(gpu) => {
                // Enough to occupy a device without taking too long on a software driver.
                let n_rays = if gpu.info().kind == AdapterKind::Software { 1 << 16 } else { 1 << 20 };
                Some(Self { gpu, n_rays: effort.pick(1 << 10, n_rays, n_rays) })
            }
            Err(error) => {
                skipped.push(format!("the device: {error}"));
                None
            }
        }
    }

    pub(super) fn name(&self) -> String {
        format!("device: {}", self.gpu.info().name)
    }

    /// A table title with the name of the device.
    pub(super) fn titled(title: &str, device: Option<&Self>) -> String {
        device.map_or_else(|| title.to_owned(), |device| format!("{title}; the device is {}", device.gpu.info().name))
    }

    /// Each ray and the only triangle of its tree.
    pub(super) fn triangles(&self, trees: &[TriangleBvh], rays: &[Ray], rounds: usize) -> Result<Tested<Answer>> {
        ensure!(trees.iter().all(|tree| tree.sizes().depth == 0), "a BVH of one triangle has a node");
        let (hits, ns) = self.tested(("check/triangle", "hits"), trees, rays, rounds)?;
        let answer = |(ray, &[t, u, v, primitive, _]): (&Ray, &[u32; 5])| {
            let ray = ScaledRay::new(ray).filter(|_| primitive != NONE)?;
            Some([ray.caller_t(f32::from_bits(t)), f32::from_bits(u), f32::from_bits(v)])
        };
        Ok(Tested { name: "device".to_owned(), answers: rays.iter().zip(&hits).map(answer).collect(), ns })
    }

    /// Each ray and the eight equal boxes of its tree's only node.
    pub(super) fn boxes(&self, trees: &[TriangleBvh], rays: &[Ray], rounds: usize) -> Result<Tested<Option<f32>>> {
        ensure!(trees.iter().all(|tree| tree.sizes().nodes == [1, 0]), "a BVH of eight boxes is not one node");
        let (entries, ns) = self.tested(("check/node", "entries"), trees, rays, rounds)?;
        let answer = |(ray, &[entry]): (&Ray, &[u32; 1])| {
            let ray = ScaledRay::new(ray).filter(|_| entry != NONE)?;
            Some(ray.caller_t(f32::from_bits(entry & !BOX_BITS)))
        };
        #[expect(clippy::cast_precision_loss, reason = "eight")]
        let each = ns.scaled(1.0 / LANES as f64);
        let name = format!("its axis-aligned box, device, of {LANES}");
        Ok(Tested { name, answers: rays.iter().zip(&entries).map(answer).collect(), ns: each })
    }

    /// The output of a kernel for each ray and its BVH, and nanoseconds per test by the device's own clock if it has
    /// one.
    fn tested<const N: usize>(
        &self,
        (name, into): (&str, &str),
        trees: &[TriangleBvh],
        rays: &[Ray],
        rounds: usize,
    ) -> Result<(Vec<[u32; N]>, Samples)> {
        let gpu = &self.gpu;
        let scene = TracedScene::new(gpu, SceneInput::upload(trees).instances(&[]))?;
        let chosen = Variant::none().part("mask", "shared/mask/none").part("count", "shared/count/none");
        let kernel = gpu.kernel(name, &scene.specialize(chosen).of_kernel(name)?)?;
        let own: Vec<DeviceRay> = rays.iter().filter_map(ScaledRay::new).map(|ray| DeviceRay::scaled(&ray)).collect();
        ensure!(own.len() == trees.len() && !own.is_empty(), "{} rays of {} BVHs", own.len(), trees.len());
        // Multiples of the number of BVHs, so that every ray has its own.
        let all = gpu.buffer("rays", &own.repeat(self.n_rays.div_ceil(own.len())))?;
        let answers = gpu.zeroed::<[u32; N]>("answers", all.len())?;
        let mut bound = scene.bindings();
        bound.push(("rays", &all));
        bound.push((into, &answers));
        #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
        let to_ns = 1.0 / all.len() as f64;
        let mut ns = vec![];
        // The driver compiles in round 0.
        for round in 0..=rounds {
            let mut commands = gpu.timed_commands();
            commands.dispatch(&kernel, &bound, kernel.groups(u32::try_from(all.len())?))?;
            let (times, wall) = crate::timing::time(|| commands.times());
            let passes = times?;
            let on_device = passes.iter().map(|pass| pass.milliseconds * 1e6).sum::<f64>();
            if round > 0 {
                ns.push(to_ns * if passes.is_empty() { wall.wall * 1e9 } else { on_device });
            }
        }
        Ok((gpu.read_first(&answers, own.len())?, ns.into()))
    }
}

#[cfg(test)]
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
mod tests {
    use canted_trace::Ray;

    use super::*;
    use crate::report::kernels::lanes;

    /// A device whose dispatches contain every ray several times.
    fn device(test: &str) -> Option<Device> {
        let mut skipped = vec![];
        let device = Device::open(Effort::Tiny, &mut skipped);
        skipped.iter().for_each(|reason| eprintln!("skipped {test}: {reason}"));
        device.map(|device| Device { n_rays: 100, ..device })
    }

    /// Rays along z, each covered by one triangle or box only.
    fn rays() -> Vec<Ray> {
        [0.25, 10.25, 20.25, 5.0].map(|x| Ray::new([x, 0.25, 0.0], [0.0, 0.0, 0.5])).into()
    }

    const LOW: [f32; 4] = [0.0, 10.0, 20.0, 30.0];

    #[test]
    fn a_device_tests_each_ray_with_its_own_triangle() {
        let Some(device) = device("a_device_tests_each_ray_with_its_own_triangle") else { return };
        let corners = LOW.map(|x| [[x, 0.0, 1.0 + x], [x + 1.0, 0.0, 1.0 + x], [x, 1.0, 1.0 + x]]);
        let trees = lanes::singles(&corners).unwrap();
        let Tested { answers, ns, .. } = device.triangles(&trees, &rays(), 2).unwrap();
        for (i, answer) in answers.iter().enumerate() {
            let near = |found: &[f32; 3]| {
                let wanted = [2.0 + 2.0 * LOW[i], 0.25, 0.25];
                found.iter().zip(wanted).all(|(x, wanted)| (x - wanted).abs() < 1e-4)
            };
            assert_eq!(answer.as_ref().map(near), (i < 3).then_some(true), "{i}: {answer:?}");
        }
        assert!(ns.values().len() == 2 && ns.range()[0] > 0.0, "{ns:?}");
    }

    #[test]
    fn a_device_tests_each_ray_with_its_own_boxes() {
        let Some(device) = device("a_device_tests_each_ray_with_its_own_boxes") else { return };
        let boxes = LOW.map(|x| canted_obb::Aabb { min: [x, 0.0, 1.0 + x], max: [x + 1.0, 1.0, 2.0 + x] });
        let trees = lanes::of_equal(&boxes).unwrap();
        let Tested { answers, .. } = device.boxes(&trees, &rays(), 1).unwrap();
        for (i, answer) in answers.iter().enumerate() {
            let wanted = 2.0 + 2.0 * LOW[i];
            // Early by the padding and by the bits of the box index.
            let near = |found: f32| found <= wanted && found > wanted - 1e-2;
            assert_eq!(answer.map(near), (i < 3).then_some(true), "{i}: {answer:?}");
        }
    }
}
