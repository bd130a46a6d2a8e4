//! What is above the BVHs of meshes, in device memory.

use super::layout::InstanceData;
use super::motion::MotionData;
use super::top_level::Packing;
use crate::{Buffer, Gpu, GpuError, NamedBinding};

/// What is above the BVHs of meshes.
pub(super) enum Level {
    /// Nothing: a single instance.
    One,
    /// First triangle of each instance; one BVH contains all triangles.
    Flat(Buffer<u32>),
    /// Instances below a top-level BVH.
    Two(Instances),
}

/// Instances in device memory.
pub(super) struct Instances {
    instances: Buffer<InstanceData>,
    /// Their indices in the order of the top-level BVH.
    order: Buffer<u32>,
    /// Motions, if any instance moves.
    motions: Option<Buffer<MotionData>>,
}

impl Instances {
    /// Uploads instances. `order` has the instance of each primitive of the top-level BVH.
    pub(super) fn new(gpu: &Gpu, packing: &Packing, order: &[u32]) -> Result<Self, GpuError> {
        let motions = Some(&packing.motions).filter(|motions| !motions.is_empty());
        Ok(Self {
            instances: gpu.read_only("instances", &packing.instances)?,
            order: gpu.read_only("instance order", order)?,
            motions: motions.map(|motions| gpu.read_only("motions", motions)).transpose()?,
        })
    }

    /// `n` instances in order, which the device places; see [`Items::place`](crate::build::Items).
    pub(super) fn unplaced(gpu: &Gpu, n: u32) -> Result<Self, GpuError> {
        let order: Vec<u32> = (0..n).collect();
        Ok(Self {
            instances: gpu.zeroed("instances", n as usize)?,
            order: gpu.buffer("instance order", &order)?,
            motions: None,
        })
    }

    /// The instances as rays read them.
    pub(super) fn data(&self) -> &Buffer<InstanceData> {
        &self.instances
    }
}

impl Level {
    /// One BVH over instances that start at these triangles.
    pub(super) fn flat(gpu: &Gpu, first_triangles: &[u32]) -> Result<Self, GpuError> {
        Ok(match first_triangles {
            [] | [_] => Self::One,
            _ => Self::Flat(gpu.read_only("first triangles", first_triangles)?),
        })
    }

    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        match self {
            Self::One => vec![],
            Self::Flat(first) => vec![("first_triangles", first)],
            Self::Two(Instances { instances, order, motions }) => {
                let mut bound: Vec<NamedBinding<'_>> = vec![("instances", instances), ("instance_order", order)];
                bound.extend(motions.as_ref().map(|motions| -> NamedBinding<'_> { ("motions", motions) }));
                bound
            }
        }
    }

    /// The shader part of this level.
    pub(super) fn part(&self) -> &'static str {
        match self {
            Self::One => "shared/level/single",
            Self::Flat(_) => "shared/level/flat",
            Self::Two(Instances { motions: None, .. }) => "shared/level/instances",
            Self::Two(_) => "shared/level/moving",
        }
    }

    pub(super) fn n_bytes(&self) -> u64 {
        match self {
            Self::One => 0,
            Self::Flat(first) => first.n_bytes(),
            Self::Two(Instances { instances, order, motions }) => {
                instances.n_bytes() + order.n_bytes() + motions.as_ref().map_or(0, Buffer::n_bytes)
            }
        }
    }
}
