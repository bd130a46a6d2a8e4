// A point that receives light.

struct Receiver {
    position: vec3<f32>,
    /// Whether light from behind the triangle counts.
    transmits: bool,
    /// Unit normal of the triangle.
    normal: vec3<f32>,
    /// Unit normal to shade with.
    shading_normal: vec3<f32>,
}
