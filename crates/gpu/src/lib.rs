//! BVH construction, ray tracing and raster passes on the GPU, through `wgpu` 30.
//!
//! # In a wgpu program
//!
//! A program keeps its device, its buffers and its kernels. This crate builds a BVH over the program's vertex and index buffers, and adds
//! `closest_hit(ray)` and `occluded(ray)` to the program's kernel:
//!
//! ```no_run
//! use canted_gpu::{BufferScene, Gpu, IndexBuffer, MeshBuffers, block_on, build::WideConfig};
//!
//! # fn example(device: wgpu::Device, queue: wgpu::Queue, vertices: wgpu::Buffer, indices: wgpu::Buffer, own: wgpu::BindGroup) -> Result<(), canted_gpu::GpuError> {
//! // 1. Buffers with the usage STORAGE: here 1,000 vertices of 32 bytes and 2,000 triangles. Submit what fills them before the next step.
//! let mesh = MeshBuffers {
//!     vertices: &vertices,
//!     first_byte: 0,
//!     stride: 32,
//!     n_vertices: 1000,
//!     indices: Some(IndexBuffer { buffer: &indices, format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
//!     n_triangles: 2000,
//! };
//! // 2. A BVH over them.
//! let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
//! let mut scene = block_on(BufferScene::new(&gpu, &[mesh], WideConfig::default()))?;
//! // 3. The program's kernel: bind group 0 is its own, bind group 1 has the BVH.
//! let text = scene.traced().module(1)? + "
//!     @group(0) @binding(0) var<storage, read_write> distances: array<f32>;
//!     @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
//!         let hit = closest_hit(ray(vec3f(f32(id.x), 0.0, 9.0), vec3f(0.0, 0.0, -1.0), 3e38));
//!         distances[id.x] = select(hit.t, -1.0, hit.instance == NONE);
//!     }";
//! let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source: wgpu::ShaderSource::Wgsl(text.into()) });
//! let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
//!     label: None,
//!     layout: None,
//!     module: &module,
//!     entry_point: Some("main"),
//!     compilation_options: Default::default(),
//!     cache: None,
//! });
//! let traversal = scene.traced().bind_group(&gpu, &pipeline.get_bind_group_layout(1))?; // valid as long as the scene
//!
//! // 4. Each frame: the BVH follows the vertices, and the kernel traces rays.
//! let mut encoder = device.create_command_encoder(&Default::default());
//! scene.rebuild(&gpu, &mut encoder, &[mesh])?;
//! let mut pass = encoder.begin_compute_pass(&Default::default());
//! pass.set_pipeline(&pipeline);
//! pass.set_bind_group(0, &own, &[]);
//! pass.set_bind_group(1, &traversal, &[]);
//! pass.dispatch_workgroups(16, 1, 1);
//! drop(pass);
//! queue.submit([encoder.finish()]);
//! # Ok(())
//! # }
//! ```
//!
//! Device and queue come from the `wgpu` that this crate re-exports. [`InstancedScene`] does the same for instances, whose transforms are in a
//! buffer. The examples `wgpu-pick` and `wgpu-ao` are complete programs.
//!
//! # Batches of rays
//!
//! ```no_run
//! use canted_gpu::{Choice, Gpu, Options, Outcome, Source, TracedScene, block_on, build::WideConfig};
//! use canted_trace::Ray;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let gpu = block_on(Gpu::open(&Choice::Best))?;
//! let mesh = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
//! let source = Source::build([&mesh], WideConfig::default());
//! let scene = block_on(TracedScene::new(&gpu, source, Options::default()))?;
//! let hits = block_on(scene.closest_hits(&gpu, &[Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])]))?;
//! assert!(matches!(hits[0], Outcome::Complete(Some(hit)) if hit.t == 1.0));
//! # Ok(())
//! # }
//! ```
//!
//! A few thousand rays are faster on the CPU, because each batch is uploaded and read back.
//!
//! # Types
//!
//! | type | purpose |
//! |---|---|
//! | [`Gpu`], [`Choice`] | an open device; which adapter to open |
//! | [`BufferScene`], [`MeshBuffers`] | a BVH over vertex and index buffers of a program, rebuilt and refitted in its command encoder |
//! | [`InstancedScene`], [`InstanceBuffer`] | the same with instances, whose transforms are in a buffer of the program |
//! | [`DeviceBvh`] | which BVH: eight-wide or binary, and its boxes |
//! | [`TracedScene`], [`Source`], [`HostBvh`], [`Options`] | BVHs and instances in device memory, for ray batches and for kernels of a program |
//! | [`StreamQueries`], [`RayList`] | queries of rays that kernels wrote |
//! | [`TracedScene::download`], [`DownloadedBvh`] | a BVH of the device as one of the CPU, checked |
//! | [`build`] | BVH construction on the device, stage by stage |
//! | [`Buffer`], [`Kernel`], [`Commands`] | typed buffers, compiled kernels, dispatches |
//! | [`RasterPipeline`], [`Draw`] | raster passes into integer targets |
//! | [`Traffic`] | counters of uploaded and downloaded bytes, and of dispatches |
//!
//! # Limits
//!
//! No optional `wgpu` feature is required. Only [`Source::DriverRayQueries`] needs one, `EXPERIMENTAL_RAY_QUERY`, which
//! [`Gpu::with_ray_queries`] asks for; a program's own device needs the limits of `wgpu::Limits::using_acceleration_structure_values`, too.
//!
//! | limit of the device | required |
//! |---|---|
//! | `max_storage_buffers_per_shader_stage` | 8 to build and to trace batches, the default of `wgpu` and WebGPU. The module takes 3 of those of your kernel: see [`Gpu::check_module`] |
//! | `max_buffers_and_acceleration_structures_per_shader_stage` | the sum of storage and uniform buffers, and of acceleration structures: the default is enough but for pictures |
//! | `max_storage_buffer_binding_size` | bounds the number of triangles: see [`DeviceBvh`] |
//!
//! A device with `Limits::downlevel_defaults` has 4 storage buffers, which is too few. Kernels that render pictures take up to 31
//! ([`canted_shaders::MAX_STORAGE_BUFFERS`]), depending on the scene. What exceeds a limit is reported by [`GpuError::Limit`].
//!
//! # Motion blur
//!
//! In this crate an instance *moves* if it has two transforms, for the two ends of the time that a shutter is open: [`Source::Tlas`] and
//! [`Source::Build`] accept those. Instances of an [`InstancedScene`] have one transform. Changing it between frames costs no binding, and no
//! guarantee becomes weaker.
//!
//! # Buffers of a scene
//!
//! [`TracedScene::module`] reads these buffers, and [`TracedScene::bind_group`] binds them, all as read-only storage: bindings 0 and 1 as they are, and all
//! others as one buffer with binding 2, where each starts at the next multiple of 256 bytes, in the order of the table. Kernels of this crate bind each.
//! [`TracedScene::buffer`] has the buffers themselves, for programs that read them in other ways. All numbers are 32 bits wide. A row is four of
//! them, 16 bytes, and aligned to 16 bytes.
//!
//! | binding | where | content |
//! |---|---|---|
//! | 0 `nodes` | always | nodes of all BVHs, see below |
//! | 1 `corners` | binary BVHs | nine coordinates per triangle, in the order of the meshes |
//! | 1 `leaf_triangles` | wide BVHs | three rows for each triangle, in the order of leaves: a vertex in each, its number in the last word of the first, and whether it is [masked](Options::masked) in that of the second; or for each round segment: an end in two rows, the radii in the third; of other curves the third ends with the place of their control balls, from which on `shared/curve` documents them |
//! | 2 `bvhs` | always | a `Bvh` for each BVH, that of the top level first; in an [`InstancedScene`] the last is empty, for instances that are not placed |
//! | 3 `instances` | two levels | an `Instance` for each |
//! | 3 `first_triangles` | one level over several meshes | the number of the first triangle of each |
//! | 4 `instance_order` | two levels | the instance of each item of the top level |
//! | 5 `motions` | instances with motion blur | a `Motion` for each of these |
//!
//! | structure | bytes | members and their offsets |
//! |---|---|---|
//! | `Bvh` | 64 | `row_x` 0, `row_y` 16, `row_z` 32, `words` 48 |
//! | `Instance` | 160 | `row_x` 0, `row_y` 16, `row_z` 32, `bvh` 48, `exact_rows` 64 |
//! | `Motion` | 224 | `cofactors` 0, `determinant` 144, `x` 160, `y` 176, `z` 192, `shift` 208 |
//! | `Ray` | 32 | `origin` 0, `t_min` 12, `direction` 16, `t_max` 28 |
//! | `Hit` | 20 | `t` 0, `u` 4, `v` 8, `primitive` 12, `instance` 16 |
//!
//! `Hit` of [`TracedScene::module`] has one more member, `place` 20, and 24 bytes: [`ModuleHit`].
//!
//! `Bvh`:
//!
//! | member | first three components | fourth component |
//! |---|---|---|
//! | `row_x` | first row of the mesh's frame | greatest absolute coordinate |
//! | `row_y` | second row | error of hits, per coordinate of the ray's origin |
//! | `row_z` | third row | error of hits, constant part |
//!
//! Its `words` are the word of the root; the first row of its nodes in `nodes`, or 0 in binary BVHs; the first triangle, or the first row
//! of its triangles; and whether the frame is rotated.
//!
//! `Instance`: `row_x` to `row_z` have the rows of the linear part of `object_from_world`, and in their fourth components the world position of the
//! object's origin. `bvh.x` is an index into `bvhs`: mesh *i* has *i* + 1, because the top level comes first. `bvh.y` is an index into
//! `motions` plus 1, or 0. `bvh.z` is the mask. `bvh.w` is 1 if the BVH is over curves. `exact_rows` are the rows of `object_from_world` as `f64`, translations last, lower halves first.
//!
//! A **word** stands for a child or a root. `0x7fffffff` is none.
//!
//! | BVH | bit 31 is 1: a leaf | bit 31 is 0: a node |
//! |---|---|---|
//! | binary | the other bits are an index into `corners`, or in the top level into `instance_order` | an index into `nodes`, in nodes, whichever BVH it belongs to |
//! | wide | bits 26 to 30: triangles or instances, less one. Bits 0 to 25: the first triangle, counted from that of the BVH; in the top level, an index into `instance_order` | bits 29 and 30: the kind, 0 aligned, 1 oriented. Bits 0 to 28: distance from the first node of the BVH, in units of 32 bytes |
//!
//! A binary node is two children. In a BVH with axis-aligned boxes ([`Strategy::Aabb`]) a node has 64 bytes and a child two rows: lower ends and word, upper
//! ends and zero. In all others a node has 128 bytes and a child four rows: three times an axis and the half-extent along it, then center and word.
//!
//! A wide node has eight children, whose words come first. An aligned node has 96 bytes. Its third row is the point at which its boxes start and a word: in three
//! bytes the exponents of the steps along x, y and z, biased as in `f32`, in the fourth a bit for each child that is a leaf. Then there are the ends of the boxes
//! in steps, a byte each. Two rows, for the first and the last four children, have a word each for the lower ends along x, the upper ones, and the same along y; the last
//! row has those along z of the first four children and of the last. Ends are rounded outward by 2^-12 of a step more than needed. Of a child that does not exist they are 255 and 0.
//!
//! An oriented node has 256 bytes: after the words there are double rows with a frame for each child, and with the center and the half-extent along each of
//! three axes. A frame is the rotation by a quaternion `(2470, a, b, c)`; a, b, c are integers of 11 bits with signs, from bits 0, 11 and 21 on.
//! The axes are the rows of its matrix divided by 2^23, whose length is below 1. Only the CPU builds leaves of more than four triangles.
//!
//! # Guarantees
//!
//! * A ray hits a triangle on the GPU exactly where it does on the CPU, by the watertight test: where single precision does not decide,
//!   integers repeat the CPU's arithmetic. `t` is rounded by at most [`HIT_ERROR`], relative to the coordinates. So where two hits are closer to each
//!   other than that, the GPU may return either; and where `t` is that close to `t_min` or `t_max`, it may differ from the CPU whether there is a hit.
//!   Instances with [motion](#motion-blur) may have additional hits within [`HIT_ERROR`] of the ray.
//! * A batch of rays has the CPU's hits on curves, or leaves the ray to the CPU ([`Outcome::Incomplete`]); kernels that use the traversal take the answer of
//!   single precision, which is within [`HIT_ERROR`] of the surface.
//! * Morton codes, sort order and topology, by radix or by clustering, are the same integers as on the CPU; clustering does so for triangles larger
//!   than about 1e-18, whose areas are not zero. Equal input gives equal words of wide nodes on a device, and on others too, but for bytes of boxes, in which roundings
//!   may differ; volumes enclose their primitives.
//! * Work-groups exchange data between dispatches, or through atomic words that are both data and flag. No work-group waits for
//!   another, and no subgroup size is assumed.
//! * Without an adapter [`Gpu::open`] returns an error. A software driver counts as an adapter.
//! * None of this holds for hits of [`Source::DriverRayQueries`]: they are those of the driver.
//!
//! # In browsers
//!
//! The crate compiles for `wasm32-unknown-unknown` and uses WebGPU there. Each call that waits for the device is an `async fn`, such as [`Gpu::open`],
//! [`TracedScene::closest_hits`] and [`Gpu::read`]. Nothing may block in a browser, so a page awaits them; [`block_on`] returns [`GpuError::Blocking`] there where it
//! would have to wait. `rebuild`, `refit`, `update_top`, `module` and `bind_group` never wait. Errors of the device arrive with a later call. Stages are not timed.
//! Outside of browsers the futures are ready when they are polled first, so [`block_on`] or any executor runs them. The example `browser` is a page that builds and traces the
//! built-in scene.
//!
//! # Tested on
//!
//! The software drivers of Mesa (llvmpipe) and, in a browser, of Chromium (SwiftShader) only; an NVIDIA H200 passed 28 of 29 tests of rays
//! with the kernels of 2026-11-28, and lacked a file for one (`benches/results/device.md`). No device with ray queries of its own has run [`Source::DriverRayQueries`].
//! Vulkan, Metal and DX12 are enabled in `wgpu`, and WebGPU in browsers.
#![deny(unsafe_code)]

mod adapter;
mod buffer;
pub mod build;
mod commands;
mod device;
mod error;
mod kernel;
mod memory;
mod pipelines;
mod raster;
mod staging;
#[cfg(not(target_family = "wasm"))]
mod timeout;
mod trace;
mod trusted;
mod wait;

pub use adapter::{AdapterInfo, AdapterKind, Choice, adapters};
pub use buffer::Buffer;
pub use build::{DeviceInstance, IndexBuffer, InstanceBuffer, MeshBuffers, NOT_PLACED};
pub use canted_lbvh::{Bits, Strategy};
pub use canted_obb::Affine;
pub use canted_shaders::{ModuleOptions, Number, Override, ShaderName, Variant, choice, wgsl};
pub use commands::{AsBinding, Commands, NamedBinding, PassTime, loop_iterations};
pub use device::Gpu;
pub use error::GpuError;
pub use kernel::Kernel;
pub use memory::Traffic;
pub use raster::{Draw, N_TARGETS, RasterOutput, RasterPipeline};
pub use trace::{
    BufferConfig, BufferScene, DeviceBvh, DeviceCurve, DeviceHit, DeviceRay, DownloadedBvh, HIT_ERROR, HostBvh,
    HostCurves, InstancedScene, MAX_CONDITION, MAX_COORDINATE, ModuleHit, MotionPolynomials, Options, Outcome, RayList,
    Source, StreamQueries, TracedScene,
};
pub use wait::block_on;
pub use wgpu::{self, Limits};
