// What `shared/undecided` listed, for the kernel that takes it.

/// As `Undecided`.
struct Listed {
    x: u32,
    y: u32,
    z: u32,
    n: u32,
    indices: array<u32>,
}

@group(1) @binding(15) var<storage, read> listed: Listed;
