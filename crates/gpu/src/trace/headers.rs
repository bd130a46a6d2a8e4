//! The bounds that the headers of BVHs hold, computed on the device.

use bytemuck::{Pod, Zeroable};

use super::TracedScene;
use super::binary::CENTER_REACH;
use super::layout::{BvhHeader, HIT_ERROR};
use crate::build::{Built, Run, Scales};
use crate::{GpuError, NamedBinding};

/// `HeaderScale` of `build/headers`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct HeaderScale {
    reach: f32,
    error: f32,
    first_header: u32,
}

/// The scales of a level with these volumes.
pub(super) fn scales(is_oriented: bool) -> Scales {
    Scales { reach: if is_oriented { CENTER_REACH } else { 1.0 }, error: HIT_ERROR }
}

/// Writes the bounds of a range of trees into the headers of a scene, in which the level's first tree has header `first_header`.
pub(super) fn put_headers(
    run: &mut Run<'_>,
    built: &Built,
    scene: &TracedScene,
    first_header: u32,
    trees: [u32; 2],
) -> Result<(), GpuError> {
    let gpu = run.gpu();
    let Scales { reach, error } = scales(built.obbs.is_some());
    let scale = gpu.uniform("scale of headers", &HeaderScale { reach, error, first_header })?;
    let more: [NamedBinding<'_>; 3] = [("aabbs", &built.aabbs), ("headers", scene.headers()), ("header_scale", &scale)];
    let bound = built.items.bound(&more);
    run.stage("headers", |dispatches| {
        let kernel = gpu.kernel("build/headers", &built.items.part())?;
        dispatches.range(&kernel, &bound, trees)
    })
}

// The kernel writes four quads per header.
const _: () = assert!(size_of::<BvhHeader>() == 64);
