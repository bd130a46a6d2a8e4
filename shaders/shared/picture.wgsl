// Parameters of a picture, and the samples that a dispatch takes.
// use shared/sampler

struct Picture {
    eye: vec3<f32>,
    /// Side of a pixel, on the plane at distance 1 for a perspective camera.
    pixel: f32,
    /// Unit vector along the view axis.
    forward: vec3<f32>,
    /// 0 for a pinhole.
    lens_radius: f32,
    /// Step of one pixel to the right, on that plane.
    right: vec3<f32>,
    focus_distance: f32,
    /// Step of one pixel down, on that plane.
    down: vec3<f32>,
    /// Radius of the filter in pixels.
    filter_radius: f32,
    /// Columns and rows of pixels.
    size: vec2<u32>,
    bounces: u32,
    /// Reciprocal of the ambient occlusion radius; 0 for an infinite radius.
    inverse_ao_radius: f32,
    sampler: Sampler,
    /// Mean radiance of the environment.
    ambient: vec3<f32>,
    /// Error along each axis between the plane of a triangle and a ray that leaves it, for a single-level scene.
    slack: f32,
}

/// Work-groups of a dispatch. Each takes one sample of the 8 x 8 pixels of a cell.
struct Slice {
    /// Index of the first work-group among those of all cells and samples.
    first_group: u32,
    /// One past the last.
    end_group: u32,
    first_sample: u32,
    /// Samples per cell.
    n_samples: u32,
}

@group(1) @binding(0) var<uniform> picture: Picture;
@group(1) @binding(1) var<uniform> slice: Slice;
/// Position of each cell: column in the lower 16 bits, row in the upper.
@group(1) @binding(2) var<storage, read> cells: array<u32>;

/// One sample of a pixel.
struct PixelSample {
    /// Column and row of the pixel.
    at: vec2<u32>,
    /// Index of the pixel.
    pixel: u32,
    sample: u32,
    /// False outside the picture or the dispatch.
    is_inside: bool,
}

/// The sample of an invocation.
fn taken(group: u32, local: u32) -> PixelSample {
    let number = slice.first_group + group;
    if number >= slice.end_group {
        return PixelSample(vec2(0u), 0u, 0u, false);
    }
    let cell = cells[number / slice.n_samples];
    let at = 8u * vec2(cell & 0xffffu, cell >> 16u) + vec2(local % 8u, local / 8u);
    let sample = slice.first_sample + number % slice.n_samples;
    return PixelSample(at, at.y * picture.size.x + at.x, sample, at.x < picture.size.x && at.y < picture.size.y);
}

/// The point of the unit square of a sample for `dimension`.
fn square(one: PixelSample, dimension: u32) -> vec2<f32> {
    return pair(picture.sampler, one.pixel, one.sample, dimension);
}

// part film
// Stores every sample; the host sums them in f64.
// use ?traverse

/// Linear RGB radiance of each sample, and the number of rays traced, -1 if one was incomplete. 64 pixels per work-group, row
/// by row.
@group(1) @binding(4) var<storage, read_write> samples: array<vec4<f32>>;

fn keep(group: u32, local: u32, radiance: vec3<f32>, n_rays: u32) {
    samples[64u * group + local] = vec4(radiance, select(f32(n_rays), -1.0, is_incomplete));
}
