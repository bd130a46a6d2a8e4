// Lengths of vectors whose squares overflow or underflow.

/// The length of a vector; 0 if all components are subnormal.
fn length_of(v: vec3<f32>) -> f32 {
    let greatest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if greatest < 1.2e-38 {
        return 0.0;
    }
    return greatest * length(v / greatest);
}
