//! Packs curves: `shared/surface_curve` has the form of segments, `shared/surface_kinds` that of all kinds, `shared/surface_patch` that of patches.

use canted_gpu::{DeviceCurve, HostBvh};
use canted_scene::{CurveSegments, CurveShape, Curves, Mesh, MeshClose};
use canted_trace::{BezierPatch, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment};
use canted_wide::{Moving, WideBvh};

use super::materials::Columns;
use super::vertices::{PackedTriangle, put};
use crate::CurveBvh;

/// Bits of a kind, as in `shared/curve`.
const CUBIC: u32 = 1;
const RIBBON: u32 = 2;
const MOVING: u32 = 4;
const SWEPT: u32 = 8;

/// As in `shared/patch`.
const SHEET: u32 = 32;

/// Marks the numbers of inner control points, which are stored as `f32`.
const INNER_BIT: u32 = 1 << 30;

/// The kind of the curves of a mesh; 0 for a mesh without.
pub(super) fn curve_kind(mesh: &Mesh) -> u32 {
    let Some(Curves { segments, shape, .. }) = &mesh.curves else { return 0 };
    let bit = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
    SWEPT
        | bit(matches!(segments, CurveSegments::Cubic(_)), CUBIC)
        | bit(*shape == CurveShape::Ribbon && !mesh.has_patches(), RIBBON)
        | bit(mesh.has_patches(), SHEET)
        | bit(mesh.close.is_some(), MOVING)
}

/// The mesh with control points of its own for each patch, one patch after another; `None` for other meshes.
pub(super) fn with_own_points(mesh: &Mesh) -> Option<Mesh> {
    let Some(Curves { radii, segments: CurveSegments::Patches(list), shape }) = &mesh.curves else { return None };
    fn each<T: Copy>(list: &[[u32; 16]], values: &[T]) -> Vec<T> {
        list.as_flattened().iter().map(|&i| values[i as usize]).collect()
    }
    let numbers = (0..list.len() as u32).map(|k| std::array::from_fn(|m| 16 * k + m as u32));
    let close = mesh.close.as_ref().map(|close| MeshClose {
        positions: each(list, &close.positions),
        radii: close.radii.as_ref().map(|radii| each(list, radii)),
        normals: None,
        tangents: None,
    });
    Some(Mesh {
        positions: each(list, &mesh.positions),
        colors: mesh.colors.as_ref().map(|colors| each(list, colors)),
        curves: Some(Curves {
            radii: each(list, radii),
            segments: CurveSegments::Patches(numbers.collect()),
            shape: *shape,
        }),
        parts: mesh.parts.clone(),
        close,
        ..Mesh::default()
    })
}

/// The curves whose points start at vertex `base`, without materials. Patches have points [of their own](with_own_points).
pub(super) fn packed_curves(
    mesh: &Mesh,
    Curves { radii, segments, .. }: &Curves,
    base: u32,
    columns: &Columns,
) -> Vec<PackedTriangle> {
    let strands = mesh.strand_coordinates();
    let packed = |[a, d]: [u32; 2], [p, q]: [f32; 2], [from, to]: [f32; 2]| PackedTriangle {
        vertices: [base + a, base + d, base + a],
        material: 0,
        normal: [p, q, from],
        area_root: to,
    };
    let inner = |i: u32| f32::from_bits(INNER_BIT | (base + i));
    match segments {
        CurveSegments::Linear(list) => {
            let has_column = columns.radius > 0;
            let radius = |i: u32| if has_column { 0.0 } else { radii[i as usize] };
            list.iter().zip(strands).map(|(&[a, b], part)| packed([a, b], [radius(a), radius(b)], part)).collect()
        }
        CurveSegments::Cubic(list) => {
            list.iter().zip(strands).map(|(&[a, b, c, d], part)| packed([a, d], [inner(b), inner(c)], part)).collect()
        }
        CurveSegments::Patches(list) => {
            list.iter().map(|points| packed([points[0], points[15]], [0.0; 2], [0.0, 1.0])).collect()
        }
    }
}

/// Writes the radii of points of curves, and what is at shutter closing.
pub(super) fn put_curves(words: &mut [f32], mesh: &Mesh, columns: &Columns) {
    let Some(Curves { radii, .. }) = mesh.curves.as_ref().filter(|_| columns.radius > 0) else { return };
    let stride = columns.stride as usize;
    put(words, stride, columns.radius, &radii.iter().map(|&radius| [radius]).collect::<Vec<_>>());
    if let Some(close) = &mesh.close {
        let close_radii = close.radii.as_ref().unwrap_or(radii);
        let balls = close.positions.iter().zip(close_radii).map(|(&[x, y, z], &radius)| [x, y, z, radius]);
        put(words, stride, columns.close, &balls.collect::<Vec<_>>());
    }
}

/// The greatest absolute coordinate of points of curves and of their control balls, at any time.
pub(super) fn curve_reach(mesh: &Mesh, Curves { radii, .. }: &Curves) -> f32 {
    let of = |positions: &[[f32; 3]], radii: &[f32]| {
        let reach = |(p, radius): (&[f32; 3], &f32)| p.iter().fold(0.0, |all: f32, x| all.max(x.abs())) + radius;
        positions.iter().zip(radii).map(reach).fold(0.0, f32::max)
    };
    let closing = mesh.close.as_ref().map_or(0.0, |close| of(&close.positions, close.radii.as_ref().unwrap_or(radii)));
    of(&mesh.positions, radii).max(closing)
}

/// A BVH over curves or patches that move, for a device; `None` for kinds that are not known here.
pub(super) fn moving_curves(bvh: &dyn CurveBvh) -> Option<HostBvh<'_>> {
    fn of<P: DeviceCurve + 'static>(bvh: &dyn CurveBvh) -> Option<HostBvh<'_>> {
        bvh.as_any().downcast_ref::<WideBvh<P>>().map(HostBvh::from)
    }
    of::<Moving<RoundSegment>>(bvh)
        .or_else(|| of::<Moving<RoundCubic>>(bvh))
        .or_else(|| of::<Moving<RibbonSegment>>(bvh))
        .or_else(|| of::<Moving<RibbonCubic>>(bvh))
        .or_else(|| of::<Moving<BezierPatch>>(bvh))
}
