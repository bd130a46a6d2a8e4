// A square as wide as the longer axis of what the ray's cone covers.
// use shared/square_footprint

fn footprint(seen: Seen, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    return square_footprint(seen, along, texels);
}
