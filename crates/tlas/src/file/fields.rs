use canted_obb::Affine;

/// Changes with the meaning of the bytes.
pub(super) const VERSION: u32 = 1;

/// Little-endian fields, one after the other.
pub(super) struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The next `n` bytes; `None` if there are fewer.
    pub(super) fn bytes(&mut self, n: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(bytes)
    }

    pub(super) fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    pub(super) fn word(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// A number of records of at least `n_bytes` each; `None` if the rest cannot hold as many.
    pub(super) fn count(&mut self, n_bytes: usize) -> Option<usize> {
        let count = usize::try_from(u64::from_le_bytes(self.take()?)).ok()?;
        (count <= self.0.len() / n_bytes).then_some(count)
    }

    pub(super) fn affine(&mut self) -> Option<Affine> {
        let mut affine = Affine::IDENTITY;
        for number in affine.columns.as_flattened_mut() {
            *number = f32::from_le_bytes(self.take()?);
        }
        Some(affine)
    }
}

/// FNV-1a with 64 bits: each step is a bijection of the sum, so every change of a single byte is found.
/// Source: Fowler, Noll & Vo, RFC 9923.
pub(super) fn checksum(bytes: &[u8]) -> u64 {
    let step = |sum: u64, &byte: &u8| (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, step)
}
