use bytemuck::{Pod, Zeroable};
use canted_fixtures::device_tests::{Test, needs_device, needs_nothing};
use canted_gpu::{Variant, choice, wgsl};
use canted_renderer::twins::glass_albedos;
use canted_renderer::{Bsdf, BsdfSample, Evaluation, Hemisphere};

use crate::{U, answers, compare, direction, gpu, number};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(bsdfs_match_the_cpu),
        needs_device(compensated_bsdfs_match_the_cpu),
        needs_device(diffuse_bsdf_matches_the_full_one),
        needs_device(uniform_diffuse_lobes_match_the_cpu),
        needs_device(opaque_bsdf_without_transmission_matches_the_full_one),
        needs_nothing(layouts_match_the_kernel),
    ]
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Query {
    base_color: [f32; 3],
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    outgoing: [f32; 3],
    choice: f32,
    incident: [f32; 3],
    flags: u32,
    square: [f32; 2],
    _padding: [u32; 2],
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
    compression: f32,
    _padding: [u32; 3],
}

/// Flags of a query that only the CPU reads: the kernel is specialized.
const COMPENSATED: u32 = 4;
const UNIFORM: u32 = 8;

const FOUND: u32 = 1;
const DELTA: u32 = 2;
const TRANSMITTED: u32 = 4;
const ALL_DELTA: u32 = 8;

/// An answer is correct if the CPU gives it for inputs that differ by at most this relative amount, up to the rounding of the
/// last operations. Half vectors and cosines are chains of about this many roundings.
const MOVE: f64 = 8.0 * U;

/// Rounding of the last operations: products, and quotients of 2.5 ULP.
const CHAIN: f64 = 64.0 * U;

impl Query {
    fn bsdf(&self) -> Bsdf {
        Bsdf {
            base_color: self.base_color,
            metallic: self.metallic,
            roughness: self.roughness,
            specular: self.specular,
            transmission: self.transmission,
            ior: self.ior,
            thin_walled: self.flags & 1 != 0,
            is_inside: self.flags & 2 != 0,
            is_compensated: self.flags & COMPENSATED != 0,
            hemisphere: if self.flags & UNIFORM == 0 { Hemisphere::Cosine } else { Hemisphere::Uniform },
            lobes: None,
            hair: None,
        }
    }

    fn evaluated(&self) -> [f64; 4] {
        let Evaluation { value: [r, g, b], density } = self.bsdf().evaluate(self.outgoing, self.incident);
        [r, g, b, density].map(f64::from)
    }

    fn sampled(&self) -> Option<BsdfSample> {
        self.bsdf().sample(self.outgoing, self.square, self.choice)
    }

    /// The query with one input perturbed at a time.
    fn moved(&self) -> impl Iterator<Item = Self> {
        let factors = [1.0 - MOVE, 1.0 + MOVE].map(|x| x as f32);
        (0..11).flat_map(move |k| {
            factors.map(|factor| {
                let mut query = *self;
                match k {
                    0..3 => query.outgoing[k] *= factor,
                    3..6 => query.incident[k - 3] *= factor,
                    6 => query.ior *= factor,
                    7 => query.roughness *= factor,
                    8 => query.square[0] = (query.square[0] * factor).min(1.0 - f32::EPSILON),
                    9 => query.specular *= factor,
                    _ => query.square[1] = 1.0 - (1.0 - query.square[1]) * factor,
                }
                query
            })
        })
    }

    /// Error bound of each of some numbers.
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
    (0..N).all(|k| (a[k] - b[k]).abs() <= bounds[k])
}

/// Whether an answer matches the CPU's; false at a discontinuity; or what is wrong with it.
fn compare_one(query: &Query, answer: &Answer) -> Result<bool, String> {
    let fail = |what: &str| Err(format!("{what}: {query:?} {answer:?}"));
    let [r, g, b] = answer.value.map(f64::from);
    if !are_within([r, g, b, answer.density.into()], query.evaluated(), query.bounds(Query::evaluated)) {
        return fail("value");
    }
    let bsdf = query.bsdf();
    if (answer.flags & ALL_DELTA != 0) != bsdf.is_delta_only() {
        return fail("kind");
    }
    let compression = f64::from(bsdf.compression());
    if (f64::from(answer.compression) - compression).abs() > 4.0 * U * compression {
        return fail("compression");
    }
    let sample = query.sampled();
    let flags =
        sample.map_or(0, |s| FOUND | (u32::from(s.is_delta) * DELTA) | (u32::from(s.is_transmitted) * TRANSMITTED));
    if answer.flags & !ALL_DELTA != flags {
        return Ok(false);
    }
    let Some(sample) = sample else { return Ok(true) };
    let incident = |query: &Query| query.sampled().map_or([9.0; 3], |sample| sample.incident.map(f64::from));
    let bounds = query.bounds(incident).map(|bound| bound + CHAIN);
    if !are_within(answer.incident.map(f64::from), sample.incident.map(f64::from), bounds) {
        return fail("direction");
    }
    let [r, g, b] = answer.weight.map(f64::from);
    if sample.is_delta {
        let of = |query: &Query| query.sampled().map_or([9.0; 3], |sample| sample.weight.map(f64::from));
        let is_right = are_within([r, g, b], sample.weight.map(f64::from), query.bounds(of));
        return if is_right { Ok(true) } else { fail("mirrored weight") };
    }
    // Density of the sampled direction.
    let there = Query { incident: answer.incident, ..*query };
    let of = |query: &Query| {
        let [r, g, b, density] = query.evaluated();
        let divisor = if density > 0.0 { density } else { 1.0 };
        [r / divisor, g / divisor, b / divisor, density]
    };
    let is_right = are_within([r, g, b, answer.sampled_density.into()], of(&there), there.bounds(of));
    if is_right { Ok(true) } else { fail("weight") }
}

/// One of `n` numbers, uniformly.
fn index(number: f32, n: u8) -> usize {
    (f32::from(n) * number) as usize
}

/// Random and extreme materials, viewed from all heights, with random and critical incident directions.
fn queries(n: u32) -> Vec<Query> {
    (0..n)
        .map(|i| {
            let of =
                |k: u32, ends: &[f32]| ends.get(index(number(i, k), 8)).copied().unwrap_or_else(|| number(i, k + 100));
            let mut outgoing = direction(i, 10);
            outgoing[2] = outgoing[2].abs();
            let height = of(20, &[1.0, 1e-3, 1e-6]);
            if number(i, 21) < 0.5 {
                let side = ((1.0 - height) * (1.0 + height)).sqrt();
                let (s, c) = number(i, 22).sin_cos();
                outgoing = [side * c, side * s, height];
            }
            let [x, y, z] = outgoing;
            let incident = match i % 8 {
                0 => [-x, -y, z],
                1 => [-x, -y, -z],
                2 => outgoing,
                3 => {
                    let [x, y, z] = direction(i, 30);
                    let length = (x * x + y * y + 1e-8 * z * z).sqrt();
                    [x / length, y / length, 1e-4 * z / length]
                }
                _ => direction(i, 30),
            };
            let transmission = of(40, &[0.0, 0.0, 1.0, 1.0]);
            let thin = u32::from(number(i, 41) < 0.3);
            let inside = if transmission > 0.0 && thin == 0 && number(i, 42) < 0.5 { 2 } else { 0 };
            let iors = [1.0, 1.0001, 1.02, 1.33, 1.5, 2.4, 1000.0];
            Query {
                base_color: [0, 1, 2].map(|k| of(50 + k, &[0.0, 1.0])),
                metallic: of(43, &[0.0, 0.0, 0.0, 1.0]),
                roughness: of(44, &[0.0, 0.03125, 0.032, 0.1, 1.0]),
                specular: of(45, &[0.0, 1.0, 1.0]),
                transmission,
                ior: iors.get(index(number(i, 46), 8)).copied().unwrap_or(1.0 + number(i, 47)),
                outgoing,
                choice: number(i, 48),
                incident,
                flags: thin | inside,
                square: [number(i, 53), number(i, 54)],
                _padding: [0; 2],
            }
        })
        .collect()
}

/// The choices for all materials.
fn full() -> Variant {
    glossy(choice::Transmission::Glass, choice::Energy::Single)
}

fn glossy(transmission: choice::Transmission, energy: choice::Energy) -> Variant {
    cosine().with(choice::Bsdf::Full).with(transmission).with(energy)
}

fn cosine() -> Variant {
    Variant::none().with(choice::Hemisphere::Cosine)
}

fn bsdfs_match_the_cpu() {
    let gpu = gpu();
    let queries = queries(20_000);
    let chosen = full();
    let mut answers: Vec<Answer> = answers(&gpu, wgsl::check::BSDF, &chosen, &queries, &[]);
    let [n_equal, n_else] = compare(compare_one, &queries, &answers).unwrap();
    // A choice may differ where its number and a probability are within a few roundings.
    assert!(n_else * 1000 < n_equal, "{n_else} of {n_equal} fell to another side");

    // An error of a thousandth in a smooth region is detected.
    let smooth = queries.iter().position(|q| q.roughness > 0.5 && q.evaluated()[0] > 0.01).unwrap();
    answers[smooth].value[0] *= 1.001;
    assert!(compare(compare_one, &queries, &answers).unwrap_err().starts_with("value"));
}

/// The coefficients of the fits are a thousand times their values: rounding of a sum may move them by so much more than of the
/// other factors. A wrong coefficient moves them more.
fn compensated_bsdfs_match_the_cpu() {
    const FIT: f64 = 1e-3;
    let gpu = gpu();
    let queries: Vec<Query> =
        queries(20_000).into_iter().map(|query| Query { flags: query.flags | COMPENSATED, ..query }).collect();
    let chosen = glossy(choice::Transmission::Glass, choice::Energy::Refracting);
    let glass = glass_albedos(&gpu).unwrap();
    let answers: Vec<Answer> = answers(&gpu, wgsl::check::BSDF, &chosen, &queries, &[("glass_albedos", &glass)]);
    let mut n_changed = 0;
    for (query, answer) in queries.iter().zip(&answers) {
        let [r, g, b] = answer.value.map(f64::from);
        let got = [r, g, b, answer.density.into()];
        let want = query.evaluated();
        let bounds = query.bounds(Query::evaluated);
        let allowed: [f64; 4] = std::array::from_fn(|k| bounds[k] + FIT * want[k].abs());
        assert!(are_within(got, want, allowed), "{query:?} {got:?} {want:?}");
        let single = Query { flags: query.flags & !COMPENSATED, ..*query };
        n_changed += usize::from(!are_within(single.evaluated(), want, allowed));
    }
    assert!(n_changed > 2000, "{n_changed} of {} are compensated", queries.len());
}

fn diffuse_bsdf_matches_the_full_one() {
    let gpu = gpu();
    let diffuse =
        |query: Query| Query { metallic: 0.0, specular: 0.0, transmission: 0.0, roughness: 1.0, flags: 0, ..query };
    let queries: Vec<Query> = queries(2000).into_iter().map(diffuse).collect();
    let lambert = cosine().with(choice::Bsdf::Lambert);
    let [few, all] =
        [lambert, full()].map(|chosen| answers::<_, Answer>(&gpu, wgsl::check::BSDF, &chosen, &queries, &[]));
    compare(compare_one, &queries, &all).unwrap();
    for (few, all) in few.iter().zip(&all) {
        // Opaque materials do not use the transmission factor.
        assert_eq!((few.value, few.incident, few.weight, few.flags), (all.value, all.incident, all.weight, all.flags));
    }
}

fn uniform_diffuse_lobes_match_the_cpu() {
    let gpu = gpu();
    let uniform = |query: Query| Query { flags: query.flags | UNIFORM, ..query };
    let queries: Vec<Query> = queries(20_000).into_iter().map(uniform).collect();
    let chosen = Variant::none().with(choice::Hemisphere::Uniform);
    let chosen = chosen.with(choice::Bsdf::Full).with(choice::Transmission::Glass);
    let chosen = chosen.with(choice::Energy::Single);
    let answers: Vec<Answer> = answers(&gpu, wgsl::check::BSDF, &chosen, &queries, &[]);
    let [n_equal, n_else] = compare(compare_one, &queries, &answers).unwrap();
    assert!(n_else * 1000 < n_equal, "{n_else} of {n_equal} fell to another side");
    // The comparison detects a lobe that is sampled by the cosine.
    let cosine: Vec<Query> = queries.iter().map(|query| Query { flags: query.flags & !UNIFORM, ..*query }).collect();
    assert!(compare(compare_one, &cosine, &answers).is_err());
}

fn opaque_bsdf_without_transmission_matches_the_full_one() {
    let gpu = gpu();
    let queries: Vec<Query> = queries(2000).into_iter().map(|query| Query { transmission: 0.0, ..query }).collect();
    let opaque = glossy(choice::Transmission::None, choice::Energy::Single);
    let answers: Vec<Answer> = answers(&gpu, wgsl::check::BSDF, &opaque, &queries, &[]);
    // The transmission factor is used only where light is transmitted.
    let check = |query: &Query, answer: &Answer| {
        let compression = query.bsdf().compression();
        compare_one(query, &Answer { compression, ..*answer })
    };
    let [n_equal, n_else] = compare(check, &queries, &answers).unwrap();
    assert!(n_else * 1000 < n_equal, "{n_else} of {n_equal} fell to another side");
}

fn layouts_match_the_kernel() {
    let full = full();
    canted_shaders::same_layout!(
        wgsl::check::BSDF,
        &full,
        "Query",
        Query {
            base_color,
            metallic,
            roughness,
            specular,
            transmission,
            ior,
            outgoing,
            choice,
            incident,
            flags,
            square
        }
    );
    canted_shaders::same_layout!(
        wgsl::check::BSDF,
        &full,
        "Answer",
        Answer { value, density, incident, sampled_density, weight, flags, compression }
    );
}
