//! Scenes of round curves and spheres.
//!
//! Holds: as `scene`; buffers are made before a scene reads them and live as long as it does.
//! Source: Embree API reference, `RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE`, `RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE`,
//! `RTC_GEOMETRY_TYPE_SPHERE_POINT`.
#![expect(unsafe_code, reason = "the C interface; every block states why it is sound")]

use super::scene::{Buffers, Device, Scene, SceneError};
use super::{Library, Options};

const BUFFER_INDEX: i32 = 0;
const BUFFER_VERTEX: i32 = 1;
const BUFFER_FLAGS: i32 = 32;
const FORMAT_UCHAR: i32 = 0x1001;
const FORMAT_UINT: i32 = 0x5001;
const FORMAT_FLOAT4: i32 = 0x9004;

/// What the points of [`Curves`] are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveKind {
    /// Ends of cones with spherical ends.
    RoundLinear,
    /// Control points of round cubic B-splines.
    RoundBspline,
    /// Centers of spheres.
    Sphere,
}

/// Curves, or spheres.
#[derive(Clone, Copy, Debug)]
pub struct Curves<'a> {
    /// What the points are.
    pub kind: CurveKind,
    /// Points, each with its radius.
    pub points: &'a [[f32; 4]],
    /// The first point of each segment; not used for spheres.
    pub firsts: &'a [u32],
    /// Of each segment, whether the one before (1) and the one after it (2) is its neighbor; not used for cubic curves and spheres.
    pub neighbors: &'a [u8],
}

impl Scene {
    /// Builds curves.
    ///
    /// # Errors If Embree reports an error.
    pub fn of_curves(library: &Library, curves: &Curves<'_>, options: &Options) -> Result<Self, SceneError> {
        let device = Device::new(library, options.n_threads)?;
        let buffers = Buffers {
            positions: curves.points.as_flattened().to_vec(),
            triangles: vec![],
            firsts: curves.firsts.to_vec(),
            neighbors: curves.neighbors.to_vec(),
        };
        let mut scene = Self { scenes: vec![], device, buffers: vec![buffers] };
        scene.start(options);
        scene.attach_curves(curves.kind, options);
        scene.commit(0)?;
        Ok(scene)
    }

    fn attach_curves(&self, kind: CurveKind, options: &Options) {
        let f = &self.device.library.functions;
        let Buffers { positions, firsts, neighbors, .. } = &self.buffers[0];
        let number = match kind {
            CurveKind::RoundLinear => 16,
            CurveKind::RoundBspline => 32,
            CurveKind::Sphere => 50,
        };
        // SAFETY: the buffers live as long as this scene and hold what the counts say, vertices of 16 bytes each. The scene keeps the
        // geometry after it is released here.
        unsafe {
            let geometry = (f.new_geometry)(self.device.handle, number);
            let points = positions.as_ptr().cast();
            (f.set_shared_buffer)(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT4, points, 0, 16, positions.len() / 4);
            if kind != CurveKind::Sphere {
                (f.set_shared_buffer)(
                    geometry,
                    BUFFER_INDEX,
                    0,
                    FORMAT_UINT,
                    firsts.as_ptr().cast(),
                    0,
                    4,
                    firsts.len(),
                );
            }
            if kind == CurveKind::RoundLinear {
                let flags = neighbors.as_ptr().cast();
                (f.set_shared_buffer)(geometry, BUFFER_FLAGS, 0, FORMAT_UCHAR, flags, 0, 1, neighbors.len());
            }
            (f.set_quality)(geometry, super::scene::quality(options));
            (f.commit_geometry)(geometry);
            (f.attach_geometry)(self.scenes[0], geometry);
            (f.release_geometry)(geometry);
        }
    }
}
