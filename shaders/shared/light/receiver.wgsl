// A point that receives light.

struct Receiver {
    position: vec3<f32>,
    /// Unit normal to shade with.
    normal: vec3<f32>,
    /// Whether light from behind the normal counts.
    transmits: bool,
}
