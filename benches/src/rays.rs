//! The rays of a model: camera rays of its views, and rays that start where these hit.

use canted_fixtures::{DIFFUSE_SEED, OCCLUSION_SEED, RayData, SurfacePoint, diffuse, occlusion};
use canted_trace::{Hit, Ray};

use crate::models::Model;

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
    model.camera_rays(resolution).iter().map(ray).collect()
}

/// The rays that start where camera rays hit: for nearest hits, and for occlusion.
pub(crate) fn secondary(model: &Model, camera: &[Ray], hits: &[Option<Hit>]) -> [Vec<Ray>; 2] {
    let points: Vec<SurfacePoint> = camera
        .iter()
        .zip(hits)
        .filter_map(|(ray, hit)| Some(surface_point(model, ray, &(*hit)?)))
        .filter(|point| point.normal != [0.0; 3])
        .collect();
    let diagonal = model.mesh.diagonal();
    [diffuse(&points, diagonal, DIFFUSE_SEED), occlusion(&points, diagonal, OCCLUSION_SEED)]
        .map(|rays| rays.iter().map(ray).collect())
}

/// Converts a fixture's ray.
pub(crate) fn ray(data: &RayData) -> Ray {
    Ray::new(data.origin, data.direction).between(0.0, data.t_max)
}

/// The hit point, with the normal that faces the ray.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how points are stored")]
pub(crate) fn surface_point(model: &Model, ray: &Ray, hit: &Hit) -> SurfacePoint {
    let [a, b, c] = model.mesh.corners(hit.primitive.index());
    let sub = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let (ab, ac) = (sub(b, a), sub(c, a));
    let normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    let along: f64 = normal.iter().zip(ray.direction).map(|(n, d)| n * f64::from(d)).sum();
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let side = if along > 0.0 { -1.0 } else { 1.0 } / if length > 0.0 { length } else { 1.0 };
    SurfacePoint { position: ray.at(f64::from(hit.t)).map(|x| x as f32), normal: normal.map(|n| (n * side) as f32) }
}
