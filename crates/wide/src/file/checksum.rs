//! FNV-1a with 64 bits.
//!
//! Each step, exclusive or and a product with an odd number, is a bijection of the sum, so every change of a single byte
//! is detected; other damage goes undetected with probability 2^-64. The checksum guards against accidents; the checks of
//! the content guard against forged files.
//! Source: Fowler, Noll & Vo, RFC 9923.

const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// Checksum of `bytes`.
pub(super) fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(OFFSET, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(PRIME))
}

#[cfg(test)]
mod tests {
    use super::checksum;

    /// The values of the RFC's own test.
    #[test]
    fn known_sums() {
        assert_eq!(checksum(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(checksum(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(checksum(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
