//! Bits of a BasisLZ stream, and its codes of variable length.

use super::Flaw;

/// Most bits of a code of symbols.
const MAX_CODE: usize = 16;

/// Symbols that stand for lengths of codes, in the order of their own codes.
const LENGTHS: [u8; 21] = [17, 18, 19, 20, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15, 16];

/// Bits, the lowest of each byte first.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// Number of bits that were read.
    at: usize,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next bits, up to 32; zeros after the end.
    fn peek(&self, n: usize) -> u32 {
        let rest = self.bytes.get(self.at / 8..).unwrap_or_default();
        let mut word = [0; 8];
        let n_bytes = rest.len().min(8);
        word[..n_bytes].copy_from_slice(&rest[..n_bytes]);
        ((u64::from_le_bytes(word) >> (self.at % 8)) & ((1 << n) - 1)) as u32
    }

    fn skip(&mut self, n: usize) -> Result<(), Flaw> {
        self.at += n;
        if self.at <= self.bytes.len() * 8 { Ok(()) } else { Err("unexpected end") }
    }

    /// Reads up to 32 bits.
    pub(super) fn get(&mut self, n: usize) -> Result<u32, Flaw> {
        let bits = self.peek(n);
        self.skip(n)?;
        Ok(bits)
    }

    /// Reads a number of groups of `n` bits, each with a bit that says whether another follows.
    pub(super) fn number(&mut self, n: usize) -> Result<u32, Flaw> {
        let mut number = 0;
        for shift in (0..32).step_by(n) {
            let group = self.get(n + 1)?;
            number |= (group & ((1 << n) - 1)) << shift;
            if group >> n == 0 {
                break;
            }
        }
        Ok(number)
    }
}

/// A canonical Huffman code.
pub(super) struct Code {
    /// Symbol and number of bits, 0 where there is none, by the next [`Code::n_bits`] bits.
    symbols: Vec<(u16, u8)>,
    n_bits: usize,
}

impl Code {
    /// Reads the lengths of the codes of all symbols, themselves coded.
    pub(super) fn read(bits: &mut Bits<'_>) -> Result<Self, Flaw> {
        let n_symbols = bits.get(14)? as usize;
        if n_symbols == 0 {
            return Err("a code without symbols");
        }
        let n_lengths = bits.get(5)? as usize;
        let mut sizes = [0; LENGTHS.len()];
        for &symbol in LENGTHS.get(..n_lengths).ok_or("too many lengths of codes")? {
            sizes[usize::from(symbol)] = bits.get(3)? as u8;
        }
        let lengths = Self::new(&sizes)?;
        let mut sizes = Vec::with_capacity(n_symbols);
        while sizes.len() < n_symbols {
            let (size, n) = match lengths.get(bits)? {
                17 => (0, 3 + bits.get(3)?),
                18 => (0, 11 + bits.get(7)?),
                repeat @ 19.. => {
                    let &last = sizes.last().ok_or("no length of a code to repeat")?;
                    (last, if repeat == 19 { 3 + bits.get(2)? } else { 7 + bits.get(7)? })
                }
                size => (size as u8, 1),
            };
            sizes.extend((0..n).map(|_| size));
        }
        if sizes.len() > n_symbols {
            return Err("too many lengths of codes");
        }
        Self::new(&sizes)
    }

    /// The code with these lengths, 0 for symbols that do not occur.
    fn new(sizes: &[u8]) -> Result<Self, Flaw> {
        let n_bits = sizes.iter().copied().max().map_or(0, usize::from);
        let mut symbols = vec![(0, 0); 1 << n_bits.min(MAX_CODE)];
        // Shorter codes come first, codes of equal length in the order of their symbols.
        let mut next = 0_usize;
        for size in 1..=n_bits {
            for (symbol, _) in sizes.iter().enumerate().filter(|&(_, &its)| usize::from(its) == size) {
                if next >> size != 0 {
                    return Err("too many codes");
                }
                // Codes begin at their highest bit.
                let first = next.reverse_bits() >> (usize::BITS as usize - size);
                symbols.iter_mut().skip(first).step_by(1 << size).for_each(|slot| *slot = (symbol as u16, size as u8));
                next += 1;
            }
            next <<= 1;
        }
        Ok(Self { symbols, n_bits })
    }

    /// Reads a symbol.
    pub(super) fn get(&self, bits: &mut Bits<'_>) -> Result<u32, Flaw> {
        let (symbol, size) = self.symbols[bits.peek(self.n_bits) as usize];
        if size == 0 {
            return Err("an unused code");
        }
        bits.skip(size.into())?;
        Ok(symbol.into())
    }
}
