// A digit of the radix sort, and the tiles of keys that work-groups process.
// use shared/build/slice
// const GROUP
// const KEYS_EACH
// const RADIX

const TILE: u32 = GROUP * KEYS_EACH;

struct Digit {
    n_keys: u32,
    n_tiles: u32,
    /// Lowest bit of the digit.
    shift: u32,
}

@group(0) @binding(1) var<uniform> digit: Digit;

/// The digit of a key.
fn digit_of(key: u32) -> u32 {
    return (key >> digit.shift) & (RADIX - 1u);
}

/// Tile of a work-group. Tiles at or beyond `slice.end` do not exist.
fn tile_of(id: Invocation) -> u32 {
    return slice.first + group_index(id);
}
