//! The camera: from the options, else from the scene, else one that frames the scene.

use anyhow::{Result, anyhow};
use canted_renderer::{SceneBvh, frame_up};
use canted_scene::{Camera, Lens, Projection, Scene};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::options::{Fov, Length, NotNegative, Numbers, Positive, Text as _, Value};

/// Help heading.
pub(crate) const CAMERA: &str = "Camera";

/// Options of the camera. Those that are missing come from the scene.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = CAMERA, next_display_order = 91)]
pub(crate) struct CameraArgs {
    /// Camera position in world space [default: the scene's camera, else a view that frames the scene]
    #[arg(long, display_order = 90, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) eye: Option<Value<Numbers<3>>>,
    /// Point that the camera looks at, in world space.
    #[arg(long, display_order = 91, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) target: Option<Value<Numbers<3>>>,
    /// Up direction in world space. Without --eye and without a camera in the file, the scene is framed for it.
    #[arg(long, display_order = 92, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) up: Option<Value<Numbers<3>>>,
    /// Camera of the file, by name or by number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX", requires = "scene")]
    pub(crate) camera: Option<String>,
    /// Vertical field of view in degrees.
    #[arg(long, value_name = "DEG")]
    pub(crate) fov: Option<Value<Fov>>,
    /// Parallel projection: height of the picture in scene units.
    #[arg(long, value_name = "HEIGHT", conflicts_with = "fov")]
    pub(crate) ortho: Option<Value<Positive>>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) lens: LensArgs,
}

/// Options of the lens.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = CAMERA)]
pub(crate) struct LensArgs {
    /// Lens radius in scene units; 0 is a pinhole camera.
    #[arg(long, value_name = "LENGTH")]
    pub(crate) aperture: Option<Value<NotNegative>>,
    /// Focus distance along the view axis in scene units [default: distance of the target]
    #[arg(long, value_name = "LENGTH")]
    pub(crate) focus: Option<Value<Length>>,
}

impl CameraArgs {
    /// Up in world space, where the scene has this up axis.
    pub(crate) fn up(&self, up_axis: [f32; 3]) -> [f32; 3] {
        self.up.map_or(up_axis, |up| up.0)
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
        if let Some(Value(eye)) = self.eye {
            // Without a target, the camera looks at the center of the scene.
            let center = scene.bounds_world().center().map(|x| x as f32);
            camera = Camera { eye, target: center, up: up_axis, ..camera };
        }
        if let Some(Value(target)) = self.target {
            camera.target = target;
        }
        if let Some(Value(up)) = self.up {
            camera.up = up;
        }
        if let Some(Value(fov_degrees)) = self.fov {
            camera.projection = Projection::Perspective { fov_degrees };
        }
        if let Some(Value(height)) = self.ortho {
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
        let [eye, target] = [camera.eye, camera.target].map(|point| Vec3::from(point).as_dvec3());
        let own = camera.lens.unwrap_or(Lens { radius: 0.0, focus_distance: DVec3::distance(eye, target) as f32 });
        let radius = self.aperture.map_or(own.radius, |radius| radius.0);
        let focus_distance = self.focus.map_or(own.focus_distance, |focus| focus.0);
        (radius > 0.0).then_some(Lens { radius, focus_distance })
    }
}

/// `v` rotated about a unit axis by an angle with this sine and cosine, counter-clockwise seen from its tip (Rodrigues).
pub(crate) fn rotated(v: DVec3, axis: DVec3, [sin, cos]: [f64; 2]) -> DVec3 {
    cos * v + sin * axis.cross(v) + axis * axis.dot(v) * (1.0 - cos)
}

/// The options that give exactly this camera.
pub(crate) fn record(camera: &Camera) -> [(&'static str, String); 6] {
    let Camera { eye, target, up, projection, lens } = camera;
    let fov = match projection {
        Projection::Perspective { fov_degrees } => fov_degrees.to_string(),
        Projection::Orthographic { height } => format!("none and the height {height}"),
    };
    let [aperture, focus] = match lens {
        Some(Lens { radius, focus_distance }) => [radius.to_string(), focus_distance.to_string()],
        None => ["0", "none"].map(str::to_owned),
    };
    [
        ("eye", eye.text()),
        ("target", target.text()),
        ("up", up.text()),
        ("fov", fov),
        ("aperture", aperture),
        ("focus", focus),
    ]
}
