// Kinds of wide nodes as their sizes in units of memory, and their words: the first cache line, and the kind. As in shared/node.

const ALIGNED: u32 = 1u;
const ORIENTED: u32 = 2u;

/// Cache lines of a unit of memory, which is an aligned node or half an oriented one.
const UNIT_LINES: u32 = 4u;

/// Bits of a word for the kind of an oriented node.
const ORIENTED_WORD: u32 = 0x20000000u;
