//! Instances: their transforms and motions as rays read them, the BVH over them, and the error of hits in world space.

use bytemuck::{Pod, Zeroable};
use canted_obb::vector::{cross, dot};
use canted_obb::{Aabb, Affine, Obb, PrimId};
use canted_tlas::{Instance, InstanceError, row_sum_norm};
use canted_wide::{Config, Preset, PrimitiveError, RawBvh, WideBvh};

use super::layout::{HIT_ERROR, HitError, InstanceData, check_coordinates};
use crate::GpuError;

/// Maximum condition number of a transform: at 2^10, three of the seven digits of an f32 remain.
///
/// The CPU has 2^20, because it transforms rays in f64. Here boxes and the top level are padded by at least 128 times 2^-23 times the condition number, relative
/// to the coordinates ([`HIT_ERROR`]). At 2^20 that is sixteen times the scene: every ray would enter every node of every such instance, and `t` would have
/// no digit. It takes rays that are transformed by emulated f64 in the traversal itself, which costs all other rays.
pub const MAX_CONDITION: f64 = 1024.0;

/// Bounds of a mesh in object space.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeshBounds {
    /// The largest absolute coordinate.
    pub(super) reach: f32,
    /// Empty for a mesh without triangles.
    pub(super) aabb: Aabb,
    /// Whether it is made of curves instead of triangles.
    pub(super) is_of_curves: bool,
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
            WideBvh::over_with(packing.boxes.clone(), config).map_err(|error| untraceable(&of_instance(error)))?;
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

/// Linear parts of inverses are below it, as in `shared/volumes.wgsl`, so that sums of three are `f32`.
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

    fn add(&mut self, index: usize, instance: &Instance, meshes: &[MeshBounds]) -> Result<(), GpuError> {
        let Some(MeshBounds { reach: reach_object, aabb, is_of_curves }) = meshes.get(instance.blas as usize) else {
            return Err(untraceable(&InstanceError::NoSuchBlas { instance: index, blas: instance.blas }));
        };
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
        check_scale(index, &inverse)?;
        let reach = ends().map(|end| end.reach(*reach_object)).fold(0.0, f64::max);
        check_coordinates(|| format!("instance {index}"), reach)?;
        self.motions.extend(motion.as_ref().map(MotionPolynomials::words));
        let number = motion.as_ref().map_or(0, |_| self.motions.len() as u32);
        // BVH 0 is the top level.
        let words = [instance.blas + 1, number, instance.mask, (*is_of_curves).into()];
        self.instances.push(InstanceData::new(&inverse, &instance.world_from_object, words));
        if !aabb.is_empty() && instance.mask != 0 {
            self.boxes.push(ends().fold(Aabb::EMPTY, |all, end| all.union(image(aabb, &end))));
            self.numbers.push(index as u32);
            let amplified = if motion.is_some() { MOVING } else { STILL } * condition;
            let at = ends().flat_map(|end| end.columns[3]).fold(0.0, |all: f64, x| all.max(f64::from(x).abs()));
            self.error = self.error.with(amplified, at, forward * f64::from(*reach_object));
        }
        Ok(())
    }
}

/// Rejects an instance whose inverse transform leaves the range of single precision.
pub(super) fn check_scale(index: usize, inverse: &[[f64; 4]; 3]) -> Result<(), GpuError> {
    if inverse.iter().flat_map(|row| &row[..3]).any(|x| x.abs() >= MOST_OF_INVERSE) {
        return Err(GpuError::Unsupported { what: format!("instance {index}, which scales by less than 2^-100") });
    }
    Ok(())
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
    fn with(self, amplified: f64, at: f64, reach_world: f64) -> Self {
        let relative = f64::from(HIT_ERROR) * amplified;
        let fixed = relative * (at + reach_world);
        Self { per_origin: self.per_origin.max(relative as f32), fixed: self.fixed.max(fixed as f32) }
    }
}

/// World-space boxes of instances with triangles: the transformed root, which is oriented; all places of a moving one.
pub(super) fn placed_boxes(packing: &Packing, roots: &[Option<Obb>], instances: &[Instance]) -> Vec<Obb> {
    let placed = |(&number, swept): (&u32, &Aabb)| {
        let instance = &instances[number as usize];
        match &roots[instance.blas as usize] {
            Some(root) if instance.world_from_object_close.is_none() => root.transformed(&instance.world_from_object),
            _ => Obb::from_aabb(swept),
        }
    };
    packing.numbers.iter().zip(&packing.boxes).map(placed).collect()
}

/// Bounds of a transformed box; its rounding is within the error of hits.
fn image(bounds: &Aabb, world_from_object: &Affine) -> Aabb {
    let mut all = Aabb::EMPTY;
    for corner in 0..8 {
        let point = std::array::from_fn(|k| if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] });
        let image = world_from_object.point_f64(point.map(f64::from)).map(|x| x as f32);
        all = all.union(Aabb { min: image, max: image });
    }
    all
}

pub(super) fn untraceable(error: &dyn std::error::Error) -> GpuError {
    GpuError::Unsupported { what: error.to_string() }
}

type Vector = [f64; 3];

/// The inverse of a transform that changes linearly from shutter opening to closing: cofactors and determinant by their
/// Bernstein coefficients.
///
/// Kernels divide one by the other. If all coefficients of the determinant have the same sign, the error of the quotient is
/// bounded by [`MotionPolynomials::norm_of_inverse`]. This holds for rotations of less than 120 degrees between transforms of
/// similar scale.
#[derive(Clone, Debug)]
pub struct MotionPolynomials {
    /// Coefficients of the cofactors for each axis: rows of the inverse times the determinant.
    cofactors: [[Vector; 3]; 3],
    determinant: [f64; 4],
    close: Affine,
}

impl MotionPolynomials {
    /// The motion of an instance; `None` if it does not move.
    #[must_use]
    pub fn of(instance: &Instance) -> Option<Self> {
        let open = instance.world_from_object;
        instance.world_from_object_close.filter(|close| *close != open).map(|close| Self::new(&open, close))
    }

    fn new(open: &Affine, close: Affine) -> Self {
        let [m, n] = [open, &close].map(|map| map.columns.map(|column| column.map(f64::from)));
        // Between `M` and `N` the cofactors are `(1-s)² cof M + 2s(1-s) C + s² cof N`, where `C` contains products of both, and
        // similarly for the determinant: polar forms of a square and a cube (Ramshaw 1989).
        let cofactors: [[Vector; 3]; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let (mixed, other) = (cross(m[i], n[j]), cross(n[i], m[j]));
            [cross(m[i], m[j]), std::array::from_fn(|x| 0.5 * (mixed[x] + other[x])), cross(n[i], n[j])]
        });
        let [first, between, last] = cofactors[0];
        let third = |a: f64, b: f64| (a + 2.0 * b) / 3.0;
        let determinant = [
            dot(m[0], first),
            third(dot(n[0], first), dot(m[0], between)),
            third(dot(m[0], last), dot(n[0], between)),
            dot(n[0], last),
        ];
        Self { cofactors, determinant, close }
    }

    /// Upper bound, over all times, of the greatest row sum of absolute terms of the inverse; infinite if coefficients of the
    /// determinant are zero or differ in sign.
    ///
    /// Raised to degree three, cofactors and determinant are means of their coefficients with the same weights. A quotient of
    /// means of nonnegative numbers is at most the greatest quotient.
    #[must_use]
    pub fn norm_of_inverse(&self) -> f64 {
        let sign = self.determinant[0].signum();
        let at = |coefficient: usize| {
            let rows = self.cofactors.map(|[a, b, c]| {
                let [a, b, c] = [a, b, c].map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
                [a, (a + 2.0 * b) / 3.0, (2.0 * b + c) / 3.0, c][coefficient]
            });
            let divisor = sign * self.determinant[coefficient];
            let greatest = rows.into_iter().fold(0.0, f64::max);
            if divisor > 0.0 && greatest.is_finite() { greatest / divisor } else { f64::INFINITY }
        };
        (0..4).map(at).fold(0.0, f64::max)
    }

    /// Divisor of the cofactors, without sign: the greatest coefficient of the determinant.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.determinant.iter().fold(0.0, |all, x| all.max(x.abs()))
    }

    pub(super) fn words(&self) -> MotionData {
        let factor = self.determinant[0].signum() / self.scale();
        let [x, y, z, shift] = self.close.columns;
        let padded = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        MotionData {
            cofactors: self.cofactors.map(|axis| axis.map(|row| padded(row.map(|c| (factor * c) as f32)))),
            determinant: self.determinant.map(|d| (factor * d) as f32),
            columns: [x, y, z, shift].map(padded),
        }
    }
}

/// `Motion` in `shared.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct MotionData {
    cofactors: [[[f32; 4]; 3]; 3],
    determinant: [f32; 4],
    columns: [[f32; 4]; 4],
}

#[cfg(test)]
mod tests {
    use canted_shaders::{Number, choice, wgsl};
    use canted_shaders::{Shader, Variant};
    use canted_wide::TriangleBvh;
    use std::mem::offset_of;

    use super::*;

    /// A triangle with largest coordinate `reach`; an empty mesh for zero.
    fn mesh(reach: f32) -> TriangleBvh {
        let triangles: &[[u32; 3]] = if reach > 0.0 { &[[0, 1, 2]] } else { &[] };
        let positions = [[0.0; 3], [reach, 0.0, 0.0], [0.0, reach, 0.0]];
        TriangleBvh::build_with(&positions, triangles, Preset::Fast).unwrap()
    }

    fn placed(reaches: &[f32], instances: &[Instance]) -> Result<TopLevel, String> {
        let meshes: Vec<_> = reaches.iter().map(|&reach| mesh(reach)).collect();
        let bounds: Vec<_> = meshes
            .iter()
            .map(|mesh| MeshBounds { reach: mesh.raw().reach, aabb: mesh.aabb(), is_of_curves: false })
            .collect();
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

    fn about_z(angle: f64, scale: f64) -> Affine {
        let column = |c: Vector| c.map(|x| (scale * x) as f32);
        let (sine, cosine) = angle.sin_cos();
        let [x, y, z] = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, -1.0]].map(column);
        Affine { columns: [x, y, z, [1.0, 2.0, 3.0]] }
    }

    /// The inverse at a time, by Gaussian elimination.
    fn inverse(open: &Affine, close: &Affine, time: f64) -> [Vector; 3] {
        let mut rows: [[f64; 6]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| match j {
                0..3 => {
                    let [from, to] = [open, close].map(|map| f64::from(map.columns[j][i]));
                    from + time * (to - from)
                }
                _ => f64::from(u8::from(j - 3 == i)),
            })
        });
        for k in 0..3 {
            let pivot = (k..3).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).unwrap();
            rows.swap(k, pivot);
            let of_pivot = rows[k].map(|x| x / rows[k][k]);
            rows = std::array::from_fn(|i| {
                std::array::from_fn(|j| if i == k { of_pivot[j] } else { rows[i][j] - rows[i][k] * of_pivot[j] })
            });
        }
        rows.map(|row| [row[3], row[4], row[5]])
    }

    #[test]
    fn cofactors_over_determinant_match_the_inverse_at_all_times() {
        for (angle, scale) in [(0.0, 1.0), (0.4, 1.0), (1.5, 1e-3), (2.0, 3.0), (-1.0, 0.2)] {
            let (open, close) = (about_z(0.3, 1.0), about_z(0.3 + angle, scale));
            let motion = MotionPolynomials::new(&open, close);
            let bound = motion.norm_of_inverse();
            let mut greatest = 0.0_f64;
            for step in 0..=64 {
                let time = f64::from(step) / 64.0;
                let rest = 1.0 - time;
                let two = [rest * rest, 2.0 * time * rest, time * time];
                let three =
                    [rest * rest * rest, 3.0 * time * rest * rest, 3.0 * time * time * rest, time * time * time];
                let determinant: f64 = (0..4).map(|i| three[i] * motion.determinant[i]).sum();
                for (row, axis) in inverse(&open, &close, time).into_iter().zip(motion.cofactors) {
                    greatest = greatest.max(row.iter().map(|x| x.abs()).sum());
                    for (k, expected) in row.into_iter().enumerate() {
                        let cofactor: f64 = (0..3).map(|i| two[i] * axis[i][k]).sum();
                        let off = cofactor / determinant - expected;
                        assert!(off.abs() <= 1e-9 * bound, "{angle} {scale} at {time}: {off}");
                    }
                }
            }
            assert!(bound >= greatest && bound <= 8.0 * greatest, "{angle} {scale}: {bound}, {greatest}");
        }
    }

    #[test]
    fn motions_with_cancellation_have_no_bound() {
        // A rotation of 130 degrees, one through a singular matrix, and a mirror.
        for angle in [130.0_f64, 180.0] {
            assert_eq!(
                MotionPolynomials::new(&about_z(0.0, 1.0), about_z(angle.to_radians(), 1.0)).norm_of_inverse(),
                f64::INFINITY
            );
        }
        assert_eq!(MotionPolynomials::new(&Affine::IDENTITY, about_z(0.0, 1.0)).norm_of_inverse(), f64::INFINITY);
    }

    #[test]
    fn motion_layout_matches_the_kernel() {
        let chosen = Variant::none()
            .with(choice::Level::Moving)
            .with(choice::NodeKinds::Any)
            .with(choice::Traverse::Wide)
            .with(choice::Mask::None)
            .with(choice::Count::None)
            .with(choice::Each::All)
            .number(Number::StackSize, 4)
            .number(Number::MaxIterations, 1000);
        let shader = Shader::new(wgsl::trace::CLOSEST, &chosen).unwrap();
        let layout = shader.layout("Motion").unwrap();
        let columns = offset_of!(MotionData, columns);
        let offsets = [
            offset_of!(MotionData, cofactors),
            offset_of!(MotionData, determinant),
            columns,
            columns + 16,
            columns + 32,
            columns + 48,
        ];
        let found: Vec<u32> = layout.members.iter().map(|(_, offset)| *offset).collect();
        assert_eq!((found, layout.size), (offsets.map(|x| x as u32).to_vec(), size_of::<MotionData>() as u32));
    }
}
