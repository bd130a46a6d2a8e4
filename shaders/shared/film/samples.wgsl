// Every sample by itself: the host sums them in f64.
// use shared/picture
// use shared/trace

/// Radiance of each sample, linear RGB, and the rays traced for it, -1 where one of them was cut short: for each work-group its
/// 64 pixels, row by row.
@group(1) @binding(4) var<storage, read_write> samples: array<vec4<f32>>;

fn keep(group: u32, local: u32, radiance: vec3<f32>, n_rays: u32) {
    samples[64u * group + local] = vec4(radiance, select(f32(n_rays), -1.0, is_incomplete));
}
