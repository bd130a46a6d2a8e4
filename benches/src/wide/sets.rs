use canted_fixtures::{DIFFUSE_SEED, OCCLUSION_SEED, SurfacePoint, diffuse, occlusion};
use canted_trace::{Hit, Ray};

use crate::{models::Model, trace};

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Nearest hits of the views' pixels.
    Camera,
    /// Nearest hits of one scattered ray from each camera hit.
    Diffuse,
    /// Whether anything is near each camera hit.
    Occlusion,
}

impl Kind {
    pub(crate) const ALL: [Self; 3] = [Self::Camera, Self::Diffuse, Self::Occlusion];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Diffuse => "diffuse",
            Self::Occlusion => "occlusion",
        }
    }
}

/// The camera rays of a model.
pub(crate) fn camera(model: &Model, resolution: u32) -> Vec<Ray> {
    model.camera_rays(resolution).iter().map(trace::ray).collect()
}

/// The rays that start where camera rays hit: for nearest hits, and for occlusion.
pub(crate) fn secondary(model: &Model, camera: &[Ray], hits: &[Option<Hit>]) -> [Vec<Ray>; 2] {
    let points: Vec<SurfacePoint> = camera
        .iter()
        .zip(hits)
        .filter_map(|(ray, hit)| Some(trace::surface_point(model, ray, &(*hit)?)))
        .filter(|point| point.normal != [0.0; 3])
        .collect();
    let diagonal = model.mesh.diagonal();
    [diffuse(&points, diagonal, DIFFUSE_SEED), occlusion(&points, diagonal, OCCLUSION_SEED)]
        .map(|rays| rays.iter().map(trace::ray).collect())
}
