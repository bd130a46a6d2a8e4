//! The BVH over instances, and the error of hits in world space.

use canted_obb::{Aabb, Affine, PrimId};
use canted_tlas::{Instance, InstanceError, row_sum_norm};
use canted_wide::{Config, Preset, PrimitiveError, RawBvh, WideBvh};

use super::coordinates::check_coordinates;
use super::layout::{HIT_ERROR, HitError, InstanceData};
use super::motion::{MotionData, MotionPolynomials};
use crate::GpuError;

/// Maximum condition number of a transform: at 2^10, three of the seven digits of an f32 remain.
pub const MAX_CONDITION: f64 = 1024.0;

/// Bounds of a mesh in object space.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeshBounds {
    /// The largest absolute coordinate.
    pub(super) reach: f32,
    /// Empty for a mesh without triangles.
    pub(super) aabb: Aabb,
}

/// Instances with a wide BVH, ready for upload.
pub(super) struct TopLevel {
    pub(super) packing: Packing,
    pub(super) bvh: WideBvh<Aabb>,
}

impl TopLevel {
    /// Packs instances of meshes with these bounds, and builds a BVH over them.
    pub(super) fn new(meshes: &[MeshBounds], instances: &[Instance]) -> Result<Self, GpuError> {
        let packing = Packing::of(meshes, instances)?;
        let numbers = &packing.numbers;
        let of_instance = |error| match error {
            // Meshes without triangles have no box, so boxes and instances are numbered differently.
            PrimitiveError::Bounds { primitive } => {
                InstanceError::OutOfRange { instance: numbers[primitive.index()] as usize }
            }
            PrimitiveError::TooMany { .. } => InstanceError::TooMany { n_instances: instances.len() },
        };
        let config = Config::preset(Preset::Fast).axis_aligned();
        let bvh =
            WideBvh::<Aabb>::build(packing.boxes.clone(), &config).map_err(|error| untraceable(&of_instance(error)))?;
        Ok(Self { packing, bvh })
    }

    /// The instance of each primitive of the BVH, whose words these are. Instances without triangles have none.
    pub(super) fn order(&self, words: &RawBvh<'_>) -> Vec<u32> {
        words.order.iter().map(|&PrimId(box_index)| self.packing.numbers[box_index as usize]).collect()
    }
}

/// Instances in the layout of kernels, and their boxes.
#[derive(Default)]
pub(super) struct Packing {
    pub(super) instances: Vec<InstanceData>,
    /// Motions of the moving instances, in order.
    pub(super) motions: Vec<MotionData>,
    /// World space, over all times.
    pub(super) boxes: Vec<Aabb>,
    /// Instance of each box.
    pub(super) numbers: Vec<u32>,
    pub(super) error: HitError,
}

/// Linear parts of inverses are below it, as in `shared/build/invert.wgsl`, so that sums of three are `f32`.
const MOST_OF_INVERSE: f64 = 1.267_650_600_228_229_4e30;

impl Packing {
    /// Packs instances of meshes with these bounds.
    pub(super) fn of(meshes: &[MeshBounds], instances: &[Instance]) -> Result<Self, GpuError> {
        for (index, mesh) in meshes.iter().enumerate() {
            check_coordinates(|| format!("mesh {index}"), mesh.reach.into())?;
        }
        let mut packing = Self::default();
        for (index, instance) in instances.iter().enumerate() {
            packing.add(index, instance, meshes)?;
        }
        Ok(packing)
    }

    #[expect(clippy::cast_possible_truncation, reason = "instances are numbered by u32")]
    fn add(&mut self, index: usize, instance: &Instance, meshes: &[MeshBounds]) -> Result<(), GpuError> {
        let Some(MeshBounds { reach: reach_object, aabb }) = meshes.get(instance.blas as usize) else {
            return Err(untraceable(&InstanceError::NoSuchBlas { instance: index, blas: instance.blas }));
        };
        if instance.mask != u32::MAX {
            return Err(GpuError::Unsupported {
                what: format!("instance {index}, whose mask hides it from some rays"),
            });
        }
        let inverse = instance.object_from_world(index).map_err(|error| untraceable(&error))?;
        let motion = MotionPolynomials::of(instance);
        let ends = || [Some(instance.world_from_object), instance.world_from_object_close].into_iter().flatten();
        // The norm of a transform and the transformed box are convex in time, so the values at the ends are bounds.
        let forward = ends().map(|end| end.row_sum_norm()).fold(0.0, f64::max);
        let backward = motion.as_ref().map_or_else(|| row_sum_norm(&inverse), MotionPolynomials::norm_of_inverse);
        let condition = forward * backward;
        if !ends().all(|end| end.is_finite()) || condition > MAX_CONDITION {
            let transform = if motion.is_some() { "motion" } else { "transform" };
            let what = format!(
                "instance {index}, whose {transform} has condition number {condition:e} (maximum {MAX_CONDITION:e})"
            );
            return Err(GpuError::Unsupported { what });
        }
        if inverse.iter().flat_map(|row| &row[..3]).any(|x| x.abs() >= MOST_OF_INVERSE) {
            return Err(GpuError::Unsupported { what: format!("instance {index}, which scales by less than 2^-100") });
        }
        let reach = ends().map(|end| end.reach(*reach_object)).fold(0.0, f64::max);
        check_coordinates(|| format!("instance {index}"), reach)?;
        self.motions.extend(motion.as_ref().map(MotionPolynomials::words));
        let number = motion.as_ref().map_or(0, |_| self.motions.len() as u32);
        // BVH 0 is the top level.
        self.instances.push(InstanceData::new(&inverse, &instance.world_from_object, [instance.blas + 1, number]));
        if !aabb.is_empty() {
            self.boxes.push(ends().fold(Aabb::EMPTY, |all, end| all.union(image(aabb, &end))));
            self.numbers.push(index as u32);
            let amplified = if motion.is_some() { MOVING } else { STILL } * condition;
            let at = ends().flat_map(|end| end.columns[3]).fold(0.0, |all: f64, x| all.max(f64::from(x).abs()));
            self.error = self.error.with(amplified, at, forward * f64::from(*reach_object));
        }
        Ok(())
    }
}

impl Default for HitError {
    fn default() -> Self {
        Self { per_origin: 0.0, fixed: 0.0 }
    }
}

/// Error of hits in an instance, in units of [`HIT_ERROR`] times its condition number; derived at [`HitError::with`].
const STILL: f64 = 2.0;
const MOVING: f64 = 5.0;

impl HitError {
    /// Adds the error of an instance in world space: `amplified` by its transform, which maps the origin to `at` and points to
    /// within `reach_world` of it, as largest absolute coordinates.
    ///
    /// In object space, for an origin within `A = ‖M⁻¹‖·(|o| + |c|)` and with `ρ` the reach, a hit is off its triangle by at
    /// most `HIT_ERROR·(A + ρ)` plus twice the drift of sheared coordinates, which is twice that of the ray: four times `6 E·A`
    /// for the origin and `5 E·‖M⁻¹‖·t|d|` for the direction. The ray itself errs by these once more. The world ray reaches
    /// `t|d| <= |o| + |c| + ‖M‖·ρ`. Times `‖M‖`, with `k = ‖M‖·‖M⁻¹‖ >= 1`, the error is less than `(64 + 30 + 25) E·k·(|o| +
    /// |c| + ‖M‖·ρ)`. 128 E includes the rounding of the box and second-order terms.
    ///
    /// For moving instances the norms are maxima over time, `‖M⁻¹‖` is of absolute terms, and the roundings are `21 E·9/8` for
    /// the origin and `20 E` for the direction (`shared/level/moving`): less than `(64 + 119 + 100) E`; 320 E is used.
    #[expect(clippy::cast_possible_truncation, reason = "the bound includes a rounding")]
    fn with(self, amplified: f64, at: f64, reach_world: f64) -> Self {
        let relative = f64::from(HIT_ERROR) * amplified;
        let fixed = relative * (at + reach_world);
        Self { per_origin: self.per_origin.max(relative as f32), fixed: self.fixed.max(fixed as f32) }
    }
}

/// Bounds of a transformed box; its rounding is within the error of hits.
#[expect(clippy::cast_possible_truncation, reason = "the rounding is within the error of hits")]
fn image(bounds: &Aabb, world_from_object: &Affine) -> Aabb {
    let mut all = Aabb::EMPTY;
    for corner in 0..8 {
        let point = std::array::from_fn(|k| if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] });
        let image = world_from_object.point_f64(point.map(f64::from)).map(|x| x as f32);
        all = all.union(Aabb { min: image, max: image });
    }
    all
}

fn untraceable(error: &dyn std::error::Error) -> GpuError {
    GpuError::Unsupported { what: error.to_string() }
}

#[cfg(test)]
mod tests {
    use canted_trace::Watertight;
    use canted_wide::TriangleBvh;

    use super::*;

    /// A triangle with largest coordinate `reach`; an empty mesh for zero.
    fn mesh(reach: f32) -> TriangleBvh<Watertight> {
        let triangles: &[[u32; 3]] = if reach > 0.0 { &[[0, 1, 2]] } else { &[] };
        let positions = [[0.0; 3], [reach, 0.0, 0.0], [0.0, reach, 0.0]];
        TriangleBvh::build(&positions, triangles, &Config::preset(Preset::Fast)).unwrap()
    }

    fn placed(reaches: &[f32], instances: &[Instance]) -> Result<TopLevel, String> {
        let meshes: Vec<_> = reaches.iter().map(|&reach| mesh(reach)).collect();
        let bounds: Vec<_> =
            meshes.iter().map(|mesh| MeshBounds { reach: mesh.raw().reach, aabb: mesh.aabb() }).collect();
        TopLevel::new(&bounds, instances).map_err(|error| error.to_string())
    }

    fn at(blas: u32, scale: f32, shift: f32) -> Instance {
        let [x, y, z] = [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale]];
        Instance::new(blas, Affine { columns: [x, y, z, [shift, 0.0, 0.0]] })
    }

    #[test]
    fn too_large_coordinates_are_rejected_with_an_index() {
        let rejection = |reaches: &[f32], instances: &[Instance]| match placed(reaches, instances) {
            Ok(_) => panic!("{reaches:?} {instances:?} are placed"),
            Err(error) => error,
        };
        let of = |name: &str| format!("not supported on the GPU: {name}, which has coordinates above 1e18");
        assert_eq!(rejection(&[1.0, 1e19], &[]), of("mesh 1"));
        assert_eq!(rejection(&[1.0], &[at(0, 1.0, 0.0), at(0, 1e19, 0.0)]), of("instance 1"));
        // The first instance has no box, so boxes and instances are numbered differently.
        assert_eq!(rejection(&[0.0, 1.0], &[at(0, 1.0, 0.0), at(1, 1.0, 1.0), at(1, 1.0, -2e18)]), of("instance 2"));
        let leaving = Instance { world_from_object_close: Some(at(0, 1.0, 1e30).world_from_object), ..at(0, 1.0, 0.0) };
        assert_eq!(rejection(&[1.0], &[leaving]), of("instance 0"));
    }

    #[test]
    fn largest_coordinates_are_accepted() {
        let outer = placed(&[1e18, 0.0], &[at(1, 1.0, 0.0), at(0, 1.0, 0.0), at(0, 1e-18, 9e17)]).unwrap();
        assert_eq!(outer.packing.instances.len(), 3);
        let mut order = outer.order(&outer.bvh.raw());
        order.sort_unstable();
        assert_eq!(order, [1, 2]);
    }
}
