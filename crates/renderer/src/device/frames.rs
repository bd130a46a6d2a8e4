//! The acceleration structure of a sequence of frames on a device: only what changed is uploaded.
//!
//! ```text
//! BVHs of the CPU      updated there -> chunks that differ -> device
//! BVHs of the device   vertices, transforms -> chunks that differ -> device -> changed meshes: refit or rebuild -> top level
//! ```

use std::borrow::Cow;

use std::sync::Arc;

use canted_film::Hash;
use canted_gpu::build::WideConfig;
use canted_gpu::{
    Buffer, BufferConfig, BufferScene, DeviceBvh, DeviceInstance, Gpu, GpuError, IndexBuffer, InstanceBuffer,
    InstancedScene, MAX_CONDITION, MeshBuffers, TracedScene, block_on, wgpu,
};
use canted_obb::Affine;
use canted_scene::{Mesh, Scene};

use super::DeviceError;
use super::picture::Pace;
use crate::UpdatePolicy;
use crate::coincident;
use crate::scene_bvh::flatten_distinct;

/// What the frames of a sequence share on a device.
///
/// Pass it to [`DevicePicture::in_frame`](crate::DevicePicture::in_frame) for each frame.
#[derive(Default)]
pub struct DeviceFrames {
    policy: UpdatePolicy,
    /// How the device builds wide BVHs, where it does.
    wide: Option<WideConfig>,
    kept: Option<Kept>,
    updates: DeviceUpdates,
    fallback_reason: Option<String>,
    pace: Arc<Pace>,
}

/// Most meshes that are updated one by one. Each takes ten dispatches or more, and with oriented boxes a refit of one mesh computes those of all; so
/// beyond, all meshes are updated together.
const MOST_ALONE: usize = 8;

/// What frames did with the BVHs that the device builds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceUpdates {
    /// Builds of all BVHs.
    pub whole: usize,
    /// Refits of BVHs over triangles whose vertices changed.
    pub refits: usize,
    /// Rebuilds of BVHs over triangles whose vertices changed.
    pub rebuilds: usize,
    /// Rebuilds of the top level.
    pub top_rebuilds: usize,
}

/// BVHs on a device, and what they were built for.
struct Kept {
    bvh: DeviceBvh,
    levels: Levels,
    /// Hashes of the positions and triangles of each mesh, or of all.
    meshes: Vec<[u64; 2]>,
    /// First triangle of each instance in one level.
    first: Vec<u32>,
    transforms: Vec<DeviceInstance>,
}

#[expect(clippy::large_enum_variant, reason = "a sequence has one")]
enum Levels {
    One(BufferScene),
    Two(InstancedScene),
}

/// Positions and triangles of a mesh, on the device and on the host.
type MeshThere = (Buffer<[f32; 3]>, Buffer<[u32; 3]>);
type MeshHere<'a> = (Cow<'a, [[f32; 3]]>, Cow<'a, [[u32; 3]]>);

/// The buffers of a frame.
struct Uploaded {
    meshes: Vec<MeshThere>,
    transforms: Option<Buffer<DeviceInstance>>,
}

impl DeviceFrames {
    /// Frames whose deforming meshes are updated by this policy. With [`UpdatePolicy::Auto`] the device rebuilds them, because a rebuild costs it
    /// little more than a refit and the drift is not read back.
    #[must_use]
    pub fn new(policy: UpdatePolicy) -> Self {
        Self { policy, ..Self::default() }
    }

    /// The same with wide BVHs that the device builds, instead of those of the CPU. The topology is that of the first frame's build; rebuilds
    /// use the radix tree.
    #[must_use]
    pub fn with_wide(self, wide: WideConfig) -> Self {
        Self { wide: Some(wide), ..self }
    }

    /// How the device builds wide BVHs.
    pub(super) fn wide(&self) -> Option<WideConfig> {
        self.wide
    }

    /// What was done so far.
    #[must_use]
    pub fn updates(&self) -> DeviceUpdates {
        self.updates
    }

    /// Why the CPU's BVHs were used in a frame whose BVHs the device could not build; the first reason, as a sentence.
    #[must_use]
    pub fn fallback_reason(&self) -> Option<&str> {
        self.fallback_reason.as_deref()
    }

    /// What pictures of earlier frames took.
    pub(super) fn pace(&self) -> Arc<Pace> {
        self.pace.clone()
    }

    /// Expects the times of fast hardware in the next frame, to count what it takes there.
    #[doc(hidden)]
    pub fn expect_hardware(&self) {
        self.pace.expect_hardware();
    }

    /// Frees the BVHs of the last frame, which this frame does not use.
    pub(super) fn forget(&mut self) {
        self.kept = None;
    }

    /// BVHs that the device builds over a scene: those of the last frame, updated, or new ones.
    pub(super) fn built(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        bvh: DeviceBvh,
        is_flat: bool,
    ) -> Result<&TracedScene, DeviceError> {
        let done = self.update_or_build(gpu, scene, bvh, is_flat);
        if let Err(DeviceError::Gpu(error)) = &done
            && error.is_of_scene()
        {
            self.kept = None;
            self.fallback_reason.get_or_insert_with(|| error.to_string());
        }
        done?;
        Ok(match &self.kept.as_ref().expect("built above").levels {
            Levels::One(one) => one.traced(),
            Levels::Two(two) => two.traced(),
        })
    }

    fn update_or_build(&mut self, gpu: &Gpu, scene: &Scene, bvh: DeviceBvh, is_flat: bool) -> Result<(), DeviceError> {
        let frame = if is_flat { Frame::flat(scene)? } else { Frame::two_levels(scene) };
        let uploaded = frame.upload(gpu)?;
        let is_kept = self.kept.as_ref().is_some_and(|kept| kept.bvh == bvh && kept.fits(&frame));
        match self.kept.as_mut().filter(|_| is_kept) {
            Some(kept) => kept.update(gpu, &frame, &uploaded, self.policy, &mut self.updates)?,
            None => {
                // Two structures at once may not fit.
                self.kept = None;
                self.kept = Some(Kept::new(gpu, &frame, &uploaded, bvh)?);
                self.updates.whole += 1;
            }
        }
        Ok(())
    }
}

/// A state of a scene, as devices build BVHs over it.
struct Frame<'a> {
    /// Positions and triangles of each mesh, or of all instances in world space.
    meshes: Vec<MeshHere<'a>>,
    keys: Vec<[u64; 2]>,
    first: Vec<u32>,
    transforms: Option<Vec<DeviceInstance>>,
    /// Whether the device finds no fault in coordinates and transforms, so that nothing is read back to know it.
    is_sound: bool,
}

impl<'a> Frame<'a> {
    fn flat(scene: &'a Scene) -> Result<Self, DeviceError> {
        let (positions, triangles, first) = flatten_distinct(scene)?;
        let keys = vec![key(&positions, &triangles)];
        let is_sound = reach(&positions) <= FAR;
        Ok(Self { meshes: vec![(positions.into(), triangles.into())], keys, first, transforms: None, is_sound })
    }

    fn two_levels(scene: &'a Scene) -> Self {
        let of = |mesh: &'a Mesh| ((&mesh.positions[..]).into(), coincident::of_mesh(scene, mesh));
        let transforms =
            scene.instances.iter().map(|instance| DeviceInstance::new(instance.mesh.0, &instance.world_from_object));
        let meshes: Vec<MeshHere<'a>> = scene.meshes.iter().map(of).collect();
        let reaches: Vec<f32> = meshes.iter().map(|(positions, _)| reach(positions)).collect();
        let is_placed = |instance: &canted_scene::Instance| {
            reaches.get(instance.mesh.0 as usize).is_some_and(|&reach| is_placed(&instance.world_from_object, reach))
        };
        let is_sound = reaches.iter().all(|&reach| reach <= FAR) && scene.instances.iter().all(is_placed);
        Self {
            is_sound,
            keys: meshes.iter().map(|(positions, triangles)| key(positions, triangles)).collect(),
            meshes,
            first: vec![],
            transforms: Some(transforms.collect()),
        }
    }

    /// Whether a first build finds no fault in indices either. Later ones have the same.
    fn has_sound_indices(&self) -> bool {
        let is_sound = |(positions, triangles): &MeshHere<'_>| {
            triangles.iter().flatten().all(|&index| (index as usize) < positions.len())
        };
        self.meshes.iter().all(is_sound)
    }

    fn upload(&self, gpu: &Gpu) -> Result<Uploaded, GpuError> {
        let mesh = |(positions, triangles): &(Cow<'_, [_]>, Cow<'_, [_]>)| {
            Ok((gpu.read_only("positions", positions)?, gpu.read_only("triangle indices", triangles)?))
        };
        let transforms = self.transforms.as_ref().map(|transforms| gpu.read_only("transforms", transforms));
        Ok(Uploaded {
            meshes: self.meshes.iter().map(mesh).collect::<Result<_, GpuError>>()?,
            transforms: transforms.transpose()?,
        })
    }
}

impl Uploaded {
    /// The meshes as the device gathers them.
    fn meshes<'a>(&'a self) -> Vec<MeshBuffers<'a>> {
        let mesh = |(positions, triangles): &'a MeshThere| {
            let indices = IndexBuffer { buffer: triangles.wgpu(), format: wgpu::IndexFormat::Uint32, first_byte: 0 };
            MeshBuffers {
                vertices: positions.wgpu(),
                first_byte: 0,
                stride: 12,
                n_vertices: count(positions.len()),
                indices: Some(indices),
                n_triangles: count(triangles.len()),
            }
        };
        self.meshes.iter().map(mesh).collect()
    }

    fn instances(&self) -> Option<InstanceBuffer<'_>> {
        let transforms = self.transforms.as_ref()?;
        let n_instances = count(transforms.len());
        let stride = size_of::<DeviceInstance>() as u64;
        Some(InstanceBuffer { buffer: transforms.wgpu(), first_byte: 0, stride, n_instances, has_masks: false })
    }
}

impl Kept {
    fn new(gpu: &Gpu, frame: &Frame<'_>, uploaded: &Uploaded, bvh: DeviceBvh) -> Result<Self, DeviceError> {
        let meshes = uploaded.meshes();
        let is_checked = !(frame.is_sound && frame.has_sound_indices());
        let config = BufferConfig { is_checked, ..bvh.into() };
        let levels = match uploaded.instances() {
            None => Levels::One(block_on(BufferScene::new(
                gpu,
                &meshes,
                BufferConfig { parts: Some(&frame.first), ..config },
            ))?),
            Some(instances) => Levels::Two(block_on(InstancedScene::new(gpu, &meshes, &instances, config))?),
        };
        let transforms = frame.transforms.clone().unwrap_or_default();
        Ok(Self { bvh, levels, meshes: frame.keys.clone(), first: frame.first.clone(), transforms })
    }

    /// Whether the BVHs can be updated to a frame: the same levels, and as many triangles and instances.
    fn fits(&self, frame: &Frame<'_>) -> bool {
        let is_two = matches!(self.levels, Levels::Two(_));
        let n_instances = frame.transforms.as_ref().map_or(0, Vec::len);
        is_two == frame.transforms.is_some()
            && self.first == frame.first
            && self.transforms.len() == n_instances
            && self.meshes.len() == frame.keys.len()
            && self.meshes.iter().zip(&frame.keys).all(|(before, now)| before[1] == now[1])
    }

    /// Updates what changed: meshes with other vertices, and the top level if any of them or an instance changed.
    fn update(
        &mut self,
        gpu: &Gpu,
        frame: &Frame<'_>,
        uploaded: &Uploaded,
        policy: UpdatePolicy,
        updates: &mut DeviceUpdates,
    ) -> Result<(), DeviceError> {
        let meshes = uploaded.meshes();
        let changed: Vec<usize> = (0..frame.keys.len()).filter(|&i| self.meshes[i] != frame.keys[i]).collect();
        let transforms = frame.transforms.as_deref().unwrap_or_default();
        let refits = policy == UpdatePolicy::Refit;
        let mut encoder = gpu.encoder();
        match &mut self.levels {
            Levels::One(one) if !changed.is_empty() => match refits {
                true => one.refit(gpu, &mut encoder, &meshes)?,
                false => one.rebuild(gpu, &mut encoder, &meshes)?,
            },
            Levels::One(_) => {}
            Levels::Two(two) => {
                let Some(instances) = uploaded.instances() else { return Ok(()) };
                if changed.len() > MOST_ALONE {
                    match refits {
                        true => two.refit(gpu, &mut encoder, &meshes, &instances)?,
                        false => two.rebuild(gpu, &mut encoder, &meshes, &instances)?,
                    }
                    updates.top_rebuilds += 1;
                } else if !changed.is_empty() || self.transforms != transforms {
                    for &i in &changed {
                        match refits {
                            true => two.refit_mesh(gpu, &mut encoder, count(i), &meshes[i])?,
                            false => two.rebuild_mesh(gpu, &mut encoder, count(i), &meshes[i])?,
                        }
                    }
                    two.update_top(gpu, &mut encoder, &instances)?;
                    updates.top_rebuilds += 1;
                }
            }
        }
        gpu.submit(encoder)?;
        if refits {
            updates.refits += changed.len()
        } else {
            updates.rebuilds += changed.len()
        }
        self.meshes.clone_from(&frame.keys);
        self.transforms = transforms.to_vec();
        match &self.levels {
            _ if frame.is_sound => {}
            Levels::One(one) => block_on(one.check(gpu))?,
            Levels::Two(two) => block_on(two.check(gpu))?,
        }
        Ok(())
    }
}

/// Coordinates up to which no kernel finds a fault: those of 1e18 and more are faults, with roundings of a few units in the last place.
const FAR: f32 = 1e17;

/// The greatest absolute coordinate; infinite if one is not finite.
fn reach(positions: &[[f32; 3]]) -> f32 {
    let greater = |all: f32, x: &f32| if x.is_finite() { all.max(x.abs()) } else { f32::INFINITY };
    positions.as_flattened().iter().fold(0.0, greater)
}

/// Whether the device places an instance of a mesh that reaches so far, for sure: it rejects condition numbers above [`MAX_CONDITION`], scales below 2^-100, and
/// coordinates and numbers of transforms above 1e18, computed with relative errors of some 2^-20 at such condition numbers.
fn is_placed(world_from_object: &Affine, reach: f32) -> bool {
    const SCALES: [f64; 2] = [1e-17, 1e17];
    let Ok(inverse) = canted_tlas::Instance::new(0, *world_from_object).object_from_world(0) else { return false };
    let row_sum = |row: &[f64; 4]| row[..3].iter().map(|x| x.abs()).sum::<f64>();
    let (forward, backward) = (world_from_object.row_sum_norm(), inverse.iter().map(row_sum).fold(0.0, f64::max));
    forward * backward <= 0.9 * MAX_CONDITION
        && [forward, backward].iter().all(|norm| (SCALES[0]..SCALES[1]).contains(norm))
        && world_from_object.reach(reach) <= f64::from(FAR)
}

fn key(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> [u64; 2] {
    let [mut of_positions, mut of_triangles] = [Hash::default(); 2];
    of_positions.floats(positions);
    of_triangles.words(triangles.iter().flatten().copied());
    [of_positions.finish(), of_triangles.finish()]
}

fn count(n: usize) -> u32 {
    n as u32
}
