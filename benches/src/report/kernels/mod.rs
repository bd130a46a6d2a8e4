//! Kernels: errors of `t`, `u`, `v` and wrong answers compared with exact fractions, and the cost of a test.

mod boxes;
mod lanes;
mod segments;
mod triangles;
mod whole;

use anyhow::{Result, ensure};
use canted_gpu::{
    AdapterKind, Choice, DeviceRay, Gpu, Options, ShaderName, Source, TracedScene, Variant, block_on, choice, wgsl,
};
use canted_tests::exact::Piercing;
use canted_trace::{Ray, ScaledRay};
use canted_wide::TriangleBvh;

use crate::{
    report::{
        model::{Chapter, Effort},
        samples::Samples,
    },
    timing::{self, Contender},
};

pub(super) use canted_tests::extremes::triangle::Pair;
use canted_tests::extremes::triangle::cases;

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let title = "Kernels: errors and wrong answers compared with exact fractions";
    let mut chapter = Chapter { id: "kernels", title, ..Chapter::default() };
    let rounds = effort.pick(2, 7, 15);
    let (_, missing) = lanes::paths();
    chapter.skipped =
        missing.iter().map(|path| format!("the path {}, which this machine lacks", path.name())).collect();
    chapter.skipped.push(ORIENTED_NODES.to_owned());
    let device = Device::open(effort, &mut chapter.skipped);
    let triangles::Found { tables, plots, says } = triangles::measure(effort, rounds, device.as_ref())?;
    chapter.tables.extend(tables);
    chapter.plots.extend(plots);
    let of_boxes = boxes::measure(effort.pick(1, 6, 6), rounds, device.as_ref())?;
    chapter.tables.push(of_boxes.table);
    chapter.plots.extend(of_boxes.plots);
    chapter.tables.push(lanes::measure(effort, rounds, device.as_ref())?);
    let pairs: Vec<Pair> = cases(effort.pick(1, 10, 10)).into_iter().flat_map(|(_, pairs)| pairs).collect();
    let pairs: Vec<Pair> = pairs.into_iter().filter(|(ray, _)| ScaledRay::new(ray).is_some()).collect();
    let (table, of_all) = whole::measure(&pairs, rounds, device.as_ref())?;
    chapter.tables.push(table);
    let (table, of_segments) = segments::measure(effort.pick(1, 6, 6), rounds)?;
    chapter.tables.push(table);
    chapter.set_sentences(says.into_iter().chain(of_boxes.says).chain([of_all, of_segments]));
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

/// A case without a public function.
const ORIENTED_NODES: &str = "oriented boxes eight at a time, on paths and on devices: only triangle BVHs have oriented nodes, \
    chosen by cost; the chapters on hierarchies and unused features measure such BVHs";

const METHOD: [&str; 8] = [
    "The truth is the exact solution in fractions for the bits of the ray and the triangle. An answer is wrong if it is a hit and \
     the truth is a miss, or the reverse; triangles are closed, so rays through an edge are hits. The error of t is in units in the \
     last place of the true value, that of u and v in units of 2^-24. An f32 kernel cannot be right for all such rays: near an edge \
     the shear of the watertight kernel moves vertices by a few roundings, equally for all neighbors, so nothing leaks. The chapter \
     on extremes lists the promises. If t is nearly zero, as with an origin on the triangle, its units are so small that their \
     number means little.",
    "Times are of one thread, one test after another; triangle records and per-ray values are computed before. All tests on the \
     processor run in turn, round by round, after a warm-up. Points are medians, bars reach from minimum to maximum.",
    "'Möller, Trumbore', 'Baldwin, Weber' and 'projected' are ours: each has its own f32 filter, and all share the exact f64 test of what passes \
     it. So their errors and answers are the same, and only their times differ.",
    "Paths test eight triangles or boxes at once. Their answers are of BVHs of one triangle each, asserted to equal the single \
     watertight test bit for bit; their times are of rays through leaves of 32 triangles of the case, divided by 32, including the \
     preparation of the ray. Boxes are in nodes of eight boxes of the case: the test only reports whether a ray enters its box, and \
     the scalar path may differ from others by one rounding of a product and a sum.",
    "On a device each ray has its own BVH: a leaf of one triangle, or a node of eight equal boxes, tested by the code of the \
     traversal alone. WGSL does not guarantee rounding to nearest, so a device hits whatever the processor hits and everything \
     within a stated bound of it (`shared/triangle.wgsl`): rays that miss an edge, a vertex or a sliver by less are wrong hits. Some \
     rays that begin within that bound of a triangle, or run in its plane, are wrong misses; numbers below 4e-36 may flush to zero. \
     Times are by the device's own clock if it has one, with enough rays to occupy all units: they measure throughput, not latency. \
     A software driver uses all processor threads.",
    "Each box test is compared with the truth of its own box, oriented or axis-aligned. 'lost' are rays that hit the box but are \
     reported as misses, which must never happen; 'enters' are rays that miss the box but enter it because of its padding. Most \
     cases aim at the box, so that misses are within a rounding; the last three pass an oriented box at a distance. The error of an \
     entry is that of `t` for rays that begin outside; ours enter early by their padding.",
    "The table of one core and all cores has the pairs of all cases, each thread its own loops over all of them, in wall time, which other processes affect. \
     The numbers with transfer are of one upload of all rays, one dispatch and one download of all hits. Segments are those rays towards a box whose ends and \
     their difference single precision holds exactly, so that both tests have the same truth.",
    "The table of one leaf measures complete calls: on a device they include uploading rays and downloading hits.",
];

/// What a logarithmic axis shows for zero error.
pub(super) const LEAST_ULPS: f64 = 1e-3;

/// Boxes of a node.
pub(super) const LANES: usize = 8;

/// Minimum tests per round: a few hundred take microseconds, close to the clock's resolution.
const LEAST_TESTS: usize = 20_000;

/// A method that tests all pairs of a case.
pub(super) struct Test<'a, A> {
    pub(super) name: String,
    /// The answer for each pair.
    pub(super) answers: Vec<A>,
    /// The timed repetition of the tests.
    pub(super) work: Box<dyn Fn() + 'a>,
    /// Number of tests in `work`.
    pub(super) n_tests: usize,
}

/// A timed method.
pub(super) struct Tested<A> {
    pub(super) name: String,
    pub(super) answers: Vec<A>,
    /// Nanoseconds per test.
    pub(super) ns: Samples,
    /// The same with uploads and downloads, on a device.
    pub(super) with_transfer: Option<Samples>,
}

/// Times all after a warm-up, in turn.
pub(super) fn run<A>(tests: Vec<Test<'_, A>>, rounds: usize) -> Vec<Tested<A>> {
    let repeats = |n_tests: usize| LEAST_TESTS.div_ceil(n_tests.max(1));
    let contenders = tests.iter().map(|test| {
        let n = repeats(test.n_tests);
        Contender::new(&*test.name, move || (0..n).for_each(|_| (test.work)()))
    });
    let timings = timing::run(rounds, contenders.collect());
    let tested = |(test, timing): (Test<'_, A>, timing::Timing)| {
        let to_ns = 1e9 / (repeats(test.n_tests) * test.n_tests.max(1)) as f64;
        let ns = Samples::from(timing.seconds).scaled(to_ns);
        Tested { name: test.name, answers: test.answers, ns, with_transfer: None }
    };
    tests.into_iter().zip(timings).map(tested).collect()
}

/// `t`, `u`, `v` of a hit; unreported weights are NaN.
pub(super) type Answer = Option<[f32; 3]>;

/// Where the ray intersects the triangle's plane, and whether that point is in the triangle.
pub(super) struct ExactHit {
    piercing: Option<Piercing>,
    is_hit: bool,
}

impl ExactHit {
    pub(super) fn of((ray, corners): &Pair) -> Self {
        let piercing = Piercing::of(ray, *corners);
        let is_hit = piercing.as_ref().is_some_and(|piercing| piercing.is_hit(ray));
        Self { piercing, is_hit }
    }
}

/// The results of one kernel.
pub(super) struct Accuracy {
    /// Error of `t` of each true hit.
    pub(super) t_ulps: Samples,
    /// The greater error of `u` and `v` of each hit.
    pub(super) uv_ulps: Samples,
    /// Share of rays that only the kernel hits.
    pub(super) wrong_hits: f64,
    /// Share of rays that only the kernel misses.
    pub(super) wrong_misses: f64,
}

impl Accuracy {
    pub(super) fn of(truths: &[ExactHit], answers: &[Answer]) -> Self {
        let (mut t, mut uv) = (vec![], vec![]);
        let (mut wrong_hits, mut wrong_misses) = (0usize, 0usize);
        for (truth, answer) in truths.iter().zip(answers) {
            match (truth.is_hit, answer) {
                (false, Some(_)) => wrong_hits += 1,
                (true, None) => wrong_misses += 1,
                (true, &Some([t_found, u, v])) => {
                    let Some(piercing) = &truth.piercing else { continue };
                    let has_weights = u.is_finite() && v.is_finite();
                    let [of_t, of_u, of_v] =
                        piercing.error_ulps(if has_weights { [t_found, u, v] } else { [t_found, 0.0, 0.0] });
                    t.push(of_t);
                    uv.extend(has_weights.then_some(of_u.max(of_v)));
                }
                (false, None) => {}
            }
        }
        let share = |count: usize| count as f64 / truths.len().max(1) as f64;
        let (wrong_hits, wrong_misses) = (share(wrong_hits), share(wrong_misses));
        Self { t_ulps: t.into(), uv_ulps: uv.into(), wrong_hits, wrong_misses }
    }
}

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
        match block_on(Gpu::open(&Choice::Best)) {
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
        let (hits, ns, with_transfer) = self.tested((wgsl::check::TRIANGLE, "hits"), trees, rays, rounds)?;
        let answer = |(ray, &[t, u, v, primitive, _]): (&Ray, &[u32; 5])| {
            let ray = ScaledRay::new(ray).filter(|_| primitive != NONE)?;
            Some([ray.caller_t(f32::from_bits(t)), f32::from_bits(u), f32::from_bits(v)])
        };
        Ok(Tested {
            name: "device".to_owned(),
            answers: rays.iter().zip(&hits).map(answer).collect(),
            ns,
            with_transfer: Some(with_transfer),
        })
    }

    /// Each ray and the eight equal boxes of its tree's only node.
    pub(super) fn boxes(&self, trees: &[TriangleBvh], rays: &[Ray], rounds: usize) -> Result<Tested<Option<f32>>> {
        ensure!(trees.iter().all(|tree| tree.sizes().nodes == [1, 0]), "a BVH of eight boxes is not one node");
        let (entries, ns, _) = self.tested((wgsl::check::NODE, "entries"), trees, rays, rounds)?;
        let answer = |(ray, &[entry]): (&Ray, &[u32; 1])| {
            let ray = ScaledRay::new(ray).filter(|_| entry != NONE)?;
            Some(ray.caller_t(f32::from_bits(entry & !BOX_BITS)))
        };
        let each = ns.scaled(1.0 / LANES as f64);
        let name = format!("its axis-aligned box, device, of {LANES}");
        Ok(Tested { name, answers: rays.iter().zip(&entries).map(answer).collect(), ns: each, with_transfer: None })
    }

    /// The output of a kernel for each ray and its BVH, and nanoseconds per test by the device's own clock if it has
    /// one.
    fn tested<const N: usize>(
        &self,
        (name, into): (ShaderName, &str),
        trees: &[TriangleBvh],
        rays: &[Ray],
        rounds: usize,
    ) -> Result<(Vec<[u32; N]>, Samples, Samples)> {
        let gpu = &self.gpu;
        let scene = block_on(TracedScene::new(gpu, Source::tlas(trees, &[]), Options::default()))?;
        let chosen = Variant::none().with(choice::Mask::None).with(choice::Count::None);
        let kernel = gpu.kernel(name, &scene.specialize(chosen).of_kernel(name)?)?;
        let own: Vec<DeviceRay> = rays.iter().filter_map(ScaledRay::new).map(|ray| DeviceRay::scaled(&ray)).collect();
        ensure!(own.len() == trees.len() && !own.is_empty(), "{} rays of {} BVHs", own.len(), trees.len());
        // Multiples of the number of BVHs, so that every ray has its own.
        let repeated = own.repeat(self.n_rays.div_ceil(own.len()));
        let all = gpu.buffer("rays", &repeated)?;
        let answers = gpu.zeroed::<[u32; N]>("answers", all.len())?;
        let mut bound = scene.bindings();
        bound.push(("rays", &all));
        bound.push((into, &answers));
        let to_ns = 1.0 / all.len() as f64;
        let (mut ns, mut with_transfer) = (vec![], vec![]);
        // The driver compiles in round 0.
        for round in 0..=rounds {
            let mut commands = gpu.timed_commands();
            commands.dispatch(&kernel, &bound, kernel.groups(u32::try_from(all.len())?))?;
            let (times, wall) = crate::timing::time(|| commands.times());
            let passes = block_on(times)?;
            let on_device = passes.iter().map(|pass| pass.milliseconds * 1e6).sum::<f64>();
            if round > 0 {
                ns.push(to_ns * if passes.is_empty() { wall.wall * 1e9 } else { on_device });
            }
        }
        for _ in 0..rounds {
            let (done, took) = crate::timing::time(|| -> Result<()> {
                let all = gpu.buffer("rays", &repeated)?;
                let mut bound = scene.bindings();
                bound.push(("rays", &all));
                bound.push((into, &answers));
                let mut commands = gpu.timed_commands();
                commands.dispatch(&kernel, &bound, kernel.groups(u32::try_from(all.len())?))?;
                block_on(commands.times())?;
                block_on(gpu.read_first(&answers, all.len()))?;
                Ok(())
            });
            done?;
            with_transfer.push(to_ns * took.wall * 1e9);
        }
        Ok((block_on(gpu.read_first(&answers, own.len()))?, ns.into(), with_transfer.into()))
    }
}

#[cfg(test)]
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
mod tests {
    use std::{cell::Cell, thread, time::Duration};

    use canted_trace::Ray;

    use super::*;

    #[test]
    fn times_are_of_one_test() {
        let n_runs = Cell::new(0);
        let pause = Duration::from_millis(2);
        let work = || {
            n_runs.set(n_runs.get() + 1);
            thread::sleep(pause);
        };
        let test = Test { name: "a".to_owned(), answers: vec![7], work: Box::new(work), n_tests: LEAST_TESTS / 2 };
        let tested = run(vec![test], 3);
        // Twice per round, and a round before the first.
        assert_eq!((n_runs.get(), &tested[0].answers[..], tested[0].ns.values().len()), (8, &[7][..], 3));
        let least = 2.0 * pause.as_secs_f64() * 1e9 / LEAST_TESTS as f64;
        assert!(tested[0].ns.range()[0] >= least, "{:?} {least}", tested[0].ns);
    }

    #[test]
    fn wrong_answers_and_errors_are_distinguished() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let ray = |x: f32| Ray::new([x, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let truths: Vec<ExactHit> = [1.0, 1.0, 3.5, 3.5].map(|x| ExactHit::of(&(ray(x), corners))).into();
        let found = Accuracy::of(&truths, &[Some([1.0f32.next_up(), 0.25, 0.25]), None, Some([1.0, 0.9, 0.2]), None]);
        assert_eq!((found.wrong_hits, found.wrong_misses), (0.25, 0.25));
        assert_eq!((found.t_ulps.values(), found.uv_ulps.values()), (&[1.0][..], &[0.0][..]));
    }

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
