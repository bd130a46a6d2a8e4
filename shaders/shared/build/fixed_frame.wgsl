// A frame that no node chose.

struct FixedFrame {
    frame: mat3x3<f32>,
    /// Not less than the greatest row sum of |F^T F - 1|.
    skewness: f32,
}

@group(0) @binding(4) var<uniform> fixed_frame: FixedFrame;
