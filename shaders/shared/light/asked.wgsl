// Shadow rays, one after another.

/// What a surface may get from a light of the list, if nothing stands along a ray.
struct Asked {
    /// Whether there is such a light.
    is_asked: bool,
    /// What the surface then reflects.
    radiance: vec3<f32>,
    ray: Ray,
    /// Lights of the list that were looked at so far.
    n_asked: u32,
    /// What it reflects of lights too close for anything to stand between.
    free: vec3<f32>,
}

const NO_RAY: Ray = Ray(vec3<f32>(), 0.0, vec3<f32>(), 0.0);
const NOT_ASKED: Asked = Asked(false, vec3<f32>(), NO_RAY, 0u, vec3<f32>());
