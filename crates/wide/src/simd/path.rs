/// Instructions that rays are traced with.
///
/// Hits are the same bits on all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SimdPath {
    /// Plain Rust, on any machine.
    Scalar,
    /// AVX2 and FMA, `x86_64`.
    Avx2,
    /// AVX-512 F, VL and DQ, `x86_64`.
    Avx512,
    /// NEON, `aarch64`.
    Neon,
    /// 128-bit vectors of WebAssembly: modules compiled with `-C target-feature=+simd128`.
    Simd128,
}

impl SimdPath {
    /// All paths, including those of other machines.
    pub const ALL: [Self; 5] = [Self::Scalar, Self::Avx2, Self::Avx512, Self::Neon, Self::Simd128];

    /// The fastest path, by measurement, of those that this machine has.
    #[must_use]
    pub fn detect() -> Self {
        let fastest_first = [Self::Avx512, Self::Avx2, Self::Neon, Self::Simd128];
        fastest_first.into_iter().find(|path| path.is_available()).unwrap_or(Self::Scalar)
    }

    /// Whether this machine has the instructions.
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => super::Avx2::new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => super::Avx512::new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
            #[cfg(target_arch = "aarch64")]
            Self::Neon => super::Neon::new().is_some(),
            #[cfg(not(target_arch = "aarch64"))]
            Self::Neon => false,
            Self::Simd128 => cfg!(all(target_arch = "wasm32", target_feature = "simd128")),
        }
    }

    /// Its name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
            Self::Simd128 => "simd128",
        }
    }

    /// Runs loops with these instructions, where this machine has them. `mul` and `add` stay two roundings, so results are the same bits.
    #[inline]
    pub fn run<L: Loops>(self, loops: L) -> L::Output {
        self.available().run(Plain(loops))
    }

    /// The proof that this machine has the instructions, or that of the scalar path.
    pub(crate) fn available(self) -> AvailablePath {
        match self {
            Self::Scalar => None,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => super::Avx2::new().map(AvailablePath::Avx2),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => super::Avx512::new().map(AvailablePath::Avx512),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => None,
            #[cfg(target_arch = "aarch64")]
            Self::Neon => super::Neon::new().map(AvailablePath::Neon),
            #[cfg(not(target_arch = "aarch64"))]
            Self::Neon => None,
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => Some(AvailablePath::Simd128(super::Simd128)),
            #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
            Self::Simd128 => None,
        }
        .unwrap_or(AvailablePath::Scalar)
    }
}

/// Loops over arrays that the compiler translates for the instructions of a path, see [`SimdPath::run`].
pub trait Loops {
    /// The result.
    type Output;

    /// Runs them. Must be `#[inline(always)]`, and so must everything it calls, otherwise it is translated for any machine.
    fn run(self) -> Self::Output;
}

/// Loops without lanes of their own.
struct Plain<L>(L);

impl<L: Loops> super::Task for Plain<L> {
    type Output = L::Output;

    #[inline(always)]
    fn on<S: super::Simd>(self, _: S) -> L::Output {
        self.0.run()
    }
}

/// A path that this machine has. A ray may take less time than asking for the instructions, so a BVH asks once.
#[derive(Clone, Copy, Debug)]
pub(crate) enum AvailablePath {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2(super::Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(super::Avx512),
    #[cfg(target_arch = "aarch64")]
    Neon(super::Neon),
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128(super::Simd128),
}

impl AvailablePath {
    /// The fastest path of this machine.
    pub(crate) fn detect() -> Self {
        SimdPath::detect().available()
    }

    /// Its name.
    pub(crate) fn path(self) -> SimdPath {
        match self {
            Self::Scalar => SimdPath::Scalar,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => SimdPath::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => SimdPath::Avx512,
            #[cfg(target_arch = "aarch64")]
            Self::Neon(_) => SimdPath::Neon,
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128(_) => SimdPath::Simd128,
        }
    }

    /// Runs `task` on this path.
    #[inline(always)]
    pub(crate) fn run<T: super::Task>(self, task: T) -> T::Output {
        use super::Simd;
        match self {
            Self::Scalar => super::Scalar.run(task),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => simd.run(task),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => simd.run(task),
            #[cfg(target_arch = "aarch64")]
            Self::Neon(simd) => simd.run(task),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128(simd) => simd.run(task),
        }
    }
}
