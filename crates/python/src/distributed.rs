//! What `canted.distributed` and its tests need of a BVH besides the methods of its class.

use std::sync::Arc;

use canted::TriangleBvh;
use pyo3::prelude::*;

use crate::bvh::Bvh;
use crate::geometry::Geometry;
use crate::names;

/// The same BVH as it is now: a refit of either does not change the other.
#[pyfunction]
pub(crate) fn snapshot(bvh: &Bvh) -> Bvh {
    Bvh::shared(bvh.geometry())
}

/// Whether both are one BVH in memory.
#[pyfunction]
pub(crate) fn is_same(a: &Bvh, b: &Bvh) -> bool {
    Arc::ptr_eq(&a.geometry(), &b.geometry())
}

/// The same BVH traced with other instructions of this machine, which give the same bits: for tests.
#[pyfunction]
pub(crate) fn with_simd(bvh: &Bvh, name: &str) -> PyResult<Bvh> {
    let geometry = bvh.geometry();
    let mesh = TriangleBvh::clone(&geometry.mesh).with_path(names::simd(name)?);
    Ok(Bvh::of(Geometry { mesh: Arc::new(mesh), ..Geometry::clone(&geometry) }))
}
