//! Records as plain words. Without a derive macro, which would be most of what a user's first build compiles.
#![expect(unsafe_code, reason = "plain words; each line says why it is sound")]

use bytemuck::{Pod, Zeroable};

use super::{CacheLine, ChildWord, HALF_BLOCK_WORDS, HalfBlock};

// No padding: the sizes are those of the words.
const _: () = assert!(size_of::<CacheLine>() == 64 && size_of::<ChildWord>() == 4);
const _: () = assert!(size_of::<HalfBlock>() == 4 * HALF_BLOCK_WORDS);

// SAFETY: an array of `u32` without padding; every bit pattern is one.
unsafe impl Zeroable for CacheLine {}
// SAFETY: as above, `repr(C)`.
unsafe impl Pod for CacheLine {}
// SAFETY: a `u32`.
unsafe impl Zeroable for ChildWord {}
// SAFETY: a `u32`, `repr(transparent)`.
unsafe impl Pod for ChildWord {}
// SAFETY: an array of `u32` without padding; every bit pattern is one.
unsafe impl Zeroable for HalfBlock {}
// SAFETY: as above, `repr(C)`.
unsafe impl Pod for HalfBlock {}
