// The four texels about a point, however far it is.

fn footprint(seen: Seen, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    return Footprint(0.0, vec2(0.0), 1u);
}
