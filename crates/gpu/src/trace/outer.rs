//! The tree over instances, and how far hits in them may be off in world space.

use canted_obb::{Aabb, Affine, PrimId};
use canted_tlas::{Instance, InstanceError};
use canted_wide::{BoxTree, Config, Preset, Words};

use super::motion::{Motion, MotionWords};
use super::words::{HIT_ERROR, HitError, PlaceWords};
use crate::GpuError;

/// Greatest condition of a transform that kernels trace through: of 2^10, three of the seven digits of an f32 are left.
const MAX_CONDITION: f64 = 1024.0;

/// Instances ready for upload.
pub(super) struct Outer {
    pub(super) places: Vec<PlaceWords>,
    /// The ways of those that move, in their order.
    pub(super) motions: Vec<MotionWords>,
    pub(super) tree: BoxTree,
    pub(super) error: HitError,
    /// The instance of each of the tree's boxes: those without triangles have none.
    pub(super) instances: Vec<u32>,
}

impl Outer {
    /// Places instances of meshes whose trees have these words and boxes.
    pub(super) fn new(meshes: &[(Words<'_>, Aabb)], instances: &[Instance]) -> Result<Self, GpuError> {
        let mut outer = Placing::default();
        for (index, instance) in instances.iter().enumerate() {
            outer.add(index, instance, meshes)?;
        }
        let Placing { places, motions, boxes, numbers, error } = outer;
        let tree = BoxTree::build(&boxes, &Config::preset(Preset::Fast)).map_err(|error| untraceable(&error))?;
        let instances = tree.words().1.iter().map(|&PrimId(box_index)| numbers[box_index as usize]).collect();
        Ok(Self { places, motions, tree, error, instances })
    }
}

#[derive(Default)]
struct Placing {
    places: Vec<PlaceWords>,
    motions: Vec<MotionWords>,
    /// World space, at all times.
    boxes: Vec<Aabb>,
    /// Instance of each box.
    numbers: Vec<u32>,
    error: HitError,
}

impl Placing {
    #[expect(clippy::cast_possible_truncation, reason = "instances are numbered by u32")]
    fn add(&mut self, index: usize, instance: &Instance, meshes: &[(Words<'_>, Aabb)]) -> Result<(), GpuError> {
        let Some((words, bounds)) = meshes.get(instance.blas as usize) else {
            return Err(untraceable(&InstanceError::NoSuchBlas { instance: index, blas: instance.blas }));
        };
        let inverse = instance.object_from_world(index).map_err(|error| untraceable(&error))?;
        let motion = Motion::of(instance);
        let ends = || [Some(instance.world_from_object), instance.world_from_object_close].into_iter().flatten();
        // Norms of a transform, and the box of what it moves, are convex: on the way they are within those of the ends.
        let forward = ends().map(|end| norm_of(&end)).fold(0.0, f64::max);
        let backward = motion.as_ref().map_or_else(|| norm(&inverse), Motion::norm_of_inverse);
        let condition = forward * backward;
        if !ends().all(|end| end.is_finite()) || condition > MAX_CONDITION {
            let transform = if motion.is_some() { "motion" } else { "transform" };
            let what =
                format!("instance {index}, whose {transform} has condition {condition:e}, beyond {MAX_CONDITION:e}");
            return Err(GpuError::Untraceable { what });
        }
        self.motions.extend(motion.as_ref().map(Motion::words));
        let number = motion.as_ref().map_or(0, |_| self.motions.len() as u32);
        // The tree over instances is the first of all trees.
        self.places.push(PlaceWords::new(&inverse, &instance.world_from_object, [instance.blas + 1, number]));
        if !bounds.is_empty() {
            self.boxes.push(ends().fold(Aabb::EMPTY, |all, end| all.union(image(bounds, &end))));
            self.numbers.push(index as u32);
            let amplified = if motion.is_some() { MOVING } else { STILL } * condition;
            let at = ends().flat_map(|end| end.columns[3]).fold(0.0, |all: f64, x| all.max(f64::from(x).abs()));
            self.error = self.error.with(amplified, at, forward * f64::from(words.reach));
        }
        Ok(())
    }
}

impl Default for HitError {
    fn default() -> Self {
        Self { per_origin: 0.0, fixed: 0.0 }
    }
}

/// Hits in an instance are off by so many [`HIT_ERROR`]s times its condition, as [`HitError::with`] derives.
const STILL: f64 = 2.0;
const MOVING: f64 = 5.0;

impl HitError {
    /// The error with that of an instance, in world space: `amplified` by its transform, which takes an origin to `at` and points to
    /// within `reach_world` of there, greatest absolute coordinates.
    ///
    /// In object space, of an origin within `A = ‖M⁻¹‖·(|o| + |c|)` and with `ρ` the reach, a hit is off its triangle by at most
    /// `HIT_ERROR·(A + ρ)` and twice the drift of sheared coordinates, which is twice that of the ray: four times `6 E·A` for the
    /// origin and `5 E·‖M⁻¹‖·t|d|` for the direction. The ray itself is off by these once more. The world ray reaches
    /// `t|d| <= |o| + |c| + ‖M‖·ρ`. Times `‖M‖`, with `k = ‖M‖·‖M⁻¹‖ >= 1`: less than `(64 + 30 + 25) E·k·(|o| + |c| + ‖M‖·ρ)`;
    /// 128 E leave room for the box's own rounding and second order.
    ///
    /// Of what moves, norms are the greatest of the way, `‖M⁻¹‖` is of absolute terms, and the roundings are `21 E·9/8` of the
    /// origin and `20 E` of the direction (`shared/level/moving`): less than `(64 + 119 + 100) E`, for which 320 E stand.
    #[expect(clippy::cast_possible_truncation, reason = "there is room for a rounding")]
    fn with(self, amplified: f64, at: f64, reach_world: f64) -> Self {
        let relative = f64::from(HIT_ERROR) * amplified;
        let fixed = relative * (at + reach_world);
        Self { per_origin: self.per_origin.max(relative as f32), fixed: self.fixed.max(fixed as f32) }
    }
}

/// A box around the image of a box; its rounding is within the error of hits.
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
    GpuError::Untraceable { what: format!("instances as they stand: {error}") }
}

/// Greatest row sum of the linear part.
fn norm(rows: &[[f64; 4]; 3]) -> f64 {
    rows.iter().map(|row| row[..3].iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// Greatest row sum of the linear part of a map.
fn norm_of(map: &Affine) -> f64 {
    (0..3).map(|k| map.columns[..3].iter().map(|column| f64::from(column[k]).abs()).sum()).fold(0.0, f64::max)
}
