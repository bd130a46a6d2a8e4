//! Welds vertices: equal positions get one index.

use std::hash::{BuildHasher, RandomState};

/// An unused slot.
const EMPTY: u32 = u32::MAX;

/// Distinct positions in order of first occurrence, with a hash table of their indices (open addressing, linear probing).
///
/// Positions are equal if all their bits are, so 0.0 and -0.0 differ. The hash has random seeds, so that no file can be made
/// to collide; the indices do not depend on them.
pub(crate) struct Weld {
    positions: Vec<[f32; 3]>,
    /// Indices into `positions`; a power of two, at least half of them unused.
    slots: Vec<u32>,
    seeds: [u64; 2],
}

impl Weld {
    pub(crate) fn new() -> Self {
        let random = RandomState::new();
        Self { positions: Vec::new(), slots: vec![EMPTY; 16], seeds: [0, 1].map(|k| random.hash_one(k)) }
    }

    /// The index of a position; `None` for more than 2^32 - 1 positions.
    pub(crate) fn index(&mut self, position: [f32; 3]) -> Option<u32> {
        let bits = position.map(f32::to_bits);
        let mut slot = self.hash(bits);
        loop {
            slot &= self.slots.len() - 1;
            match self.slots[slot] {
                EMPTY => break,
                index if self.positions[index as usize].map(f32::to_bits) == bits => return Some(index),
                _ => slot += 1,
            }
        }
        let index = u32::try_from(self.positions.len()).ok().filter(|&index| index != EMPTY)?;
        self.slots[slot] = index;
        self.positions.push(position);
        if self.positions.len() > self.slots.len() / 2 {
            self.grow();
        }
        Some(index)
    }

    /// All positions by index.
    pub(crate) fn finish(self) -> Vec<[f32; 3]> {
        self.positions
    }

    /// Doubles the table.
    fn grow(&mut self) {
        let mask = 2 * self.slots.len() - 1;
        self.slots = vec![EMPTY; mask + 1];
        for (&position, index) in self.positions.iter().zip(0..) {
            let mut slot = self.hash(position.map(f32::to_bits)) & mask;
            while self.slots[slot] != EMPTY {
                slot = (slot + 1) & mask;
            }
            self.slots[slot] = index;
        }
    }

    /// Both halves of a product of seeded words, combined.
    #[expect(clippy::cast_possible_truncation, reason = "a hash")]
    fn hash(&self, [x, y, z]: [u32; 3]) -> usize {
        let low = (u64::from(x) | u64::from(y) << 32) ^ self.seeds[0];
        let product = u128::from(low) * u128::from(u64::from(z) ^ self.seeds[1]);
        (product as u64 ^ (product >> 64) as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use proptest::prelude::*;

    use super::*;

    /// Few distinct values, both zeros and numbers that are not finite, so that equal positions are frequent.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, 1e7, 1e7 + 1.0, 1e-30, f32::NAN, f32::INFINITY])
    }

    proptest! {
        #[test]
        fn matches_a_hash_map(positions in prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..600)) {
            let (mut weld, mut first, mut distinct) = (Weld::new(), HashMap::new(), Vec::new());
            for &position in &positions {
                let bits = position.map(f32::to_bits);
                let want = *first.entry(bits).or_insert_with(|| {
                    distinct.push(bits);
                    distinct.len() - 1
                });
                prop_assert_eq!(weld.index(position).map(|index| index as usize), Some(want));
            }
            let got: Vec<_> = weld.finish().into_iter().map(|position| position.map(f32::to_bits)).collect();
            prop_assert_eq!(got, distinct);
        }
    }

    #[test]
    fn zeros_of_both_signs_stay_apart() {
        let mut weld = Weld::new();
        assert_ne!(weld.index([0.0; 3]), weld.index([-0.0, 0.0, 0.0]));
    }
}
