//! Where the BVHs of a scene come from.

use canted_lbvh::Corners;
use canted_tlas::Instance;
use canted_trace::RoundSegment;
use canted_wide::{RawBvh, TriangleBvh, WideBvh};

use super::instances::MeshBounds;
use super::leaf_curves::{CurveKinds, DeviceCurve, HostCurves};
use super::leaf_triangles::{MOST_TRIANGLES, UploadedBvh};
use super::nodes::DeviceBvh;
use super::octants::by_octants;
use super::packed::packed;
use crate::GpuError;

/// Where the BVHs of a [`TracedScene`](crate::TracedScene) come from, and what is above them.
///
/// Of a hit of a curve `u` is the position along it, and `v` the position across a ribbon, else 0, or in kernels 1 where the ray leaves. Batches of rays leave to
/// the CPU what single precision does not decide ([`Outcome::Incomplete`](crate::Outcome::Incomplete)), and rays later than shutter opening through curves whose
/// points move; kernels that use `shared/traverse` take the answer of single precision, whose hits are within [`HIT_ERROR`](crate::HIT_ERROR) of the surface, and
/// may miss a curve that a ray enters less deep than that.
pub enum Source<'a> {
    /// One level: a BVH in world space that the CPU built, which is uploaded.
    Wide(HostBvh<'a>),
    /// Two levels: instances of BVHs that the CPU built, and a BVH over them.
    Tlas {
        /// Each in its own space.
        bvhs: Vec<HostBvh<'a>>,
        /// By index into `bvhs`.
        instances: &'a [Instance],
    },
    /// BVHs that the device builds.
    Build {
        /// The triangles of each mesh; of one mesh, in world space, without instances.
        meshes: Vec<&'a [Corners]>,
        /// Which BVHs.
        bvh: DeviceBvh,
        /// Two levels, of instances by index into `meshes`.
        instances: Option<&'a [Instance]>,
    },
    /// Structures that the driver builds, for rays that it traces by its ray queries, on a device that was opened [with
    /// them](crate::Gpu::with_ray_queries).
    ///
    /// **Hits are those of the driver.** None of this crate's guarantees holds for them: a ray may pass between two triangles that share an
    /// edge, or miss a needle; `t` is single precision in the space of the instance, without a bound; of hits at the same `t` any is
    /// reported, and one at an end of the ray's interval may be missed. Another driver may give other hits.
    ///
    /// Queries and [`TracedScene::module`](crate::TracedScene::module) have the same names and layouts of hits as for other sources. Masks
    /// of instances have seven bits, or all. Not supported, and an error: instances that move, [masked](Options::masked) triangles,
    /// [parts](Options::parts), functions that accept hits, streams, kernels that use `shared/traverse`, pictures, and downloads.
    /// Curves are not triangles.
    DriverRayQueries {
        /// The triangles of each mesh; of one mesh, in world space, without instances.
        meshes: Vec<&'a [Corners]>,
        /// Two levels, of instances by index into `meshes`.
        instances: Option<&'a [Instance]>,
    },
}

/// A BVH that the CPU built, to upload it; references convert into it.
#[derive(Clone, Copy)]
pub enum HostBvh<'a> {
    /// Over triangles.
    Triangles(&'a TriangleBvh),
    /// Over round segments.
    Segments(&'a WideBvh<RoundSegment>),
    /// Over spheres, patches and other curves: cubic ones, ribbons, and those whose points move.
    Curves(HostCurves<'a>),
}

impl<'a> From<&'a TriangleBvh> for HostBvh<'a> {
    fn from(bvh: &'a TriangleBvh) -> Self {
        Self::Triangles(bvh)
    }
}

impl<'a> From<&'a WideBvh<RoundSegment>> for HostBvh<'a> {
    fn from(bvh: &'a WideBvh<RoundSegment>) -> Self {
        Self::Segments(bvh)
    }
}

impl<'a, P: DeviceCurve> From<&'a WideBvh<P>> for HostBvh<'a> {
    fn from(bvh: &'a WideBvh<P>) -> Self {
        Self::Curves(bvh.into())
    }
}

impl<'a> HostBvh<'a> {
    pub(super) fn raw(self) -> RawBvh<'a> {
        match self {
            Self::Triangles(bvh) => bvh.raw(),
            Self::Segments(bvh) => bvh.raw(),
            Self::Curves(bvh) => bvh.raw(),
        }
    }

    pub(super) fn bounds(self, words: &RawBvh<'_>) -> MeshBounds {
        let aabb = match self {
            Self::Triangles(bvh) => bvh.aabb(),
            Self::Segments(bvh) => bvh.aabb(),
            Self::Curves(bvh) => bvh.aabb(),
        };
        MeshBounds { reach: words.reach, aabb, is_of_curves: self.kinds().any() }
    }

    pub(super) fn kinds(self) -> CurveKinds {
        match self {
            Self::Triangles(_) => CurveKinds::default(),
            Self::Segments(_) => CurveKinds::SEGMENTS,
            Self::Curves(bvh) => bvh.kinds(),
        }
    }

    /// The BVH as it is uploaded.
    pub(super) fn uploaded<'w>(self, words: &RawBvh<'w>, masked: &[bool]) -> Result<UploadedBvh<'w>, GpuError> {
        let packed = packed(by_octants(words));
        let (bvh, what) = match self {
            Self::Triangles(_) => (UploadedBvh::over_triangles(packed, masked), "triangles"),
            Self::Segments(bvh) => (UploadedBvh::over_segments(packed, &bvh.primitives()), "segments"),
            Self::Curves(bvh) => (UploadedBvh::over_curves(packed, bvh.records(words)), "curves"),
        };
        let n = bvh.triangles.len();
        if n > MOST_TRIANGLES {
            return Err(GpuError::Unsupported {
                what: format!("a wide BVH whose leaves take {n} records for {what}, more than 2^26"),
            });
        }
        Ok(bvh)
    }
}

/// Options of a [`TracedScene`](crate::TracedScene).
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// In one level: the first triangle of each instance that the triangles belong to, in order. Empty: they belong to one instance.
    pub parts: &'a [u32],
    /// Of each BVH that the CPU built, by number: whether a hit of the triangle counts only where a kernel of the caller says so, e.g. by the alpha of a texture.
    /// The caller's kernels then trace the rays that may hit such a triangle first ([`TracedScene::stream_queries`](crate::TracedScene::stream_queries)); in
    /// batches all hits count. A BVH without an entry has none.
    pub masked: &'a [Vec<bool>],
}

/// What is above the BVHs.
pub(super) enum Levels<'a> {
    /// Nothing. The first triangle of each instance.
    One(&'a [u32]),
    /// A BVH over these instances.
    Two(&'a [Instance]),
}

impl<'a> Source<'a> {
    /// [`Self::Wide`] of a reference to a BVH.
    #[must_use]
    pub fn wide(bvh: impl Into<HostBvh<'a>>) -> Self {
        Self::Wide(bvh.into())
    }

    /// [`Self::Tlas`] of references to BVHs.
    #[must_use]
    pub fn tlas<B: Into<HostBvh<'a>>>(bvhs: impl IntoIterator<Item = B>, instances: &'a [Instance]) -> Self {
        Self::Tlas { bvhs: bvhs.into_iter().map(Into::into).collect(), instances }
    }

    /// [`Self::Build`] in one level; [`Self::with_instances`] adds another.
    #[must_use]
    pub fn build<M: AsRef<[Corners]> + ?Sized + 'a>(
        meshes: impl IntoIterator<Item = &'a M>,
        bvh: impl Into<DeviceBvh>,
    ) -> Self {
        Self::Build { meshes: meshes.into_iter().map(AsRef::as_ref).collect(), bvh: bvh.into(), instances: None }
    }

    /// [`Self::DriverRayQueries`] in one level; [`Self::with_instances`] adds another.
    #[must_use]
    pub fn driver_ray_queries<M: AsRef<[Corners]> + ?Sized + 'a>(meshes: impl IntoIterator<Item = &'a M>) -> Self {
        Self::DriverRayQueries { meshes: meshes.into_iter().map(AsRef::as_ref).collect(), instances: None }
    }

    /// The same BVHs in two levels.
    #[must_use]
    pub fn with_instances(self, instances: &'a [Instance]) -> Self {
        match self {
            Self::Wide(bvh) => Self::Tlas { bvhs: vec![bvh], instances },
            Self::Tlas { bvhs, .. } => Self::Tlas { bvhs, instances },
            Self::Build { meshes, bvh, .. } => Self::Build { meshes, bvh, instances: Some(instances) },
            Self::DriverRayQueries { meshes, .. } => Self::DriverRayQueries { meshes, instances: Some(instances) },
        }
    }

    pub(super) fn instances(&self) -> Option<&'a [Instance]> {
        match self {
            Self::Wide(_) => None,
            Self::Tlas { instances, .. } => Some(instances),
            Self::Build { instances, .. } | Self::DriverRayQueries { instances, .. } => *instances,
        }
    }
}
