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
}

impl SimdPath {
    /// All paths, including those of other machines.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Avx2, Self::Avx512, Self::Neon];

    /// The fastest path, by measurement, of those that this machine has.
    #[must_use]
    pub fn detect() -> Self {
        [Self::Avx512, Self::Avx2, Self::Neon].into_iter().find(|path| path.is_available()).unwrap_or(Self::Scalar)
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
        }
    }

    /// Runs `task` on this path, or on the scalar one where the machine lacks it.
    #[inline]
    pub(crate) fn run<T: super::Task>(self, task: T) -> T::Output {
        use super::Simd;
        #[cfg(target_arch = "x86_64")]
        match self {
            Self::Avx512 => {
                if let Some(simd) = super::Avx512::new() {
                    return simd.run(task);
                }
            }
            Self::Avx2 => {
                if let Some(simd) = super::Avx2::new() {
                    return simd.run(task);
                }
            }
            Self::Scalar | Self::Neon => {}
        }
        #[cfg(target_arch = "aarch64")]
        if self == Self::Neon
            && let Some(simd) = super::Neon::new()
        {
            return simd.run(task);
        }
        super::Scalar.run(task)
    }
}
