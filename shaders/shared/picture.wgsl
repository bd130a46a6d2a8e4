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

/// Work-groups of a dispatch. Each takes a block of samples of 64 / block pixels of a cell of 8 x 8.
struct Slice {
    /// Index of the first work-group among those of all cells and samples.
    first_group: u32,
    /// One past the last.
    end_group: u32,
    first_sample: u32,
    /// Samples per pixel, and work-groups per cell.
    n_samples: u32,
    /// Samples of a pixel that a work-group takes: a power of two up to 64 that divides `n_samples`.
    block: u32,
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

/// The sample of an invocation. A cell takes one block of all its pixels after the other; in a block, the samples of a pixel are
/// neighbors.
fn taken(group: u32, local: u32) -> PixelSample {
    let number = slice.first_group + group;
    if number >= slice.end_group {
        return PixelSample(vec2(0u), 0u, 0u, false);
    }
    let cell = cells[number / slice.n_samples];
    let group_of_cell = number % slice.n_samples;
    let pixel_of_cell = (64u * (group_of_cell % slice.block) + local) / slice.block;
    let first = slice.first_sample + group_of_cell - group_of_cell % slice.block;
    let at = 8u * vec2(cell & 0xffffu, cell >> 16u) + vec2(pixel_of_cell % 8u, pixel_of_cell / 8u);
    let is_inside = at.x < picture.size.x && at.y < picture.size.y;
    return PixelSample(at, at.y * picture.size.x + at.x, first + local % slice.block, is_inside);
}

/// The point of the unit square of a sample for `dimension`.
fn square(one: PixelSample, dimension: u32) -> vec2<f32> {
    return pair(picture.sampler, one.pixel, one.sample, dimension);
}
