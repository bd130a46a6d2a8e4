// The same light from everywhere.
// use shared/picture

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return picture.ambient;
}
