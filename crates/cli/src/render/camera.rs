//! Where a picture is taken from: the options, else the scene, else a view that frames it.

use anyhow::{Result, anyhow};
use canted_renderer::{Prepared, frame};
use canted_scene::{Camera, Lens, Projection, Scene};
use canted_wide::LaneKernel;

use crate::options;

/// The camera, option by option; what is not given comes from the scene.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct CameraArgs {
    /// Where the camera stands, in world space.
    #[arg(long, value_parser = options::triple, value_name = "X,Y,Z", allow_hyphen_values = true)]
    eye: Option<[f32; 3]>,
    /// What it looks at, a point of world space.
    #[arg(long, value_parser = options::triple, value_name = "X,Y,Z", allow_hyphen_values = true)]
    target: Option<[f32; 3]>,
    /// What points up in the picture, a direction of world space.
    #[arg(long, value_parser = options::triple, value_name = "X,Y,Z", allow_hyphen_values = true)]
    up: Option<[f32; 3]>,
    /// Vertical field of view in degrees.
    #[arg(long, value_parser = options::fov, value_name = "DEG")]
    fov: Option<f32>,
    /// Radius of the lens in scene units: what is not in focus blurs. 0 for a pinhole.
    #[arg(long, value_parser = options::lens_radius, value_name = "LENGTH")]
    aperture: Option<f32>,
    /// Distance from the eye, along the view and in scene units, of what is in focus; that of the target without it.
    #[arg(long, value_parser = options::radius, value_name = "LENGTH")]
    focus: Option<f32>,
}

impl CameraArgs {
    /// The camera of the options, else of the file, else one that frames the scene.
    ///
    /// # Errors
    /// A distance of focus for a camera without a lens.
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
            // An eye without a target looks at the middle of the scene.
            #[expect(clippy::cast_possible_truncation, reason = "the middle of f32 numbers")]
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
            return Err(anyhow!(
                "--focus says nothing of a pinhole, which sees all things sharp: --aperture gives it a lens"
            ));
        }
        Ok(camera)
    }

    /// The lens of the options, else the camera's own; an option replaces its part of the lens.
    fn lens(&self, camera: &Camera) -> Option<Lens> {
        let own = camera.lens.filter(|_| self.aperture.is_none() && self.focus.is_none());
        if own.is_some() {
            return own;
        }
        let radius = self.aperture.or(camera.lens.map(|lens| lens.radius)).filter(|&radius| radius > 0.0)?;
        let target_distance = || {
            let way: [f64; 3] = std::array::from_fn(|k| f64::from(camera.target[k]) - f64::from(camera.eye[k]));
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
            let distance = way.iter().map(|x| x * x).sum::<f64>().sqrt() as f32;
            distance
        };
        let focus_distance = self.focus.or(camera.lens.map(|lens| lens.focus_distance)).unwrap_or_else(target_distance);
        Some(Lens { radius, focus_distance })
    }
}

/// A camera by the names and values of the options that give it, to the bit.
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
