//! What kernels read beside nodes and triangles: headers of BVHs and what is above them. All of it lies in one buffer.
//!
//! Kernels of this crate bind each table as a part of the buffer. The module binds the buffer, because a program's kernel needs the other storage buffers
//! that a device allows.

use bytemuck::Pod;
use canted_shaders::choice;

use super::instances::{MotionData, Packing};
use super::layout::{BvhHeader, InstanceData};
use crate::buffer::PART_BYTES;
use crate::{Buffer, Gpu, GpuError, NamedBinding};

/// What is above the BVHs of meshes.
pub(super) enum Level {
    /// Nothing: a single instance.
    One,
    /// First triangle of each instance; one BVH contains all triangles.
    Flat(Vec<u32>),
    /// Instances below a top-level BVH.
    Two {
        instances: Vec<InstanceData>,
        /// Their indices in the order of the top-level BVH.
        order: Vec<u32>,
        /// Those of the instances that move.
        motions: Vec<MotionData>,
    },
}

impl Level {
    /// One BVH over instances that start at these triangles.
    pub(super) fn flat(first_triangles: &[u32]) -> Self {
        match first_triangles {
            [] | [_] => Self::One,
            _ => Self::Flat(first_triangles.to_vec()),
        }
    }

    /// Instances in this order.
    pub(super) fn two(packing: Packing, order: Vec<u32>) -> Self {
        let Packing { instances, motions, .. } = packing;
        Self::Two { instances, order, motions }
    }

    /// Whether some rays hit an instance and others do not. Those with mask 0 are not in the BVH.
    pub(super) fn has_masks(&self) -> bool {
        match self {
            Self::One | Self::Flat(_) => false,
            Self::Two { instances, .. } => instances.iter().any(|instance| ![0, u32::MAX].contains(&instance.mask())),
        }
    }

    /// `n` instances in order, which the device places; see [`Primitives::place`](crate::build::Primitives).
    pub(super) fn unplaced(n: u32) -> Self {
        let instances = vec![InstanceData::default(); n as usize];
        Self::Two { instances, order: (0..n).collect(), motions: vec![] }
    }
}

/// The tables of a scene in device memory.
pub(super) struct Tables {
    whole: Buffer<u8>,
    headers: Buffer<BvhHeader>,
    above: Above,
}

/// Those of what is above the BVHs of meshes.
enum Above {
    One,
    Flat(Buffer<u32>),
    Two { instances: Buffer<InstanceData>, order: Buffer<u32>, motions: Option<Buffer<MotionData>> },
}

/// The contents of tables, each from a multiple of [`PART_BYTES`] on.
#[derive(Default)]
struct Contents(Vec<u8>);

/// A table in the contents: its first byte and its length.
type Place = (u64, usize);

impl Contents {
    fn add<T: Pod>(&mut self, values: &[T]) -> Place {
        let first_byte = self.0.len();
        self.0.extend_from_slice(bytemuck::cast_slice(values));
        // An empty table has the size of a value, because an empty binding is invalid.
        let n_bytes = (values.len().max(1) * size_of::<T>()).next_multiple_of(PART_BYTES as usize);
        self.0.resize(first_byte + n_bytes, 0);
        (first_byte as u64, values.len())
    }
}

impl Tables {
    /// Uploads tables. `are_final`: the device never writes them again.
    pub(super) fn new(gpu: &Gpu, headers: &[BvhHeader], level: &Level, are_final: bool) -> Result<Self, GpuError> {
        let mut contents = Contents::default();
        let of_headers = contents.add(headers);
        let of_level = match level {
            Level::One => vec![],
            Level::Flat(first_triangles) => vec![contents.add(first_triangles)],
            Level::Two { instances, order, motions } => {
                let mut places = vec![contents.add(instances), contents.add(order)];
                if !motions.is_empty() {
                    places.push(contents.add(motions));
                }
                places
            }
        };
        let whole = match are_final {
            true => gpu.read_only("tables", &contents.0)?,
            false => gpu.buffer("tables", &contents.0)?,
        };
        let above = match of_level[..] {
            [] => Above::One,
            [(at, n)] => Above::Flat(whole.part(at, n)),
            [instances, order, ref motions @ ..] => Above::Two {
                instances: whole.part(instances.0, instances.1),
                order: whole.part(order.0, order.1),
                motions: motions.first().map(|&(at, n)| whole.part(at, n)),
            },
        };
        Ok(Self { headers: whole.part(of_headers.0, of_headers.1), whole, above })
    }

    /// The headers of all BVHs.
    pub(super) fn headers(&self) -> &Buffer<BvhHeader> {
        &self.headers
    }

    /// Instances as rays read them, of a scene of two levels.
    pub(super) fn instances(&self) -> Option<&Buffer<InstanceData>> {
        match &self.above {
            Above::Two { instances, .. } => Some(instances),
            Above::One | Above::Flat(_) => None,
        }
    }

    /// All tables as one binding.
    pub(super) fn whole(&self) -> &Buffer<u8> {
        &self.whole
    }

    /// The tables by the variables of kernels, in the order of the buffer.
    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound: Vec<NamedBinding<'_>> = vec![("bvhs", &self.headers)];
        match &self.above {
            Above::One => {}
            Above::Flat(first) => bound.push(("first_triangles", first)),
            Above::Two { instances, order, motions } => {
                bound.extend([("instances", instances as _), ("instance_order", order as _)]);
                bound.extend(motions.as_ref().map(|motions| -> NamedBinding<'_> { ("motions", motions) }));
            }
        }
        bound
    }

    /// The same with the number of values that each has memory for.
    pub(super) fn lengths(&self) -> Vec<(&'static str, u32)> {
        let length = |n: usize| u32::try_from(n.max(1)).unwrap_or(u32::MAX);
        let mut lengths = vec![("bvhs", length(self.headers.len()))];
        match &self.above {
            Above::One => {}
            Above::Flat(first) => lengths.push(("first_triangles", length(first.len()))),
            Above::Two { instances, order, motions } => {
                lengths.extend([("instances", length(instances.len())), ("instance_order", length(order.len()))]);
                lengths.extend(motions.as_ref().map(|motions| ("motions", length(motions.len()))));
            }
        }
        lengths
    }

    /// The shader part of the level.
    pub(super) fn level(&self) -> choice::Level {
        match &self.above {
            Above::One => choice::Level::Single,
            Above::Flat(_) => choice::Level::Flat,
            Above::Two { motions: None, .. } => choice::Level::Instances,
            Above::Two { .. } => choice::Level::Moving,
        }
    }

    pub(super) fn n_bytes(&self) -> u64 {
        self.whole.n_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_table_starts_at_a_multiple_and_has_memory_for_a_value() {
        let mut contents = Contents::default();
        assert_eq!(contents.add(&[7_u32; 65]), (0, 65));
        assert_eq!(contents.add::<u32>(&[]), (512, 0));
        assert_eq!(contents.add(&[[1_u64; 4]; 9]), (768, 9));
        assert_eq!(contents.0.len(), 1280);
        assert_eq!((contents.0[259], contents.0[260], contents.0[768]), (0, 0, 1));
    }
}
