//! Instances in buffers of a program's own: their inverses and world-space boxes.

use bytemuck::{Pod, Zeroable};
use canted_obb::Affine;
use canted_shaders::wgsl;

use super::primitives::{Leaf, end_of, window};
use super::{BuildEncoder, Primitives};
use crate::buffer::Slot;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// The mesh of an instance that is not placed, so that rays do not meet it.
pub const NOT_PLACED: u32 = u32::MAX;

/// Instances in a device buffer of a program's own, which must have the usage `STORAGE`.
///
/// Each instance is thirteen words, [`DeviceInstance`]'s first: the rows of `world_from_object`, translations last, as twelve `f32`, and
/// the number of its mesh as `u32`, or [`NOT_PLACED`]. With masks a word follows: a ray of
/// [`closest_hit_masked`](crate::TracedScene::module) hits the instance if both masks have a bit in common.
#[derive(Clone, Copy, Debug)]
pub struct InstanceBuffer<'a> {
    /// Holds the instances.
    pub buffer: &'a wgpu::Buffer,
    /// Byte of the first instance; a multiple of 4.
    pub first_byte: u64,
    /// Bytes from instance to instance; a multiple of 4, at least 52, or 56 with masks.
    pub stride: u64,
    /// Number of instances.
    pub n_instances: u32,
    /// Whether each has a mask. Otherwise they have all bits.
    pub has_masks: bool,
}

/// An instance as [`InstanceBuffer`] holds it, 64 bytes apart.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceInstance {
    /// Rows of `world_from_object`, translations last.
    pub rows: [[f32; 4]; 3],
    /// Number of its mesh, or [`NOT_PLACED`].
    pub mesh: u32,
    /// Rays whose masks have a bit of this one hit it, where [`InstanceBuffer::has_masks`] is set; no ray hits an instance with mask 0.
    pub mask: u32,
    /// Not read.
    pub padding: [u32; 2],
}

impl DeviceInstance {
    /// A mesh with this transform from object to world space, and a mask of all bits.
    #[must_use]
    pub fn new(mesh: u32, world_from_object: &Affine) -> Self {
        let rows = std::array::from_fn(|k| world_from_object.columns.map(|column| column[k]));
        Self { rows, mesh, mask: u32::MAX, padding: [0; 2] }
    }
}

/// `InstanceLayout` of `build/place`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct InstanceLayout {
    first_word: u32,
    stride: u32,
    n_meshes: u32,
    reach: f32,
    error: f32,
    has_masks: u32,
}

/// Scales of the bounds that headers hold: reach over the largest coordinate, and error of hits relative to it.
#[derive(Clone, Copy)]
pub(crate) struct Scales {
    pub(crate) reach: f32,
    pub(crate) error: f32,
}

/// Kinds of faults of instances, each with the complement of the lowest instance; 0 for none.
pub(crate) const N_INSTANCE_FAULTS: usize = 3;

/// Words of a header that instances raise: reach, error relative to the origin, constant error.
const RAISED: [u32; 3] = [3, 7, 11];

/// The box of each mesh in two quads: lower ends and 1, or 0 for none; upper ends.
pub(crate) type MeshBoxes = Buffer<[f32; 8]>;

impl Primitives {
    /// Places instances: writes their boxes, `instances` as rays read them, the bounds of the header at the start of `headers`, and
    /// `faults`.
    pub(crate) fn place(
        &self,
        build: &mut BuildEncoder<'_>,
        placed: &InstanceBuffer<'_>,
        mesh_boxes: &MeshBoxes,
        scales: Scales,
        (instances, headers, faults): (&Buffer<impl Pod>, &Buffer<impl Pod>, &Buffer<u32>),
    ) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let Leaf::Box { boxes, aabbs } = &self.leaf else { return Ok(()) };
        let n_meshes = super::count(mesh_boxes.len());
        let (layout, transforms) =
            layout(gpu, placed, n_meshes, scales).map_err(|message| GpuError::Input { message })?;
        let layout = gpu.uniform("instance layout", &layout)?;
        let bound: [NamedBinding<'_>; 8] = [
            ("instance_layout", &layout),
            ("transforms", &transforms),
            ("mesh_boxes", mesh_boxes),
            ("instances", instances),
            ("item_boxes", boxes),
            ("item_aabbs", aabbs),
            ("top_header", headers),
            ("instance_faults", faults),
        ];
        build.stage("place", |dispatches| {
            dispatches.work.clear(faults);
            RAISED.iter().for_each(|&word| dispatches.work.clear_word(headers, word));
            let kernel = gpu.kernel(wgsl::build::PLACE, &Variant::none())?;
            dispatches.items(&kernel, &bound, placed.n_instances)
        })
    }
}

/// The first fault of instances, as a sentence.
pub(crate) fn instance_fault(faults: &[u32], n_meshes: usize) -> Option<String> {
    let sentences = [
        format!("refers to a mesh beyond the {n_meshes} of the scene"),
        "has a transform that is not finite or has coordinates above 1e18 in world space".to_owned(),
        "has a transform that is singular, has a condition number above 1024 or scales by less than 2^-100".to_owned(),
    ];
    let found = faults.iter().zip(sentences).filter(|(word, _)| **word != 0);
    let (word, sentence) = found.max_by_key(|(word, _)| **word)?;
    Some(format!("instance {} {sentence}", !word))
}

/// The layout of instances, checked against the size of their buffer, and its used part.
fn layout<'a>(
    gpu: &Gpu,
    placed: &InstanceBuffer<'a>,
    n_meshes: u32,
    scales: Scales,
) -> Result<(InstanceLayout, Slot<'a>), String> {
    let &InstanceBuffer { buffer, first_byte, stride, n_instances, has_masks } = placed;
    let least = if has_masks { 4 * 14 } else { 4 * 13 };
    if stride % 4 != 0 || stride < least || first_byte % 4 != 0 {
        return Err(format!(
            "instances: stride {stride} and first byte {first_byte} must be multiples of 4, the stride at least {least}"
        ));
    }
    let end = end_of([first_byte, stride], n_instances, least);
    let used = window(gpu, "instances", buffer, [first_byte, end])?;
    let first_word = first_byte.saturating_sub(used.first_byte) / 4;
    let word = |x: u64| u32::try_from(x).map_err(|_| format!("instances: an offset of {x} is out of range"));
    let Scales { reach, error } = scales;
    let (first_word, stride) = (word(first_word)?, word(stride / 4)?);
    Ok((InstanceLayout { first_word, stride, n_meshes, reach, error, has_masks: has_masks.into() }, used))
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn faults_name_the_lowest_instance() {
        assert_eq!(instance_fault(&[0, 0, 0], 2), None);
        assert_eq!(instance_fault(&[!7, 0, 0], 2).unwrap(), "instance 7 refers to a mesh beyond the 2 of the scene");
        let lowest = instance_fault(&[!7, !9, !3], 2).unwrap();
        assert_eq!(
            lowest,
            "instance 3 has a transform that is singular, has a condition number above 1024 or scales by less than 2^-100"
        );
    }
}
