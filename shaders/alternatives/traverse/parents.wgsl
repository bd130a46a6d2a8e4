// Ways up a tree.
// use shared/node

/// A node's parent, and which of its children it is.
struct Link {
    word: u32,
    child: u32,
}

/// Of each line of nodes that a node begins at; the root's parent is an empty word.
@group(0) @binding(7) var<storage, read> links: array<Link>;

/// The place of a node among its parent's children.
fn link(word: u32) -> Link {
    return links[(space.first_node >> LINE_QUADS_LOG2) + (word & 0x1fffffffu)];
}

/// The least of eight keys.
fn least(a: vec4<u32>, b: vec4<u32>) -> u32 {
    let both = min(a, b);
    return min(min(both.x, both.y), min(both.z, both.w));
}
