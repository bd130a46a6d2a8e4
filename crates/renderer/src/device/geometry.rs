//! Packs triangles, vertices and transforms.

use bytemuck::{Pod, Zeroable};
use canted_gpu::MotionPolynomials;
use canted_obb::{Aabb, Affine};
use canted_scene::{Instance, Mesh, Scene};
use rayon::prelude::*;

use super::curves::{curve_kind, curve_reach, packed_curves, put_curves, with_own_points};
use super::materials::{Columns, Materials};
use super::slack;
use super::vertices::{PackedTriangle, in_range, length_of, put, put_attributes};
use crate::scene_bvh::instances;
use crate::surface::Pose;
use crate::{narrow, wide};

/// Set in the material of a triangle whose flattened instance mirrors.
const MIRRORED: u32 = 1 << 31;

/// `Placement` of `shared/placement`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedPlacement {
    pub(super) x: [f32; 3],
    pub(super) slack: f32,
    pub(super) y: [f32; 3],
    pub(super) handedness: f32,
    pub(super) z: [f32; 3],
    pub(super) first_triangle: u32,
    pub(super) shift: [f32; 3],
    pub(super) scale_root: f32,
    pub(super) cofactor_x: [f32; 3],
    pub(super) motion: u32,
    pub(super) cofactor_y: [f32; 3],
    pub(super) curve_kind: u32,
    pub(super) cofactor_z: [f32; 3],
    padding_z: u32,
}

/// The space of the meshes.
pub(super) enum Placed {
    /// One instance in world space.
    One,
    /// Instances in world space, by the number of their first triangle.
    Flat(Vec<u32>),
    /// Meshes in object space.
    Instances(Vec<PackedPlacement>),
}

/// All triangles of a scene.
pub(super) struct Geometry {
    pub(super) vertices: Vec<f32>,
    pub(super) triangles: Vec<PackedTriangle>,
    pub(super) placed: Placed,
    /// Ray offset of a scene in world space, see `slack`.
    pub(super) slack: f32,
}

impl Geometry {
    /// Packs the meshes in object space, or all instances in world space if `is_flat`.
    pub(super) fn pack(scene: &Scene, columns: &Columns, is_flat: bool, materials: &mut Materials) -> Self {
        let mut all = Self { vertices: vec![], triangles: vec![], placed: Placed::One, slack: 0.0 };
        if is_flat {
            let mut firsts = vec![];
            let mut reach = 0.0_f32;
            for instance in &scene.instances {
                firsts.push(all.count());
                let mesh = &scene.meshes[instance.mesh.0 as usize];
                reach = reach.max(all.add(mesh, columns, &instance.world_from_object, materials));
            }
            all.slack = slack::in_world(reach);
            if firsts.len() != 1 {
                all.placed = Placed::Flat(firsts);
            }
            return all;
        }
        let of_meshes: Vec<(u32, f32)> = scene
            .meshes
            .iter()
            .map(|mesh| (all.count(), all.add(mesh, columns, &Affine::IDENTITY, materials)))
            .collect();
        let motions: Vec<Option<MotionPolynomials>> = instances(scene).iter().map(MotionPolynomials::of).collect();
        let mut n_motions = 0;
        let placement = |(instance, motion): (&Instance, &Option<MotionPolynomials>)| {
            let (first_triangle, reach) = of_meshes[instance.mesh.0 as usize];
            let curve_kind = curve_kind(&scene.meshes[instance.mesh.0 as usize]);
            let still =
                PackedPlacement { curve_kind, ..packed_placement(&instance.world_from_object, first_triangle, reach) };
            let Some(motion) = motion else { return still };
            // In the order of the top-level BVH.
            n_motions += 1;
            let ends = [Some(instance.world_from_object), instance.world_from_object_close];
            PackedPlacement {
                motion: n_motions - 1,
                slack: slack::of_moving(ends.into_iter().flatten(), motion, reach),
                scale_root: rounded(motion.scale().sqrt()),
                ..still
            }
        };
        all.placed = Placed::Instances(scene.instances.iter().zip(&motions).map(placement).collect());
        all
    }

    fn count(&self) -> u32 {
        self.triangles.len() as u32
    }

    /// Adds a transformed mesh; returns its greatest absolute coordinate.
    fn add(&mut self, mesh: &Mesh, columns: &Columns, map: &Affine, materials: &mut Materials) -> f32 {
        let own = with_own_points(mesh);
        let mesh = own.as_ref().unwrap_or(mesh);
        let is_mirrored = map.determinant() < 0.0;
        let stride = columns.stride as usize;
        let base = (self.vertices.len() / stride) as u32;
        let start = self.vertices.len();
        self.vertices.resize(start + stride * mesh.positions.len(), 0.0);
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|&p| map.point(p)).collect();
        let words = &mut self.vertices[start..];
        put(words, stride, 0, &positions);
        let pose = Pose::fixed(map);
        put_attributes(words, mesh, columns, &pose);
        put_curves(words, mesh, columns);
        let segments = mesh.curves.as_ref().map(|curves| packed_curves(mesh, curves, base, columns));
        let n = segments.as_ref().map_or(mesh.triangles.len(), Vec::len);
        for (index, part) in mesh.parts.iter().enumerate() {
            let end = mesh.parts.get(index + 1).map_or(n, |next| next.first_triangle as usize);
            let material = materials.number(part.material, mesh) | if is_mirrored { MIRRORED } else { 0 };
            if let Some(segments) = &segments {
                let own = segments[part.first_triangle as usize..end].iter();
                self.triangles.extend(own.map(|&segment| PackedTriangle { material, ..segment }));
                continue;
            }
            let own = mesh.triangles[part.first_triangle as usize..end].par_iter();
            self.triangles.par_extend(own.map(|&corners| packed_triangle(corners, base, mesh, &pose, material)));
        }
        match &mesh.curves {
            None => Aabb::from_points(mesh.triangles.iter().flatten().map(|&i| positions[i as usize])).reach(),
            Some(curves) => curve_reach(mesh, curves),
        }
    }
}

/// A triangle of a mesh whose vertices start at `base`, placed in this pose.
///
/// The normal comes from vertices in `f64`: far from the origin, rounded vertices would tilt a small triangle. It has the bits of
/// the CPU's normal, because a tangent frame changes with the sign of a zero component.
fn packed_triangle(corners: [u32; 3], base: u32, mesh: &Mesh, pose: &Pose, material: u32) -> PackedTriangle {
    let [a, b, c] = corners.map(|i| wide(mesh.positions[i as usize]));
    let winding = pose.normal_world((b - a).cross(c - a));
    PackedTriangle {
        vertices: corners.map(|i| base + i),
        material,
        normal: winding.try_normalize().map_or([0.0; 3], narrow),
        area_root: winding.length().sqrt() as f32,
    }
}

fn rounded(x: f64) -> f32 {
    x as f32
}

fn packed_placement(map: &Affine, first_triangle: u32, reach: f32) -> PackedPlacement {
    let [x, y, z, shift] = map.columns;
    let Pose { cofactor, .. } = Pose::fixed(map);
    let [cofactor_x, cofactor_y, cofactor_z] = in_range(cofactor).map(narrow);
    PackedPlacement {
        x,
        slack: slack::of_instance(map, reach),
        y,
        handedness: if map.determinant() < 0.0 { -1.0 } else { 1.0 },
        z,
        first_triangle,
        shift,
        scale_root: rounded(length_of(cofactor).sqrt()),
        cofactor_x,
        motion: u32::MAX,
        cofactor_y,
        curve_kind: 0,
        cofactor_z,
        padding_z: 0,
    }
}
