//! Stacks of equal triangles: a BVH holds the first of each, as no ray hits the others.
//!
//! Exports of CAD programs and broken booleans repeat triangles thousands of times. A ray that reaches the first must test all of them, since
//! ties go to the lowest primitive. So where a sample finds such stacks, each triangle with the corners of an earlier one, in their order,
//! becomes a point for the BVH. Hits are the same bits: a point is never hit, and the earlier triangle is hit wherever the later one is, with
//! the same `t`. With another order of the corners `t` may differ by a rounding, so such a triangle stays.
//!
//! A query may reject the earlier triangle and accept the later one, so both must be of one [`Kind`].

use std::borrow::Cow;

use canted_scene::{Material, Mesh, Scene};
use rayon::prelude::*;

/// Triangles that are sampled.
const SAMPLE: usize = 4096;

/// Equal ones among these that make a stack.
const STACK: usize = 4;

/// What decides, for given corners, whether a query accepts a hit.
type Kind = u32;

/// The kind of the surfaces of a material; `None` where alpha decides, which differs from point to point.
fn kind(material: &Material, mirrors: bool) -> Option<Kind> {
    let flags = [material.double_sided, material.transmission == 0.0, mirrors];
    let kind = flags.into_iter().fold(0, |kind, flag| 2 * kind + Kind::from(flag));
    (!material.uses_alpha()).then_some(kind)
}

/// The kind of a triangle of a mesh.
fn kind_of(scene: &Scene, mesh: &Mesh, triangle: u32, mirrors: bool) -> Option<Kind> {
    let after = mesh.parts.partition_point(|part| part.first_triangle <= triangle);
    let part = mesh.parts.get(after.checked_sub(1)?)?;
    kind(scene.materials.get(part.material.0 as usize)?, mirrors)
}

/// The kinds of the parts of a mesh, which decide what [`of_mesh`] keeps.
pub(crate) fn kinds<'a>(scene: &'a Scene, mesh: &'a Mesh) -> impl Iterator<Item = u32> + 'a {
    mesh.parts.iter().flat_map(|part| {
        let kind = scene.materials.get(part.material.0 as usize).and_then(|material| kind(material, false));
        [part.first_triangle, kind.unwrap_or(Kind::MAX)]
    })
}

/// The triangles of a mesh for its BVH.
pub(crate) fn of_mesh<'a>(scene: &Scene, mesh: &'a Mesh) -> Cow<'a, [[u32; 3]]> {
    let Mesh { positions, triangles, close, .. } = mesh;
    // Triangles that move apart are equal at one time only.
    if close.is_some() || !has_stacks(positions, triangles) {
        return triangles.into();
    }
    let mut kept = triangles.clone();
    flatten_copies(positions, &mut kept, |triangle| kind_of(scene, mesh, triangle, false));
    kept.into()
}

/// Makes a point of each triangle of all instances in world space that has the corners and the kind of an earlier one, where there are stacks:
/// given the first triangle of each instance, and whether it mirrors.
pub(crate) fn in_scene(
    scene: &Scene,
    positions: &[[f32; 3]],
    triangles: &mut [[u32; 3]],
    first: &[u32],
    mirrors: &[bool],
) {
    if has_stacks(positions, triangles) {
        flatten_copies(positions, triangles, |triangle| {
            let instance = first.partition_point(|&first| first <= triangle) - 1;
            let mesh = &scene.meshes[scene.instances[instance].mesh.0 as usize];
            kind_of(scene, mesh, triangle - first[instance], mirrors[instance])
        });
    }
}

/// The bits of the corners of a triangle; `None` for an index out of range, which the build of the BVH reports.
fn corners(positions: &[[f32; 3]], triangle: [u32; 3]) -> Option<[[u32; 3]; 3]> {
    let [a, b, c] = triangle.map(|vertex| positions.get(vertex as usize).map(|position| position.map(f32::to_bits)));
    Some([a?, b?, c?])
}

/// A hash of words: different ones are rarely equal.
fn hash(words: impl IntoIterator<Item = u32>) -> u64 {
    // The multiplier of Steele and Vigna 2021.
    words
        .into_iter()
        .fold(0, |hash: u64, word| (hash.rotate_left(23) ^ u64::from(word)).wrapping_mul(0xd134_2543_de82_ef95))
}

/// Whether a sample of the triangles has stacks, with certainty for large ones.
fn has_stacks(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> bool {
    let stride = triangles.len().div_ceil(SAMPLE).max(1);
    let sampled = triangles.iter().step_by(stride).filter_map(|&triangle| corners(positions, triangle));
    let mut hashes: Vec<u64> = sampled.map(|corners| hash(corners.into_iter().flatten())).collect();
    hashes.sort_unstable();
    hashes.windows(STACK).any(|equal| equal[0] == equal[STACK - 1])
}

/// Makes a point of each triangle with the corners and the kind of an earlier one.
fn flatten_copies(positions: &[[f32; 3]], triangles: &mut [[u32; 3]], kind: impl Fn(u32) -> Option<Kind> + Sync) {
    let key = |index: u32| Some((corners(positions, triangles[index as usize])?, kind(index)?));
    let hashed = |index: u32| {
        let (corners, kind) = key(index)?;
        Some((hash(corners.into_iter().flatten().chain([kind])), index))
    };
    let mut all: Vec<(u64, u32)> = (0..triangles.len() as u32).into_par_iter().filter_map(hashed).collect();
    all.par_sort_unstable();
    let is_copy = |pair: &&[(u64, u32)]| pair[0].0 == pair[1].0 && key(pair[0].1) == key(pair[1].1);
    let copies: Vec<u32> = all.windows(2).filter(is_copy).map(|pair| pair[1].1).collect();
    for index in copies {
        let triangle = &mut triangles[index as usize];
        *triangle = [triangle[0]; 3];
    }
}
