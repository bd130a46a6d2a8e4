//! The camera: from the options, else from the scene, else one that frames the scene.

use anyhow::{Result, anyhow};
use canted_renderer::{Prepared, frame};
use canted_scene::{Camera, Lens, Projection, Scene};
use canted_wide::LaneKernel;

use crate::options;

/// The camera. Missing options come from the scene.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Camera position in world space [default: the scene's camera, else a view that frames the scene]
    #[arg(long, value_parser = options::numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    eye: Option<[f32; 3]>,
    /// Point that the camera looks at, in world space.
    #[arg(long, value_parser = options::numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    target: Option<[f32; 3]>,
    /// Up direction in world space.
    #[arg(long, value_parser = options::numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    up: Option<[f32; 3]>,
    /// Vertical field of view in degrees.
    #[arg(long, value_parser = options::fov, value_name = "DEG")]
    fov: Option<f32>,
    /// Lens radius in scene units; 0 is a pinhole camera.
    #[arg(long, value_parser = options::factor, value_name = "LENGTH")]
    aperture: Option<f32>,
    /// Focus distance along the view axis in scene units [default: distance of the target]
    #[arg(long, value_parser = options::radius, value_name = "LENGTH")]
    focus: Option<f32>,
}

impl CameraArgs {
    /// The camera of the options, else of the file, else one that frames the scene.
    ///
    /// # Errors
    /// A focus distance for a camera without a lens.
    pub(super) fn camera<K: LaneKernel>(
        &self,
        scene: &Scene,
        prepared: &Prepared<K>,
        [width, height]: [u32; 2],
    ) -> Result<Camera> {
        let mut camera = match scene.cameras.first() {
            Some(camera) => *camera,
            None => frame(scene, &prepared.structure, f64::from(width) / f64::from(height)),
        };
        if let Some(eye) = self.eye {
            // Without a target, the camera looks at the center of the scene.
            #[expect(clippy::cast_possible_truncation, reason = "the center of f32 bounds")]
            let center = scene.bounds_world().center().map(|x| x as f32);
            camera = Camera { eye, target: center, up: [0.0, 1.0, 0.0], ..camera };
        }
        if let Some(target) = self.target {
            camera.target = target;
        }
        if let Some(up) = self.up {
            camera.up = up;
        }
        if let Some(fov) = self.fov {
            camera.projection = Projection::Perspective { fov_degrees: fov };
        }
        camera.lens = self.lens(&camera);
        if self.focus.is_some() && camera.lens.is_none() {
            return Err(anyhow!("--focus requires a lens: set --aperture greater than 0"));
        }
        Ok(camera)
    }

    /// The lens of the camera, with the values of the options.
    fn lens(&self, camera: &Camera) -> Option<Lens> {
        let own = camera.lens.filter(|_| self.aperture.is_none() && self.focus.is_none());
        if own.is_some() {
            return own;
        }
        let radius = self.aperture.or(camera.lens.map(|lens| lens.radius)).filter(|&radius| radius > 0.0)?;
        let target_distance = || {
            let offset: [f64; 3] = std::array::from_fn(|k| f64::from(camera.target[k]) - f64::from(camera.eye[k]));
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
            let distance = offset.iter().map(|x| x * x).sum::<f64>().sqrt() as f32;
            distance
        };
        let focus_distance = self.focus.or(camera.lens.map(|lens| lens.focus_distance)).unwrap_or_else(target_distance);
        Some(Lens { radius, focus_distance })
    }
}

/// The options that give exactly this camera.
pub(super) fn record(camera: &Camera) -> [(&'static str, String); 6] {
    let Camera { eye, target, up, projection, lens } = camera;
    let triple = |[x, y, z]: &[f32; 3]| format!("{x},{y},{z}");
    let fov = match projection {
        Projection::Perspective { fov_degrees } => fov_degrees.to_string(),
        Projection::Orthographic { height } => format!("none and the height {height}"),
    };
    let [aperture, focus] = match lens {
        Some(Lens { radius, focus_distance }) => [radius.to_string(), focus_distance.to_string()],
        None => ["0", "none"].map(str::to_owned),
    };
    [
        ("eye", triple(eye)),
        ("target", triple(target)),
        ("up", triple(up)),
        ("fov", fov),
        ("aperture", aperture),
        ("focus", focus),
    ]
}
