//! Kernels whose every index is proved, compiled without the checks that `wgpu` adds to each access and loop.
//!
//! The checks cost up to a tenth of the rays a second. Browsers keep them.
//!
//! What is proved, of the kernels of [`PROVED`]:
//!
//! * *Rays and answers*: an invocation without a ray returns first, by `arrayLength` of the rays; so does one whose list of rays ends
//!   before, by the length of the list, or names a ray that is not there. `ray_again` reads the same ray, because iterations are bounded.
//!   The host refuses fewer answers than rays, and lists of undecided rays with room for fewer than are traced (`trace/query`,
//!   `trace/stream`). The rows of a curve are those that the host wrote for its record (`trace/leaf_curves`).
//! * *Nodes, triangles, instances*: a BVH of the CPU is checked when it is built or loaded, so its words refer to its own nodes and triangles; nodes
//!   that the device builds are numbered from the sorted codes alone, whatever the vertices are. A node marks the children that are leaves
//!   by the bits of their words; the exponents beside these bits have eight bits, whatever the boxes are. The top level refers to the uploaded instances.
//! * *The stack*: it has an entry for each level of nodes, and the host makes it as large as the depth of the BVHs (`trace/scene`).
//! * *Rows of a node*: children are numbered by three bits.
//! * *Loops*: every one counts its iterations up to a constant, or a number that the word of a leaf limits to 32.
//! * *Divisions of integers*: by constants.
#![expect(unsafe_code, reason = "the functions of wgpu that skip checks or are experimental")]

use canted_shaders::{ShaderName, wgsl};
use wgpu::{
    Device, ExperimentalFeatures, PipelineCache, PipelineCacheDescriptor, ShaderModule, ShaderModuleDescriptor,
    ShaderRuntimeChecks,
};

/// Kernels whose text is this crate's and whose indices are proved.
const PROVED: [ShaderName; 3] =
    [wgsl::trace::CERTAIN_CLOSEST, wgsl::trace::CERTAIN_OCCLUDED, wgsl::trace::CERTAIN_WEIGHTS];

/// Whether a kernel needs no checks.
pub(crate) fn is_proved(kernel: ShaderName) -> bool {
    PROVED.contains(&kernel)
}

/// A module of a kernel that [`is_proved`], without checks.
pub(crate) fn module(device: &Device, kernel: ShaderName, descriptor: ShaderModuleDescriptor<'_>) -> ShaderModule {
    assert!(is_proved(kernel), "kernel '{kernel}' needs checks");
    // SAFETY: the text is that of a kernel of `PROVED`, for which the front page of this module shows that no index is out of bounds, that every
    // loop ends, and that nothing is divided by zero.
    unsafe { device.create_shader_module_trusted(descriptor, ShaderRuntimeChecks::unchecked()) }
}

/// The pipelines in `data`, which an earlier run got from a driver; none where the driver does not know them.
pub(crate) fn pipeline_cache(device: &Device, data: Option<&[u8]>) -> PipelineCache {
    let descriptor = PipelineCacheDescriptor { label: Some("pipelines"), data, fallback: true };
    // SAFETY: `data` is what `PipelineCache::get_data` returned: its file starts with a checksum (`pipelines`), and is in a folder of the user, who can
    // change this program, too. The driver refuses what is of another device or version.
    unsafe { device.create_pipeline_cache(&descriptor) }
}

/// Agrees to experimental features, for a device whose caller asks for ray queries of the driver.
pub(crate) fn experimental() -> ExperimentalFeatures {
    // SAFETY: of such features this crate requests ray queries alone. `trace/driver` builds acceleration structures from buffers and
    // instances that it checks and that outlive the build, `wgpu` checks the rest, and the kernels keep its checks of queries and rays.
    unsafe { ExperimentalFeatures::enabled() }
}
