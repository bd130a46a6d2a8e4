//! BVHs, instances, rays, hits and their error bounds in the layout of `shared/bvh.wgsl`, `shared/level.wgsl` and `shared.wgsl`.

use bytemuck::{Pod, Zeroable};
use canted_obb::{Affine, Obb};
use canted_trace::ScaledRay;
use canted_wide::RawBvh;

use crate::GpuError;

/// Upper bound of one rounding under WGSL, relative, in any rounding mode: 2^-23.
const ROUNDING: f32 = f32::EPSILON;

/// Maximum distance of a reported hit from its triangle, per coordinate and relative to `|o|∞ + ρ∞`, without an instance
/// transform; derived in `shared/triangle.wgsl`.
pub const HIT_ERROR: f32 = 64.0 * ROUNDING;

/// Four words, the unit in which kernels read nodes and triangles.
pub(super) type Quad = [u32; 4];

/// How far the center of an oriented box may lie from the origin, in units of the greatest coordinate of what it encloses; see
/// `shared/bvh/volume/obb`.
pub(super) const CENTER_REACH: f32 = 3.0;

/// Maximum absolute coordinate of a mesh, and of an instance in world space. It is below 2^60, up to which the pads of
/// `shared/bvh.wgsl` are proven, and squared distances do not overflow.
pub const MAX_COORDINATE: f32 = 1e18;

/// Rejects larger coordinates.
pub(super) fn check_coordinates(name: impl FnOnce() -> String, reach: f64) -> Result<(), GpuError> {
    // This form also rejects NaN.
    if reach <= MAX_COORDINATE.into() {
        return Ok(());
    }
    Err(GpuError::Unsupported { what: format!("{}, which has coordinates above {MAX_COORDINATE:e}", name()) })
}

/// As in `shared/bvh.wgsl`: the leaf bit and the empty word.
pub(super) const LEAF: u32 = 0x8000_0000;
pub(super) const EMPTY: u32 = 0x7fff_ffff;

/// Children of a wide node.
pub(super) const WIDTH: usize = 8;

/// Header of a BVH.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BvhHeader {
    /// Rows of the mesh's frame. Fourth components: the largest coordinate, the relative and the constant error of hits.
    pub(super) rows: [[f32; 4]; 3],
    /// Root, first quad of the nodes and of the triangles, whether the frame is rotated.
    pub(super) words: Quad,
}

/// Error bound of hits: relative to the largest coordinate of the origin, and constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HitError {
    pub(super) per_origin: f32,
    pub(super) fixed: f32,
}

impl HitError {
    /// Error in object space, for triangles with coordinates up to `reach`.
    pub(super) fn of_triangles(reach: f32) -> Self {
        Self { per_origin: HIT_ERROR, fixed: HIT_ERROR * reach }
    }
}

/// Where a BVH starts in the shared buffers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Start {
    pub(super) node: u32,
    pub(super) triangle: u32,
}

impl BvhHeader {
    pub(super) fn new(words: &RawBvh<'_>, start: Start, error: HitError) -> Self {
        let [x, y, z] = words.frame;
        let with = |[a, b, c]: [f32; 3], last: f32| [a, b, c, last];
        Self {
            rows: [with(x, words.reach), with(y, error.per_origin), with(z, error.fixed)],
            words: [words.root, start.node, start.triangle, u32::from(words.frame != Obb::IDENTITY_FRAME)],
        }
    }

    /// A wide BVH that the device built, with this root and first quad, still without bounds.
    pub(super) fn wide(root: u32, first_quad: u32) -> Self {
        Self { words: [root, first_quad, 0, 0], ..Self::binary(root, 0) }
    }

    /// A binary BVH with this root, over the triangles from `first_triangle` on, still without bounds.
    pub(super) fn binary(root: u32, first_triangle: u32) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = Obb::IDENTITY_FRAME;
        let rows = [[a, b, c, 0.0], [d, e, f, 0.0], [g, h, i, 0.0]];
        Self { rows, words: [root, 0, first_triangle, 0] }.with_bounds(0.0, HitError::of_triangles(0.0))
    }

    /// The same with a largest coordinate and the error of hits.
    pub(super) fn with_bounds(mut self, reach: f32, error: HitError) -> Self {
        for (row, bound) in self.rows.iter_mut().zip([reach, error.per_origin, error.fixed]) {
            row[3] = bound;
        }
        self
    }
}

/// An instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct InstanceData {
    /// Rows of the linear part of `object_from_world`. Fourth components: the world position of the object's origin.
    rows: [[f32; 4]; 3],
    /// Index of its BVH; index of its motion plus one, or 0 for none; its mask; whether the BVH is over curves.
    bvh: Quad,
    /// Rows of `object_from_world` as on the CPU, with translations: for each entry the lower half of its f64, then the upper.
    exact_rows: [[[u32; 2]; 4]; 3],
}

impl InstanceData {
    pub(super) fn new(object_from_world: &[[f64; 4]; 3], world_from_object: &Affine, bvh: Quad) -> Self {
        let at = world_from_object.columns[3];
        let row = |k: usize| {
            let [x, y, z, _] = object_from_world[k].map(|x| x as f32);
            [x, y, z, at[k]]
        };
        let words = |x: f64| [x.to_bits() as u32, (x.to_bits() >> 32) as u32];
        Self { rows: [row(0), row(1), row(2)], bvh, exact_rows: object_from_world.map(|row| row.map(words)) }
    }
}

impl InstanceData {
    pub(super) fn mask(&self) -> u32 {
        self.bvh[2]
    }
}

/// Infinity in kernels.
pub(super) const FAR: f32 = 3e38;

/// Instance of a ray whose traversal was incomplete.
pub(super) const INCOMPLETE: u32 = u32::MAX - 1;

/// A ray in device memory.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceRay {
    /// Origin, world space.
    pub origin: [f32; 3],
    /// Minimum accepted `t`.
    pub t_min: f32,
    /// Direction, world space; a zero direction hits nothing.
    pub direction: [f32; 3],
    /// Maximum accepted `t`, finite.
    pub t_max: f32,
}

impl DeviceRay {
    /// A ray that hits nothing.
    pub(super) const NOTHING: Self = Self { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 0.0 };

    /// A ray in scaled units, so that kernels need not scale it.
    #[must_use]
    pub fn scaled(ray: &ScaledRay) -> Self {
        Self { origin: ray.origin, t_min: ray.t_min.min(FAR), direction: ray.direction, t_max: ray.t_max.min(FAR) }
    }
}

/// A hit in device memory.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index of the instance in the scene; [`DeviceHit::NONE`] for a miss.
    pub instance: u32,
}

/// `Hit` of [`TracedScene::module`](crate::TracedScene::module), in the memory of a program's kernel.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ModuleHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index of the instance in the scene; [`DeviceHit::NONE`] for a miss.
    pub instance: u32,
    /// Where the BVH has the triangle, until it is built again.
    pub place: u32,
}

impl DeviceHit {
    /// The instance of a miss: `NONE` in WGSL.
    pub const NONE: u32 = u32::MAX;
}

#[cfg(test)]
mod tests {
    use canted_shaders::{Number, choice, wgsl};
    use std::mem::offset_of;

    use canted_shaders::{Shader, Variant};

    use super::*;

    fn chosen() -> Variant {
        Variant::none()
            .with(choice::Level::Instances)
            .with(choice::NodeKinds::Any)
            .with(choice::Traverse::Wide)
            .with(choice::Mask::None)
            .with(choice::Count::None)
            .with(choice::Each::All)
            .number(Number::StackSize, 4)
            .number(Number::MaxIterations, 1000)
    }

    fn offsets(of: &str) -> (Vec<u32>, u32) {
        let shader = Shader::new(wgsl::trace::CLOSEST, &chosen()).unwrap();
        let layout = shader.layout(of).unwrap();
        (layout.members.iter().map(|(_, offset)| *offset).collect(), layout.size)
    }

    #[test]
    fn layouts_match_the_kernels() {
        let rows = offset_of!(BvhHeader, rows) as u32;
        let words = offset_of!(BvhHeader, words) as u32;
        assert_eq!(offsets("Bvh"), (vec![rows, rows + 16, rows + 32, words], size_of::<BvhHeader>() as u32));
        let rows = offset_of!(InstanceData, rows) as u32;
        let bvh = offset_of!(InstanceData, bvh) as u32;
        let exact = offset_of!(InstanceData, exact_rows) as u32;
        let members = vec![rows, rows + 16, rows + 32, bvh, exact];
        assert_eq!(offsets("Instance"), (members, size_of::<InstanceData>() as u32));
        canted_shaders::same_layout!(
            wgsl::trace::CLOSEST,
            &chosen(),
            "Ray",
            DeviceRay { origin, t_min, direction, t_max }
        );
        canted_shaders::same_layout!(
            wgsl::trace::CLOSEST,
            &chosen(),
            "Hit",
            DeviceHit { t, u, v, primitive, instance }
        );
    }
}
