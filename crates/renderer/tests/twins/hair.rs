//! The BSDF of hair on the device compared with the CPU's, and in a white furnace.

use bytemuck::{Pod, Zeroable};
use canted_fixtures::device_tests::{Test, needs_device, needs_nothing};
use canted_gpu::{Variant, wgsl};
use canted_renderer::{Bsdf, BsdfSample, Evaluation, Hair};

use crate::{U, answers, compare, direction, gpu, number};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(hair_matches_the_cpu),
        needs_device(hair_in_a_white_furnace_is_white_on_the_device),
        needs_nothing(hair_layouts_match_the_kernel),
    ]
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Query {
    absorption: [f32; 3],
    roughness: f32,
    roughness_around: f32,
    tilt_rad: f32,
    ior: f32,
    choice: f32,
    outgoing: [f32; 3],
    _padding: u32,
    incident: [f32; 3],
    _padding_after: u32,
    square: [f32; 2],
    _padding_end: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    value: [f32; 3],
    density: f32,
    incident: [f32; 3],
    sampled_density: f32,
    weight: [f32; 3],
    flags: u32,
}

const FOUND: u32 = 1;
const TRANSMITTED: u32 = 4;

/// An answer is correct if the CPU gives it for inputs that differ by at most this, relative to 1: chains of about this many roundings lead from directions to
/// angles.
const MOVE: f64 = 16.0 * U;

/// Rounding of the last operations, relative: WGSL allows an exponential of x an error of 3 + 2 |x| ULP, and here x is up to 80 where the value counts; two are
/// multiplied.
const CHAIN: f64 = 700.0 * U;

/// Values below this part of the greatest that a lobe has are far in its tail.
const TAIL: f64 = 1e-6;

impl Query {
    fn bsdf(&self) -> Bsdf {
        let Self { absorption, roughness, roughness_around, tilt_rad, ior, .. } = *self;
        let hair = Hair { absorption, roughness, roughness_around, tilt_rad, ior, direction: [1.0, 0.0] };
        Bsdf { hair: Some(hair), ..Bsdf::lambert([1.0; 3]) }
    }

    fn evaluated(&self) -> [f64; 4] {
        let Evaluation { value: [r, g, b], density } = self.bsdf().evaluate(self.outgoing, self.incident);
        [r, g, b, density].map(f64::from)
    }

    fn sampled(&self) -> Option<BsdfSample> {
        self.bsdf().sample(self.outgoing, self.square, self.choice)
    }

    /// The query with one input moved at a time.
    fn moved(&self) -> impl Iterator<Item = Self> {
        (0..10).flat_map(move |k| {
            [-MOVE as f32, MOVE as f32].map(|step| {
                let mut query = *self;
                match k {
                    0..3 => query.outgoing[k] += step,
                    3..6 => query.incident[k - 3] += step,
                    6 => query.ior *= 1.0 + step,
                    // It is added to an exponential of up to 1.
                    7 => query.square[0] = (query.square[0] + step).clamp(0.0, 1.0),
                    8 => query.square[1] += step,
                    _ => query.choice = (query.choice + step).clamp(0.0, 1.0 - f32::EPSILON),
                }
                query
            })
        })
    }

    fn bounds<const N: usize>(&self, numbers: impl Fn(&Self) -> [f64; N]) -> [f64; N] {
        let here = numbers(self);
        let mut bounds = here.map(|x| CHAIN * x.abs());
        for moved in self.moved() {
            let there = numbers(&moved);
            bounds = std::array::from_fn(|k| bounds[k] + (there[k] - here[k]).abs());
        }
        bounds
    }
}

fn are_within<const N: usize>(a: [f64; N], b: [f64; N], bounds: [f64; N]) -> bool {
    (0..N).all(|k| (a[k] - b[k]).abs() <= bounds[k] + TAIL * b[k].abs().max(1e-6))
}

fn compare_one(query: &Query, answer: &Answer) -> Result<bool, String> {
    let fail = |what: &str| Err(format!("{what}: {query:?} {answer:?} {:?} {:?}", query.evaluated(), query.sampled()));
    let [r, g, b] = answer.value.map(f64::from);
    if !are_within([r, g, b, answer.density.into()], query.evaluated(), query.bounds(Query::evaluated)) {
        return fail("value");
    }
    let sample = query.sampled();
    let flags = sample.map_or(0, |s| FOUND | (u32::from(s.is_transmitted) * TRANSMITTED));
    if answer.flags != flags {
        return Ok(false);
    }
    let Some(sample) = sample else { return Ok(true) };
    let incident = |query: &Query| query.sampled().map_or([9.0; 3], |sample| sample.incident.map(f64::from));
    let bounds = query.bounds(incident).map(|bound| bound + CHAIN);
    if !are_within(answer.incident.map(f64::from), sample.incident.map(f64::from), bounds) {
        return fail("direction");
    }
    // What the CPU says of the sampled direction.
    let there = Query { incident: answer.incident, ..*query };
    let of = |query: &Query| {
        let [r, g, b, density] = query.evaluated();
        let divisor = if density > 0.0 { density } else { 1.0 };
        [r / divisor, g / divisor, b / divisor, density]
    };
    let [r, g, b] = answer.weight.map(f64::from);
    if are_within([r, g, b, answer.sampled_density.into()], of(&there), there.bounds(of)) {
        Ok(true)
    } else {
        fail("weight")
    }
}

fn queries(n: u32) -> Vec<Query> {
    (0..n)
        .map(|i| {
            let of = |k: u32, ends: &[f32]| {
                ends.get((8.0 * number(i, k)) as usize).copied().unwrap_or_else(|| number(i, k + 100))
            };
            let mut outgoing = direction(i, 10);
            outgoing[2] = outgoing[2].abs();
            let incident = match i % 4 {
                0 => [-outgoing[0], -outgoing[1], outgoing[2]],
                1 => [-outgoing[0], -outgoing[1], -outgoing[2]],
                _ => direction(i, 30),
            };
            Query {
                absorption: [0, 1, 2].map(|k| 3.0 * of(50 + k, &[0.0, 1e-3, 10.0])),
                roughness: of(44, &[0.05, 0.2, 0.3, 1.0]).max(0.02),
                roughness_around: of(45, &[0.05, 0.3, 1.0]).max(0.02),
                tilt_rad: 0.1 * number(i, 46) - 0.05,
                ior: 1.3 + number(i, 47),
                choice: number(i, 48),
                outgoing,
                _padding: 0,
                incident,
                _padding_after: 0,
                square: [number(i, 53), number(i, 54)],
                _padding_end: [0; 2],
            }
        })
        .collect()
}

fn hair_matches_the_cpu() {
    let gpu = gpu();
    let queries = queries(20_000);
    let mut found: Vec<Answer> = answers(&gpu, wgsl::check::HAIR, &Variant::none(), &queries, &[]);
    let [n_equal, n_else] = compare(compare_one, &queries, &found).unwrap();
    assert!(n_else * 300 < n_equal, "{n_else} of {n_equal} fell to another side");
    // An error of a hundredth in a smooth region is detected.
    let smooth = queries.iter().position(|q| q.roughness > 0.5 && q.evaluated()[0] > 0.01).unwrap();
    found[smooth].value[0] *= 1.01;
    assert!(compare(compare_one, &queries, &found).unwrap_err().starts_with("value"));
}

/// Hair that absorbs nothing scatters all light, within 1 %: by the mean weight of samples, and by the integrals of value and density over the sphere, at the
/// midpoints of a grid in elevation along the hair and azimuth around it.
fn hair_in_a_white_furnace_is_white_on_the_device() {
    let gpu = gpu();
    for roughness in [[0.2, 0.2], [0.3, 0.3], [0.6, 0.4], [0.3, 0.9], [1.0, 1.0]] {
        for outgoing in [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.8, 0.6], [-0.8, 0.48, 0.36]] {
            let side = 200;
            let n = side * side;
            let midpoint = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
            let queries: Vec<Query> = (0..n)
                .map(|i| {
                    let (x, phi) = (2.0 * midpoint(i / side) - 1.0, std::f64::consts::TAU * midpoint(i % side));
                    let across = (1.0 - x * x).sqrt();
                    Query {
                        absorption: [0.0; 3],
                        roughness: roughness[0],
                        roughness_around: roughness[1],
                        tilt_rad: 0.035,
                        ior: 1.55,
                        choice: number(i, 1),
                        outgoing,
                        _padding: 0,
                        incident: [x, across * phi.cos(), across * phi.sin()].map(|x| x as f32),
                        _padding_after: 0,
                        square: [number(i, 4), number(i, 5)],
                        _padding_end: [0; 2],
                    }
                })
                .collect();
            let found: Vec<Answer> = answers(&gpu, wgsl::check::HAIR, &Variant::none(), &queries, &[]);
            let mean = |of: &dyn Fn(&Answer) -> f32| {
                found.iter().map(|answer| f64::from(of(answer))).sum::<f64>() / f64::from(n)
            };
            let sphere = 4.0 * std::f64::consts::PI;
            let all = [
                mean(&|answer| answer.weight[0]),
                sphere * mean(&|answer| answer.value[0]),
                sphere * mean(&|answer| answer.density),
            ];
            assert!(all.iter().all(|x| (x - 1.0).abs() < 0.01), "{roughness:?} {outgoing:?}: {all:?}");
        }
    }
}

fn hair_layouts_match_the_kernel() {
    canted_shaders::same_layout!(
        wgsl::check::HAIR,
        &Variant::none(),
        "Query",
        Query { absorption, roughness, roughness_around, tilt_rad, ior, choice, outgoing, incident, square }
    );
    canted_shaders::same_layout!(
        wgsl::check::HAIR,
        &Variant::none(),
        "Answer",
        Answer { value, density, incident, sampled_density, weight, flags }
    );
}
