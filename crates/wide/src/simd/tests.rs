use canted_fixtures::SplitMix64;
use canted_obb::Affine;
use canted_trace::{Arrays, F64x4, ObjectMap, PlacedRay, Ray, ScaledRay, WorldRay};

use super::{Scalar, Simd, SimdPath, Task};

/// Eight lanes of bits, by the operation that gave them.
type Results = Vec<(&'static str, [u32; 8])>;

/// Every operation on the same lanes.
struct Every {
    a: [f32; 8],
    b: [f32; 8],
    c: [f32; 8],
}

impl Task for Every {
    type Output = Results;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Results {
        let (a, b, c) = (simd.load(&self.a), simd.load(&self.b), simd.load(&self.c));
        let half = [self.a[0], self.a[1], self.a[2], self.a[3]];
        let bits = |lanes: [f32; 8]| lanes.map(f32::to_bits);
        vec![
            ("splat", bits(simd.store(simd.splat(self.a[0])))),
            ("load", bits(simd.store(a))),
            ("load_half", bits(simd.store(simd.load_half(&half)))),
            ("transpose_half 0", bits(simd.store(simd.transpose_half([a, b, c, a, b, c, b, a])[0]))),
            ("transpose_half 1", bits(simd.store(simd.transpose_half([a, b, c, a, b, c, b, a])[1]))),
            ("transpose_half 2", bits(simd.store(simd.transpose_half([a, b, c, a, b, c, b, a])[2]))),
            ("transpose_half 3", bits(simd.store(simd.transpose_half([a, b, c, a, b, c, b, a])[3]))),
            ("add", bits(simd.store(simd.add(a, b)))),
            ("sub", bits(simd.store(simd.sub(a, b)))),
            ("mul", bits(simd.store(simd.mul(a, b)))),
            ("div", bits(simd.store(simd.div(a, b)))),
            ("sqrt", bits(simd.store(simd.sqrt(a)))),
            ("min", bits(simd.store(simd.min(a, b)))),
            ("max", bits(simd.store(simd.max(a, b)))),
            ("min_bits", bits(simd.store(simd.min_bits(a, b)))),
            ("max_bits", bits(simd.store(simd.max_bits(a, b)))),
            ("power_of_two", bits(simd.store(simd.power_of_two(a)))),
            ("transpose 0", bits(simd.store(simd.transpose([a, b, c, a, b, c, b, a])[0]))),
            ("transpose 3", bits(simd.store(simd.transpose([a, b, c, a, b, c, b, a])[3]))),
            ("transpose 6", bits(simd.store(simd.transpose([a, b, c, a, b, c, b, a])[6]))),
            ("abs", bits(simd.store(simd.abs(a)))),
            ("xor_sign", bits(simd.store(simd.xor_sign(a, b)))),
            ("pick", bits(simd.store(simd.pick(a, b, c, a)))),
            ("lt", [simd.lt(a, b); 8]),
            ("le", [simd.le(a, b); 8]),
            ("mul_add", bits(simd.store(simd.mul_add(a, b, c)))),
            ("mul_sub", bits(simd.store(simd.mul_sub(a, b, c)))),
            ("neg_mul_sub", bits(simd.store(simd.neg_mul_sub(a, b, c)))),
        ]
    }
}

/// Numbers of every kind: zeros, subnormals, ends of the range, infinities, what is not a number, and plain ones.
fn lane(state: &mut u64) -> f32 {
    const SPECIAL: [f32; 12] = [
        0.0,
        -0.0,
        f32::MIN_POSITIVE,
        1e-40,
        -1e-45,
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        1.0,
        -1.0,
    ];
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let random = (*state >> 33) as u32;
    match random % 4 {
        0 => SPECIAL[(random >> 8) as usize % SPECIAL.len()],
        // Near one, so that products and sums cancel.
        1 => 1.0 + (random >> 9) as f32 * f32::EPSILON,
        _ => f32::from_bits(random ^ (random << 13)),
    }
}

/// Whether `got` is what the scalar twin gives, or what the operation's contract allows beside.
fn agrees(name: &str, got: u32, scalar: u32, [a, b, c]: [f32; 3]) -> bool {
    let (value, want) = (f32::from_bits(got), f32::from_bits(scalar));
    if got == scalar || value.is_nan() && want.is_nan() && !matches!(name, "load" | "splat" | "abs" | "xor_sign") {
        return true;
    }
    let fused = match name {
        "mul_add" => a.mul_add(b, c),
        "mul_sub" => a.mul_add(b, -c),
        "neg_mul_sub" => (-a).mul_add(b, -c),
        _ => return false,
    };
    got == fused.to_bits() || value.is_nan() && fused.is_nan()
}

fn paths() -> Vec<SimdPath> {
    let (there, missing): (Vec<_>, Vec<_>) = SimdPath::ALL.into_iter().partition(|path| path.is_available());
    for path in missing {
        #[expect(clippy::print_stderr, reason = "what was not tested must be known")]
        {
            eprintln!("not tested, this machine lacks it: {}", path.name());
        }
    }
    there
}

#[test]
fn every_operation_gives_the_scalar_twins_bits() {
    let mut state = 1;
    for path in paths() {
        for _ in 0..20_000 {
            let [a, b, c]: [[f32; 8]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| lane(&mut state)));
            let want = Scalar.run(Every { a, b, c });
            let got = path.available().run(Every { a, b, c });
            for ((name, got), (_, want)) in got.iter().zip(&want) {
                for i in 0..8 {
                    // Upper lanes of a half are anything finite.
                    let free = *name == "load_half" && i >= 4;
                    let agrees = if free {
                        f32::from_bits(got[i]).is_finite()
                    } else {
                        agrees(name, got[i], want[i], [a[i], b[i], c[i]])
                    };
                    assert!(
                        agrees,
                        "{} {name} of {:?}: {:x} for {:x}",
                        path.name(),
                        [a[i], b[i], c[i]],
                        got[i],
                        want[i]
                    );
                }
            }
        }
    }
}

/// The bits of every operation of four lanes of `f64`.
struct EveryOfFour([[f32; 4]; 2]);

impl Task for EveryOfFour {
    type Output = Vec<[u64; 4]>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Vec<[u64; 4]> {
        let four = simd.four();
        let (a, b) = (four.widen(&self.0[0]), four.widen(&self.0[1]));
        // Digits that narrowing has to round.
        let third = four.mul(a, four.splat(1.0 / 3.0));
        let results = [a, third, four.add(third, b), four.sub(third, b), four.mul(third, b), four.rotate(third)];
        let narrow = [four.narrow(third), four.narrow(b)].map(|x| x.map(|x| u64::from(x.to_bits())));
        results.map(|x| four.store(x).map(f64::to_bits)).into_iter().chain(narrow).collect()
    }
}

#[test]
fn four_lanes_have_the_bits_of_arrays() {
    let mut state = 2;
    for path in paths() {
        for _ in 0..20_000 {
            let lanes: [[f32; 4]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| lane(&mut state)));
            let (got, want) = (path.available().run(EveryOfFour(lanes)), Scalar.run(EveryOfFour(lanes)));
            for (got, want) in got.iter().flatten().zip(want.iter().flatten()) {
                let are_nan = |bits: u64| f64::from_bits(bits).is_nan() || f32::from_bits(bits as u32).is_nan();
                assert!(got == want || are_nan(*got) && are_nan(*want), "{} {lanes:?}", path.name());
            }
        }
    }
}

/// A ray in the object space of an instance, with the lanes of a path.
struct InObject<'a>(PlacedRay<'a>);

impl Task for InObject<'_> {
    type Output = String;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> String {
        format!("{:?}", self.0.object_by(simd.four()))
    }
}

/// Lanes that rotate the other way.
#[derive(Clone, Copy)]
struct Backward;

impl F64x4 for Backward {
    type V = [f64; 4];

    fn widen(self, x: &[f32; 4]) -> [f64; 4] {
        Arrays.widen(x)
    }
    fn splat(self, x: f64) -> [f64; 4] {
        Arrays.splat(x)
    }
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Arrays.add(a, b)
    }
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Arrays.sub(a, b)
    }
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Arrays.mul(a, b)
    }
    fn rotate(self, a: [f64; 4]) -> [f64; 4] {
        Arrays.rotate(Arrays.rotate(a))
    }
    fn store(self, a: [f64; 4]) -> [f64; 4] {
        a
    }
    fn narrow(self, a: [f64; 4]) -> [f32; 4] {
        Arrays.narrow(a)
    }
}

/// The inverse by cofactors in `f64`, number by number, against the lanes of every path: rotated, sheared, mirrored, tiny, huge and far instances.
#[test]
fn rays_enter_instances_with_the_bits_of_plain_numbers() {
    let mut rng = SplitMix64::new(5);
    let (mut n_entering, mut n_wrong) = (0, 0);
    for round in 0..6000 {
        let (scale, far) = ([1.0, 1e-3, 1e6, 1e-9][round % 4], [0.0, 1.0, 1e7][round / 4 % 3]);
        let column = |of: [f64; 3], scale: f64| of.map(|x| (scale * x) as f32);
        let axes = [0; 3].map(|_| column(rng.signed3(), scale));
        let map = Affine { columns: [axes[0], axes[1], axes[2], column(rng.signed3(), far)] };
        let direction = rng.signed3().map(|x| x as f32);
        let origin = column(rng.signed3(), if round % 5 == 0 { far } else { 3.0 });
        let Some(ray) = ScaledRay::new(&Ray::new(origin, direction).between(0.0, 1e3)) else { continue };
        let (world, map) = (WorldRay::new(&ray), ObjectMap::new(&map));
        let placed = PlacedRay { world: &world, map: &map, t_max: world.t_max };
        let want = in_object(&world, &map);
        n_entering += usize::from(want != "None");
        n_wrong += usize::from(format!("{:?}", placed.object_by(Backward)) != want);
        for path in paths() {
            assert_eq!(path.available().run(InObject(placed)), want, "{} {map:?} {ray:?}", path.name());
        }
    }
    assert!(n_entering > 5000 && n_wrong > 5000, "{n_entering} enter, {n_wrong} wrong ones seen");
}

/// The ray in object space by the rows of the inverse.
fn in_object(world: &WorldRay<'_>, map: &ObjectMap) -> String {
    let [a, b, c, shift] = map.world_from_object().columns.map(|column| column.map(f64::from));
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
    let s = 1.0 / dot(a, cross(b, c));
    let rows = [cross(b, c), cross(c, a), cross(a, b)].map(|row| row.map(|x| x * s));
    let ScaledRay { origin, direction, .. } = *world.ray;
    let along = |v: [f64; 3]| rows.map(|row| dot(row, v));
    let ([x, y, z], [sx, sy, sz]) = (along(origin.map(f64::from)), along(shift));
    format!("{:?}", world.in_object([x - sx, y - sy, z - sz], along(direction.map(f64::from)), world.t_max))
}

/// Most machines compile only some of the paths.
#[test]
fn every_path_has_every_operation() {
    let names = |source: &'static str| source.split("fn ").skip(1).filter_map(|text| text.split(['(', '<']).next());
    let (_, operations) = include_str!("mod.rs").split_once("trait Simd").unwrap();
    let operations: Vec<&str> = names(operations).collect();
    assert!(operations.len() > 18 && operations.contains(&"transpose"), "{operations:?}");
    let paths = [
        ("avx2", include_str!("avx2.rs")),
        ("avx512", include_str!("avx512.rs")),
        ("neon", include_str!("neon.rs")),
        ("scalar", include_str!("scalar.rs")),
        ("simd128", include_str!("simd128.rs")),
    ];
    for (path, source) in paths {
        let missing: Vec<_> =
            operations.iter().filter(|operation| !names(source).any(|name| name == **operation)).collect();
        assert!(missing.is_empty(), "{path} lacks {missing:?}");
    }
}

#[test]
fn the_scalar_twin_is_plain_arithmetic() {
    let (a, b) = ([1.0, -2.0, 0.0, -0.0, 5.0, f32::NAN, 3.0, 8.0], [2.0, -3.0, -0.0, 0.0, 5.0, 1.0, f32::NAN, -8.0]);
    assert_eq!((Scalar.lt(a, b), Scalar.le(a, b)), (0b0000_0001, 0b0001_1101));
    assert_eq!(Scalar.min(a, b)[..5], [1.0, -3.0, -0.0, 0.0, 5.0]);
    assert_eq!(Scalar.min(a, b)[2].to_bits(), (-0.0f32).to_bits(), "the second of equals");
    assert_eq!(Scalar.max(a, b)[3].to_bits(), 0.0f32.to_bits(), "the second of equals");
    assert_eq!(Scalar.min_bits(a, b)[..4], [1.0, -2.0, -0.0, -0.0], "the less negative of two");
    assert_eq!(Scalar.min_bits(a, b).map(f32::to_bits)[2..4], [(-0.0f32).to_bits(); 2], "negative zero is less");
    assert_eq!(Scalar.max_bits(a, b)[..2], [2.0, -3.0], "the more negative of two");
    assert_eq!(Scalar.max_bits(a, b).map(f32::to_bits)[2..4], [0; 2], "positive zero is greater");
    assert_eq!(Scalar.xor_sign(a, b)[..3], [1.0, 2.0, -0.0]);
    assert_eq!(Scalar.neg_mul_sub(a, b, a)[..2], [-3.0, -4.0]);
    assert_eq!(Scalar.mul_sub(a, b, a)[..2], [1.0, 8.0]);
}

#[test]
fn the_comparison_sees_a_wrong_lane() {
    assert!(agrees("add", 1, 1, [0.0; 3]));
    assert!(!agrees("add", 2, 1, [0.0; 3]));
    assert!(!agrees("min", 0.0f32.to_bits(), (-0.0f32).to_bits(), [0.0, -0.0, 0.0]));
    let [a, b, c] = [1.0 + f32::EPSILON, 1.0 - f32::EPSILON, -1.0];
    assert_ne!(a.mul_add(b, c), a * b + c);
    assert!(agrees("mul_add", a.mul_add(b, c).to_bits(), (a * b + c).to_bits(), [a, b, c]));
    assert!(!agrees("mul", a.mul_add(b, c).to_bits(), (a * b + c).to_bits(), [a, b, c]));
}

#[test]
fn a_path_that_is_missing_runs_as_the_scalar_one() {
    let lanes = || Every { a: [1.5; 8], b: [0.1; 8], c: [-0.15; 8] };
    for path in SimdPath::ALL.into_iter().filter(|path| !path.is_available()) {
        assert_eq!(path.available().run(lanes()), Scalar.run(lanes()), "{}", path.name());
    }
    assert!(SimdPath::detect().is_available() && SimdPath::Scalar.is_available());
}
