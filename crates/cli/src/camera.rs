//! The camera: from the options, else from the scene, else one that frames the scene.

use anyhow::{Result, anyhow};
use canted_renderer::{SceneBvh, frame_up};
use canted_scene::{Camera, Lens, Projection, Scene};

use serde::Serialize;

use crate::{
    options::{self, as_text},
    settings::CAMERA,
};

/// Options of the camera. Those that are missing come from the scene.
#[derive(clap::Args, Clone, Debug, Default, PartialEq, Serialize)]
#[command(next_help_heading = CAMERA, next_display_order = 91)]
pub(crate) struct CameraArgs {
    /// Camera position in world space [default: the scene's camera, else a view that frames the scene]
    #[arg(long, display_order = 90, value_parser = options::numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    #[serde(serialize_with = "as_text")]
    pub(crate) eye: Option<[f32; 3]>,
    /// Point that the camera looks at, in world space.
    #[arg(long, display_order = 91, value_parser = options::numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    #[serde(serialize_with = "as_text")]
    pub(crate) target: Option<[f32; 3]>,
    /// Up direction in world space. Without --eye and without a camera in the file, the scene is framed for it.
    #[arg(long, display_order = 92, value_parser = options::numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    #[serde(serialize_with = "as_text")]
    pub(crate) up: Option<[f32; 3]>,
    /// Camera of the file, by name or by number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX", requires = "scene")]
    #[serde(serialize_with = "as_text")]
    pub(crate) camera: Option<String>,
    /// Vertical field of view in degrees.
    #[arg(long, value_parser = options::fov, value_name = "DEG")]
    #[serde(serialize_with = "as_text")]
    pub(crate) fov: Option<f32>,
    /// Parallel projection: height of the picture in scene units.
    #[arg(long, value_parser = options::noise, value_name = "HEIGHT", conflicts_with = "fov")]
    #[serde(serialize_with = "as_text")]
    pub(crate) ortho: Option<f32>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) lens: LensArgs,
}

/// Options of the lens.
#[derive(clap::Args, Clone, Debug, Default, PartialEq, Serialize)]
#[command(next_help_heading = CAMERA)]
pub(crate) struct LensArgs {
    /// Lens radius in scene units; 0 is a pinhole camera.
    #[arg(long, value_parser = options::factor, value_name = "LENGTH")]
    #[serde(serialize_with = "as_text")]
    pub(crate) aperture: Option<f32>,
    /// Focus distance along the view axis in scene units [default: distance of the target]
    #[arg(long, value_parser = options::radius, value_name = "LENGTH")]
    #[serde(serialize_with = "as_text")]
    pub(crate) focus: Option<f32>,
}

impl CameraArgs {
    /// Up in world space, where the scene has this up axis.
    pub(crate) fn up(&self, up_axis: [f32; 3]) -> [f32; 3] {
        self.up.unwrap_or(up_axis)
    }

    /// The camera of the file that is chosen, else its first.
    fn of_file(&self, scene: &Scene) -> Result<Option<Camera>> {
        let Some(wanted) = &self.camera else { return Ok(scene.cameras.first().copied()) };
        let named = scene.camera_names.iter().position(|name| name == wanted);
        let index = named.or_else(|| wanted.parse().ok());
        index.and_then(|index| scene.cameras.get(index)).map(|camera| Some(*camera)).ok_or_else(|| {
            let n = scene.cameras.len();
            let names: Vec<&str> =
                scene.camera_names.iter().map(|name| &name[..]).filter(|name| !name.is_empty()).collect();
            match n {
                0 => anyhow!("--camera {wanted}: the file has no camera"),
                _ if names.is_empty() => anyhow!("--camera {wanted}: the file has the cameras 0 to {}", n - 1),
                _ => anyhow!("--camera {wanted}: the file has {n} cameras: {}", names.join(", ")),
            }
        })
    }

    /// The camera of the options, else of the file, else one that frames the scene.
    ///
    /// # Errors
    /// A focus distance for a camera without a lens, or a camera that the file does not have.
    pub(crate) fn camera(
        &self,
        scene: &Scene,
        bvh: &SceneBvh,
        [width, height]: [u32; 2],
        up_axis: [f32; 3],
    ) -> Result<Camera> {
        let has_projection = self.fov.is_some() || self.ortho.is_some();
        let mut camera = match self.of_file(scene)? {
            Some(camera) => camera,
            // Nothing of the view that frames the scene would remain.
            None if self.eye.is_some() && self.target.is_some() && has_projection => {
                Camera::pinhole([0.0; 3], [0.0; 3], up_axis, 1.0)
            }
            None => frame_up(scene, bvh, f64::from(width) / f64::from(height), self.up(up_axis)),
        };
        if let Some(eye) = self.eye {
            // Without a target, the camera looks at the center of the scene.
            let center = scene.bounds_world().center().map(|x| x as f32);
            camera = Camera { eye, target: center, up: up_axis, ..camera };
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
        if let Some(height) = self.ortho {
            camera.projection = Projection::Orthographic { height };
        }
        camera.lens = self.lens.of(&camera);
        if self.lens.focus.is_some() && camera.lens.is_none() {
            return Err(anyhow!("--focus requires a lens: set --aperture greater than 0"));
        }
        Ok(camera)
    }
}

impl LensArgs {
    /// The lens of the camera, with the values of the options.
    fn of(&self, camera: &Camera) -> Option<Lens> {
        let own = camera.lens.filter(|_| self.aperture.is_none() && self.focus.is_none());
        if own.is_some() {
            return own;
        }
        let radius = self.aperture.or(camera.lens.map(|lens| lens.radius)).filter(|&radius| radius > 0.0)?;
        let target_distance = || {
            let offset: [f64; 3] = std::array::from_fn(|k| f64::from(camera.target[k]) - f64::from(camera.eye[k]));

            offset.iter().map(|x| x * x).sum::<f64>().sqrt() as f32
        };
        let focus_distance = self.focus.or(camera.lens.map(|lens| lens.focus_distance)).unwrap_or_else(target_distance);
        Some(Lens { radius, focus_distance })
    }
}

/// The options that give exactly this camera.
pub(crate) fn record(camera: &Camera) -> [(&'static str, String); 6] {
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
