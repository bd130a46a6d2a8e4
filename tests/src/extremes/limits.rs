//! Inputs above the limits: an error with the count, before the input is read.
//!
//! Not covered: inputs just at the limits, and above those of 2^30 triangles in memory and of 2^26 instances, which need too much
//! memory; the crates' own tests use smaller limits (`emit/tests.rs` of `canted-wide`, `corners.rs` of `canted-lbvh`, `tlas.rs` of
//! `canted-tlas`, `prepare.rs` of `canted-renderer`).

use std::fmt::Display;

use canted_lbvh::Strategy;
use canted_obb::{Aabb, Affine};
use canted_renderer::{Accel, Levels, StructureConfig, flatten, prepare};
use canted_scene::{Instance, Mesh, MeshId, Scene};
use canted_trace::{ScaledRay, Watertight};
use canted_wide::{Config, MAX_PRIMITIVES, MAX_TRIANGLES, Primitive, PrimitiveHit, TriangleBvh, WideBvh};

use super::{Oracle, Promise, Row};

/// A zero-sized shape, so that any number of them fits in memory; its bounds are invalid, so reading one is an error.
#[derive(Clone, Copy)]
struct Flawed;

impl Primitive for Flawed {
    fn bounds(&self) -> Aabb {
        Aabb::EMPTY
    }

    fn intersect(&self, _: &ScaledRay, _: f32) -> Option<PrimitiveHit> {
        None
    }
}

/// Number of triangles in the mesh of [`scene`].
const OF_MESH: usize = 1 << 14;

/// A mesh instanced so often that there are more than `n` triangles; it has no vertices, so reading it is an error.
fn scene(n: usize) -> Scene {
    let instance = Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    };
    let mesh = Mesh { triangles: vec![[7, 8, 9]; OF_MESH], ..Mesh::default() };
    Scene { meshes: vec![mesh], instances: vec![instance; n / OF_MESH + 1], ..Scene::default() }
}

/// Whether the error message starts with the count.
fn is_reported<T>(built: Result<T, impl Display>, n: usize) -> bool {
    built.is_err_and(|error| error.to_string().starts_with(&format!("{n} ")))
}

pub(super) fn rows() -> Vec<Row> {
    const REPORTED: Promise = Promise::none(
        "limits",
        "above the limits: 2^27 triangles, 2^26 shapes, 2^30 triangles in a binary BVH",
        "an error with the count, before the input is read",
        Oracle::Known,
        "inputs accepted",
    );
    let mut rows = vec![];
    let mut row = |routine: &str, is_reported: bool| rows.push(REPORTED.count(routine, 1, usize::from(!is_reported)));
    // The system maps zero pages lazily, so the memory is never touched.
    let triangles = vec![[0u32; 3]; MAX_TRIANGLES + 1];
    row(
        "Wide::build",
        is_reported(TriangleBvh::<Watertight>::build(&[], &triangles, &Config::default()), triangles.len()),
    );
    let shapes = vec![Flawed; MAX_PRIMITIVES + 1];
    row("WideBvh::build", is_reported(WideBvh::<Flawed>::build(shapes, &Config::default()), MAX_PRIMITIVES + 1));
    let one = StructureConfig { levels: Levels::One, ..StructureConfig::default() };
    let crowd = scene(MAX_TRIANGLES);
    row("prepare, one level", is_reported(prepare::<Watertight>(&crowd, &one), crowd.n_placed_triangles()));
    let crowd = scene(canted_lbvh::MAX_PRIMITIVES);
    let binary = StructureConfig { accel: Accel::Binary { strategy: Strategy::Dop, builder: None }, ..one };
    row("prepare, one binary level", is_reported(prepare::<Watertight>(&crowd, &binary), crowd.n_placed_triangles()));
    row("flatten", is_reported(flatten(&crowd), crowd.n_placed_triangles()));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_detects_success_and_a_missing_count() {
        assert!(is_reported(Err::<(), _>("9 triangles exceed the limit"), 9));
        assert!(!is_reported(Ok::<_, String>(()), 9));
        for error in ["99 triangles are too many", "triangle 9 has no vertices"] {
            assert!(!is_reported(Err::<(), _>(error), 9), "{error}");
        }
    }
}
