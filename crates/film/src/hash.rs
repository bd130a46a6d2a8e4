use std::fmt::{Debug, Write};

/// A running hash of 64-bit words.
///
/// Each step is a bijection of the state for a given word, and of the word for a given state: inputs of the same length
/// that differ in one word never collide.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hash {
    state: u64,
    n_words: u64,
}

impl Hash {
    /// Adds a word.
    pub fn word(&mut self, word: u64) {
        // The finalizer of SplitMix64 (Steele et al. 2014), whose only fixed point is zero; the constant removes it.
        let x = (self.state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        self.state = x ^ (x >> 31);
        self.n_words += 1;
    }

    /// Adds words and their number.
    pub fn words(&mut self, words: impl IntoIterator<Item = u32>) {
        let before = self.n_words;
        for word in words {
            self.word(word.into());
        }
        self.word(self.n_words - before);
    }

    /// Adds bytes and their number.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.word(u64::from_le_bytes(word));
        }
        self.word(bytes.len() as u64);
    }

    /// The hash of everything added.
    #[must_use]
    pub fn finish(mut self) -> u64 {
        self.word(self.n_words);
        self.state
    }

    /// Adds the bits of floats and their number.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) {
        self.words(values.iter().flatten().map(|x| x.to_bits()));
    }

    /// Adds the `Debug` text of a value, which has every field and exact floats.
    pub fn debug(&mut self, value: &dyn Debug) {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(text, "{value:?}");
        self.bytes(text.as_bytes());
    }
}
