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
