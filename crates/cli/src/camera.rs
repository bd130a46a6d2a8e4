//! The camera: from the options, else from the scene, else one that frames the scene.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_renderer::{FlatBase, SceneBvh, Shown, Subject};
use canted_scene::{Camera, Lens, Projection, Scene};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    light,
    options::{Fov, Length, NotNegative, Numbers, Positive, Text as _, Value},
    output,
};

/// Help heading.
pub(crate) const CAMERA: &str = "Camera";

/// Options of the camera. Those that are missing come from the scene.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = CAMERA, next_display_order = 91)]
pub(crate) struct CameraArgs {
    /// Camera position in world space [default: the scene's camera, if it shows the subject, else a view that frames it]
    #[arg(long, display_order = 90, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) eye: Option<Value<Numbers<3>>>,
    /// Point that the camera looks at, in world space.
    #[arg(long, display_order = 91, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) target: Option<Value<Numbers<3>>>,
    /// Up direction in world space. Without --eye and without a camera in the file, the scene is framed for it.
    #[arg(long, display_order = 92, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) up: Option<Value<Numbers<3>>>,
    /// Camera of the file, by name or by number from 0 [default: the first that shows the subject]
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

    /// The camera of the file that is chosen, by its index.
    fn of_file(&self, scene: &Scene) -> Result<Option<usize>> {
        let Some(wanted) = &self.camera else { return Ok(None) };
        let named = scene.camera_names.iter().position(|name| name == wanted);
        let index = named.or_else(|| wanted.parse().ok());
        index.filter(|&index| index < scene.cameras.len()).map(Some).ok_or_else(|| {
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

    /// Whether options leave nothing of a camera of the file or of a view that frames the scene.
    fn is_complete(&self) -> bool {
        self.eye.is_some() && self.target.is_some() && (self.fov.is_some() || self.ortho.is_some())
    }

    /// Whether the first camera of a file must show the subject: where options do not choose or change it, and not in scene files.
    fn is_checked(&self, is_model: bool) -> bool {
        is_model && self.camera.is_none() && self.eye.is_none() && self.target.is_none()
    }

    /// Whether the camera depends on what the scene is about.
    pub(crate) fn needs_framing(&self, scene: &Scene, is_model: bool) -> bool {
        let is_framed = if scene.cameras.is_empty() { !self.is_complete() } else { self.is_checked(is_model) };
        is_framed && self.camera.is_none()
    }

    /// The camera of the options, else of the file if it shows the subject, else one that frames the scene. `staged` is there if
    /// [`CameraArgs::needs_framing`].
    ///
    /// # Errors
    /// A focus distance for a camera without a lens, or a camera that the file does not have.
    pub(crate) fn camera(
        &self,
        scene: &Scene,
        bvh: &SceneBvh,
        staged: Option<&Staged>,
        aspect: f64,
        up_axis: [f32; 3],
        is_model: bool,
    ) -> Result<(Camera, CameraSource)> {
        let shows = |subject: &Subject, camera: &Camera| subject.is_shown_by(scene, bvh, camera, aspect);
        let chosen = match (self.of_file(scene)?, staged) {
            (Some(index), _) => Some(index),
            (None, Some(Staged { subject, .. })) if self.is_checked(is_model) => {
                let found = scene.cameras.iter().position(|camera| shows(subject, camera));
                if found.is_none() && !scene.cameras.is_empty() {
                    output::note(
                        "the view frames the scene: no camera of the file shows it; --camera 0 uses the first",
                    );
                }
                found
            }
            (None, _) => (!scene.cameras.is_empty()).then_some(0),
        };
        let (mut camera, source) = match (chosen, staged) {
            (Some(index), _) => (scene.cameras[index], CameraSource::OfFile(index)),
            (None, Some(staged)) if !self.is_complete() => (staged.framed.0, CameraSource::Framed),
            // Nothing of the view that frames the scene would remain.
            _ => (Camera::pinhole([0.0; 3], [0.0; 3], up_axis, 1.0), CameraSource::Given),
        };
        let is_given = self.eye.is_some() || self.target.is_some();
        let source = if is_given { CameraSource::Given } else { source };
        if let Some(Value(eye)) = self.eye {
            // Without a target, the camera looks at the center of the scene.
            let center = scene.bounds_world().center().map(|x| x as f32);
            camera = Camera { eye, target: center, up: up_axis, ..camera };
        }
        if let Some(Value(target)) = self.target {
            camera.target = target;
        }
        match self.up {
            Some(Value(up)) => camera.up = up,
            None if is_given => camera.up = upright(&camera),
            None => {}
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
        Ok((camera, source))
    }
}

/// How clearly a file of this format must stand on a flat base across z, so that z is up.
///
/// Programs for printing, which write STL, have z up more often than others; those that write OBJ mostly have y up, and furniture of theirs has
/// a flat back.
pub(crate) fn flat_bases(path: &Path) -> Vec<FlatBase> {
    const BASES: [(&[&str], FlatBase); 4] = [
        (&["stl"], FlatBase { least: 0.05, other: 0.25, top: f64::INFINITY }),
        (&["ply", "off"], FlatBase { least: 0.3, other: 0.25, top: f64::INFINITY }),
        (&["ply", "off"], FlatBase { least: 0.1, other: 0.01, top: 0.25 }),
        (&["obj"], FlatBase { least: 0.5, other: 0.01, top: 0.1 }),
    ];
    let inner = if output::has_extension(path, "gz") { path.with_extension("") } else { path.to_owned() };
    let is_of = |known: &[&str]| known.iter().any(|known| output::has_extension(&inner, known));
    BASES.iter().filter(|(known, _)| is_of(known)).map(|&(_, clear)| clear).collect()
}

/// What a scene is about, and the view that frames it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Staged {
    pub(crate) subject: Subject,
    /// The camera that frames the subject, and what it shows.
    pub(crate) framed: (Camera, Shown),
    /// Whether the subject is a landscape, which has sky and sun and no ground.
    pub(crate) is_landscape: bool,
    /// Whether most of what is seen reflects light: surfaces that are pictures of themselves cast no shadow.
    pub(crate) reflects: bool,
}

/// Where a camera comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CameraSource {
    /// From options.
    Given,
    /// From the file, by its index.
    OfFile(usize),
    /// Chosen for the scene.
    Framed,
}

impl CameraSource {
    /// What it is, in reports.
    pub(crate) fn text(self, scene: &Scene) -> String {
        match self {
            Self::Given => "given by options".to_owned(),
            Self::Framed => "frames the scene".to_owned(),
            Self::OfFile(index) => match scene.camera_names.get(index).filter(|name| !name.is_empty()) {
                Some(name) => format!("camera {index} of the file, {name}"),
                None => format!("camera {index} of the file"),
            },
        }
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

/// The up direction of a camera, or where it looks straight down or up, one that shows the front of the scene at the bottom of the picture.
fn upright(camera: &Camera) -> [f32; 3] {
    /// Sine of the angle between directions that count as parallel.
    const PARALLEL: f64 = 1e-6;
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| Vec3::from(v).as_dvec3());
    let (forward, up) = ((target - eye).normalize_or_zero(), up.normalize_or_zero());
    if forward == DVec3::ZERO || up == DVec3::ZERO || forward.cross(up).length() > PARALLEL {
        return camera.up;
    }
    let [_, _, back] = light::axes(camera.up);
    (back * forward.dot(up).signum()).as_vec3().into()
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
