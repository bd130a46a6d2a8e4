// Nothing shines from outside.

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}
