//! The acceleration structure of a scene on a device.

use std::ops::Deref;

use canted_gpu::build::BuildConfig;
use canted_gpu::{DeviceBvh, Gpu, HostBvh, Options, Source, TracedScene, block_on};
use canted_lbvh::{Corners, Strategy, triangle_corners};
use canted_scene::{Instance, Material, Mesh, Part, Scene};

use super::curves::moving_curves;
use super::{DeviceError, DeviceFrames};
use crate::scene_bvh::{flatten_distinct, has_one_level, instances};
use crate::{BottomLevel, PrepareError, SceneBvh, SceneBvhConfig, SceneLevels, coincident};

const BUILT_CURVES: DeviceError = DeviceError::Unsupported { what: "curves in BVHs that the GPU builds" };

const OTHER_CURVES: DeviceError = DeviceError::Unsupported { what: "moving curves of this kind" };

const DEFORMING: DeviceError = DeviceError::Unsupported { what: "meshes that deform while the shutter is open" };

/// What the device traces.
enum Kind<'a> {
    /// The CPU's BVH of each mesh, over triangles or curves.
    Wide(Vec<HostBvh<'a>>),
    /// Binary BVHs with these volumes, which the device builds.
    Binary(Strategy),
}

/// The acceleration structure of a scene on a device: wide BVHs are uploaded; binary ones are built there, over a radix tree.
///
/// # Errors
/// Structures other than wide and binary BVHs; strategies and instances that the kernels do not support; too little memory on the
/// device.
pub fn traced_scene(gpu: &Gpu, scene: &Scene, bvh: &SceneBvh) -> Result<TracedScene, DeviceError> {
    uploaded(gpu, scene, bvh, kind(bvh.bottom())?)
}

/// A structure that a picture owns, or one that the frames of a sequence share.
#[expect(clippy::large_enum_variant, reason = "a picture has one")]
pub enum Traced<'a> {
    /// For one picture.
    Own(TracedScene),
    /// Updated from frame to frame.
    Shared(&'a TracedScene),
}

impl Deref for Traced<'_> {
    type Target = TracedScene;

    fn deref(&self) -> &TracedScene {
        match self {
            Self::Own(traced) => traced,
            Self::Shared(traced) => traced,
        }
    }
}

/// The acceleration structure of a frame of a sequence, after that of the last frame is dropped: what changed is uploaded. BVHs that the
/// device builds over things that stand still while the shutter is open are those of the last frame, updated there: binary ones, and wide
/// ones with [`DeviceFrames::with_wide`].
///
/// # Errors
/// As for [`traced_scene`].
pub fn traced_frame<'a>(
    gpu: &Gpu,
    scene: &Scene,
    bvh: &SceneBvh,
    frames: &'a mut DeviceFrames,
) -> Result<Traced<'a>, DeviceError> {
    gpu.start_frame();
    let is_flat = matches!(bvh.levels(), SceneLevels::One(_));
    let kind = kind(bvh.bottom())?;
    let on_device = match (&kind, frames.wide()) {
        (Kind::Binary(strategy), _) => Some(config(*strategy).into()),
        (Kind::Wide(_), wide) => wide.map(DeviceBvh::from),
    };
    let Some(on_device) = on_device.filter(|_| !scene.has_motion() && !scene.has_curves()) else {
        frames.forget();
        return Ok(Traced::Own(uploaded(gpu, scene, bvh, kind)?));
    };
    match frames.built(gpu, scene, on_device, is_flat) {
        // The CPU's wide BVHs are there, too.
        Err(DeviceError::Gpu(error)) if matches!(kind, Kind::Wide(_)) && error.is_of_scene() => {
            Ok(Traced::Own(uploaded(gpu, scene, bvh, kind)?))
        }
        built => Ok(Traced::Shared(built?)),
    }
}

fn uploaded(gpu: &Gpu, scene: &Scene, bvh: &SceneBvh, kind: Kind<'_>) -> Result<TracedScene, DeviceError> {
    Ok(match (kind, bvh.levels()) {
        (Kind::Wide(meshes), SceneLevels::One(flat)) => block_on(TracedScene::new(
            gpu,
            Source::Wide(meshes[0]),
            Options { parts: &flat.first, masked: &[masked_of_instances(scene)] },
        ))?,
        (Kind::Wide(meshes), SceneLevels::Two(_)) => {
            let masked: Vec<Vec<bool>> = scene.meshes.iter().map(|mesh| masked_of_mesh(scene, mesh)).collect();
            let options = Options { masked: &masked, ..Options::default() };
            block_on(TracedScene::new(gpu, Source::tlas(meshes, &instances(scene)), options))?
        }
        (Kind::Binary(strategy), _) => {
            built(gpu, scene, matches!(bvh.levels(), SceneLevels::One(_)), config(strategy).into())?
        }
    })
}

/// The triangles of a mesh at which alpha decides whether a hit counts; empty where there are none.
fn masked_of_mesh(scene: &Scene, mesh: &Mesh) -> Vec<bool> {
    let uses_alpha = |part: &Part| scene.materials.get(part.material.0 as usize).is_some_and(Material::uses_alpha);
    if !mesh.parts.iter().any(uses_alpha) {
        return vec![];
    }
    let mut masked = vec![false; mesh.triangles.len()];
    for part in &mesh.parts {
        // Later parts overwrite what is behind their first triangle.
        if let Some(from) = masked.get_mut(part.first_triangle as usize..) {
            from.fill(uses_alpha(part));
        }
    }
    masked
}

/// The same of all instances in one level.
fn masked_of_instances(scene: &Scene) -> Vec<bool> {
    if !scene.materials.iter().any(Material::uses_alpha) {
        return vec![];
    }
    let of_instance = |instance: &Instance| {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let mut masked = masked_of_mesh(scene, mesh);
        masked.resize(mesh.triangles.len(), false);
        masked
    };
    scene.instances.iter().flat_map(of_instance).collect()
}

/// BVHs of a scene that the device builds from its triangles, in as many levels as [`SceneBvh::build`](crate::SceneBvh::build) with `config`
/// gives it. The CPU builds nothing.
///
/// # Errors
/// Invalid geometry; meshes that deform, and instances that the kernels do not support; too little memory on the device.
pub fn built_scene(
    gpu: &Gpu,
    scene: &Scene,
    config: &SceneBvhConfig,
    bvh: DeviceBvh,
) -> Result<TracedScene, DeviceError> {
    if scene.meshes.iter().any(|mesh| mesh.close.is_some()) {
        return Err(DEFORMING);
    }
    if scene.has_curves() {
        return Err(BUILT_CURVES);
    }
    built(gpu, scene, has_one_level(scene, config)?, bvh)
}

/// BVHs that the device builds, in one level or two.
fn built(gpu: &Gpu, scene: &Scene, is_flat: bool, bvh: DeviceBvh) -> Result<TracedScene, DeviceError> {
    if is_flat {
        let (positions, triangles, first) = flatten_distinct(scene)?;
        let corners = corners(&positions, &triangles)?;
        return Ok(block_on(TracedScene::new(
            gpu,
            Source::build([&corners], bvh),
            Options { parts: &first, ..Options::default() },
        ))?);
    }
    let meshes = scene.meshes.iter().map(|mesh| corners(&mesh.positions, &coincident::of_mesh(scene, mesh)));
    let meshes = meshes.collect::<Result<Vec<_>, _>>()?;
    Ok(block_on(TracedScene::new(
        gpu,
        Source::build(&meshes, bvh).with_instances(&instances(scene)),
        Options::default(),
    ))?)
}

fn kind(bvhs: &[BottomLevel]) -> Result<Kind<'_>, DeviceError> {
    let mut meshes = vec![];
    for bvh in bvhs {
        match bvh {
            BottomLevel::Wide(wide) => meshes.push(wide.into()),
            BottomLevel::Segments(segments) => meshes.push(segments.into()),
            BottomLevel::Bvh2(_, strategy) => return Ok(Kind::Binary(*strategy)),
            BottomLevel::Moving(_) => return Err(DEFORMING),
            BottomLevel::Bih(_) => return Err(DeviceError::Unsupported { what: "a bounding interval hierarchy" }),
            BottomLevel::KdTree(_) => return Err(DeviceError::Unsupported { what: "a kd-tree" }),
            BottomLevel::Cubics(cubics) => meshes.push(cubics.into()),
            BottomLevel::Ribbons(ribbons) => meshes.push(ribbons.into()),
            BottomLevel::CubicRibbons(ribbons) => meshes.push(ribbons.into()),
            BottomLevel::Patches(patches) => meshes.push(patches.into()),
            BottomLevel::MovingCurves(curves) => meshes.push(moving_curves(&**curves).ok_or(OTHER_CURVES)?),
        }
    }
    Ok(Kind::Wide(meshes))
}

fn config(strategy: Strategy) -> BuildConfig {
    BuildConfig { strategy, ..BuildConfig::default() }
}

fn corners(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Vec<Corners>, DeviceError> {
    Ok(triangle_corners(positions, triangles).map_err(PrepareError::Geometry)?.0)
}
