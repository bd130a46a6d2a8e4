// Nodes along the axes alone: of trees without any other.
// use shared/node

/// Keys of four children of a node.
fn enter(word: u32, half: u32, t_max: f32) -> vec4<u32> {
    return enter_box(quads_of(word) + half, half, t_max);
}

/// The word of a child.
fn child_word(word: u32, child: u32) -> u32 {
    return nodes[quads_of(word) + 12u + (child >> 2u)][child & 3u];
}
