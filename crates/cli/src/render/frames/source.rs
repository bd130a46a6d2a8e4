//! The scene of each frame, its camera on a turntable, and the name of its file: a printf pattern with one field for the number.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_scene::{AnimatedScene, Camera, Environment, Light, Scene};
use glam::Vec3;

use super::Job;
use crate::{camera::rotated, light, load, output};

/// A scene that is posed for each frame.
pub(super) struct Source {
    animated: Option<AnimatedScene>,
    pub(super) scene: Scene,
    /// The lights of the file, where poses do not set them.
    lights: Vec<Light>,
    /// The environment that the light options or the file set; `None` where the default light may be needed.
    environment: Option<Environment>,
    /// Kinds of warnings that were printed.
    warned: BTreeSet<String>,
}

impl Source {
    /// Reads the scene at the time of the first frame.
    pub(super) fn open(job: &Job, time: f32) -> Result<Self> {
        let path = job.plan.source.scene.as_deref();
        let (animated, scene) = match path {
            Some(path) if !load::is_scene_file(path) => {
                // A file without animation is read in its rest pose.
                let options = job.plan.source.read_options(Some(time));
                let (animated, scene) = AnimatedScene::open(path, &options)?;
                if !animated.is_animated() && job.sequence.turntable.is_none() {
                    output::warn(&format!(
                        "{}: the file has no animation; all frames show its rest pose",
                        path.display()
                    ));
                }
                (Some(animated).filter(AnimatedScene::is_animated), scene)
            }
            Some(path) if job.sequence.turntable.is_none() => {
                return Err(anyhow!(
                    "{}: --frames requires a glTF file or --turntable; a scene file sets the time of each asset",
                    path.display()
                ));
            }
            None if job.sequence.turntable.is_none() => {
                return Err(anyhow!("--frames of the built-in scene requires --turntable"));
            }
            _ => (None, load::scene(path, &job.plan.source.read_options(None))?),
        };
        let mut source =
            Self { animated, lights: scene.lights.clone(), environment: None, scene, warned: BTreeSet::new() };
        source.environment = job.plan.light.environment_or(source.scene.environment.take())?;
        source.warn();
        Ok(source)
    }

    /// The scene with its own environment, before any pose.
    pub(super) fn unposed(&mut self) -> &mut Scene {
        self.scene.environment.clone_from(&self.environment);
        &mut self.scene
    }

    /// Sets the scene to a time in seconds.
    pub(super) fn pose(&mut self, job: &Job, time: f32) -> Result<light::LightSource> {
        light::ground::remove(&mut self.scene);
        match (&mut self.animated, job.sequence.shutter_times(time)) {
            (Some(animated), None) => animated.pose(time, &mut self.scene)?,
            (Some(animated), Some(times)) => animated.pose_shutter(times, &mut self.scene)?,
            (None, _) => self.scene.lights.clone_from(&self.lights),
        }
        self.warn();
        // The environment is set again, because the default light of the last frame may have replaced it.
        if self.scene.environment.is_none() || self.environment.is_none() {
            self.scene.environment.clone_from(&self.environment);
        }
        job.plan.light.apply_lights(&mut self.scene, job.plan.stage.light)
    }

    /// Prints new kinds of warnings: what stands before the first colon and the values.
    fn warn(&mut self) {
        for warning in std::mem::take(&mut self.scene.warnings) {
            let kind = warning.split(": ").next().unwrap_or_default().to_owned();
            if self.warned.insert(kind) {
                output::warn(&warning);
            }
        }
        // Formats with poses have none.
        std::mem::take(&mut self.scene.notes).iter().for_each(|note| output::skipped(note));
    }
}

/// Turns the eye of a camera around the axis through its target along its up direction, counter-clockwise seen from the tip
/// of that direction.
pub(super) fn turned(camera: Camera, degrees: f64) -> Camera {
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| Vec3::from(v).as_dvec3());
    // A camera without an up direction is rejected later.
    let eye = target + rotated(eye - target, up / up.length(), sin_cos(degrees));
    Camera { eye: eye.as_vec3().into(), ..camera }
}

/// Sine and cosine, exact for multiples of 90 degrees.
fn sin_cos(degrees: f64) -> [f64; 2] {
    let turn = degrees.rem_euclid(360.0);
    let quarter = (turn / 90.0).round();
    let (sin, cos) = (turn - 90.0 * quarter).to_radians().sin_cos();
    match quarter as i32 {
        1 => [cos, -sin],
        2 => [-sin, -cos],
        3 => [-cos, sin],
        _ => [sin, cos],
    }
}

/// The names of all frames.
#[derive(Debug)]
pub(super) struct FrameNames {
    pattern: PathBuf,
    folder: PathBuf,
    before: String,
    /// Least number of digits.
    width: usize,
    after: String,
}

/// The most digits of a field: those of the greatest frame number.
const MAX_WIDTH: usize = 10;

impl FrameNames {
    /// Parses the file name of `path`: one field `%d` or `%04d`, and `%%` for a percent sign. The folder is taken as it is.
    pub(super) fn parse(path: &Path) -> Result<Self> {
        let fail = |reason: &str| anyhow!("--output {}: {reason}, e.g. frame_%04d.png", path.display());
        let name = path.file_name().and_then(|name| name.to_str());
        let mut rest =
            name.ok_or_else(|| fail("the file name is not valid UTF-8; use a field for the frame number"))?;
        let (mut text, mut field) = (String::new(), None);
        while let Some(start) = rest.find('%') {
            text.push_str(&rest[..start]);
            rest = &rest[start + 1..];
            if let Some(after) = rest.strip_prefix('%') {
                text.push('%');
                rest = after;
                continue;
            }
            let n_digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let (digits, after) = rest.split_at(n_digits);
            let width: usize = match digits {
                "" => 0,
                _ if !digits.starts_with('0') => MAX_WIDTH + 1,
                _ => digits.parse().unwrap_or(MAX_WIDTH + 1),
            };
            rest = after.strip_prefix('d').filter(|_| width <= MAX_WIDTH).ok_or_else(|| {
                fail("unsupported field for the frame number; use %d, or %0Nd with at most 10 digits, and %% for a percent sign")
            })?;
            if field.replace((std::mem::take(&mut text), width)).is_some() {
                return Err(fail("more than one field for the frame number"));
            }
        }
        text.push_str(rest);
        let (before, width) = field.ok_or_else(|| fail("--frames requires a field for the frame number"))?;
        Ok(Self {
            pattern: path.to_owned(),
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            before,
            width,
            after: text,
        })
    }

    /// The file that lists the frames and what they were rendered with: `frame_%04d.png.frames`.
    pub(super) fn list(&self) -> PathBuf {
        let mut name = self.pattern.clone().into_os_string();
        name.push(".frames");
        name.into()
    }

    /// Names of hidden files in the same folder, of this process.
    pub(super) fn temporary(&self) -> Self {
        let before = format!(".canted-{}-{}", std::process::id(), self.before);
        Self {
            pattern: self.folder.join(&before),
            folder: self.folder.clone(),
            before,
            width: self.width,
            after: self.after.clone(),
        }
    }

    /// The file of a frame.
    pub(super) fn path(&self, frame: u32) -> PathBuf {
        self.folder.join(format!("{}{frame:0width$}{}", self.before, self.after, width = self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eye(up: [f32; 3], degrees: f64) -> [f32; 3] {
        turned(Camera::pinhole([3.0, 5.0, 2.0], [1.0, 1.0, 1.0], up, 40.0), degrees).eye
    }

    #[test]
    fn quarter_turns_are_exact() {
        // Seen from above, with x to the right and z towards the viewer, counter-clockwise is from z to x.
        let up = [0.0, 1.0, 0.0];
        for (degrees, want) in [
            (0.0, [3.0, 5.0, 2.0]),
            (90.0, [2.0, 5.0, -1.0]),
            (180.0, [-1.0, 5.0, 0.0]),
            (270.0, [0.0, 5.0, 3.0]),
            (-90.0, [0.0, 5.0, 3.0]),
            (360.0, [3.0, 5.0, 2.0]),
            (-1080.0, [3.0, 5.0, 2.0]),
        ] {
            assert_eq!(eye(up, degrees), want, "{degrees}");
        }
        assert_eq!(eye([0.0, 0.0, 7.0], 90.0), [-3.0, 3.0, 2.0], "about z, for an up direction of any length");
    }

    /// The eye keeps its height and its distance from the target, and the turn has the angle that was asked for.
    #[test]
    fn turns_are_rotations() {
        let up = [0.0, 1.0, 0.0];
        for step in -40..40_i32 {
            let degrees = 17.3 * f64::from(step);
            let [x, y, z] = eye(up, degrees).map(f64::from);
            // x = 2 cos + 1 sin, z = 1 cos - 2 sin, relative to the target.
            let (sin, cos) = degrees.to_radians().sin_cos();
            let bound = 8.0 * f64::from(f32::EPSILON);
            assert!(
                (x - 1.0 - 2.0 * cos - sin).abs() < bound && (z - 1.0 - cos + 2.0 * sin).abs() < bound,
                "{degrees}"
            );
            assert!((y - 5.0).abs() < bound, "{degrees}");
        }
    }

    #[test]
    fn names_are_those_of_printf() {
        for (pattern, frame, want) in [
            ("frame_%04d.png", 7, "frame_0007.png"),
            ("frame_%04d.png", 12345, "frame_12345.png"),
            ("%d.exr", 7, "7.exr"),
            ("%0d.exr", 7, "7.exr"),
            ("100%%_%03d%%.png", 42, "100%_042%.png"),
            ("%%d%d.png", 1, "%d1.png"),
            ("at 100%/%02d.png", 3, "at 100%/03.png"),
            ("é%010d.png", u32::MAX, "é4294967295.png"),
        ] {
            assert_eq!(FrameNames::parse(Path::new(pattern)).unwrap().path(frame), Path::new(want), "{pattern}");
        }
    }

    #[test]
    fn patterns_without_exactly_one_field_are_rejected() {
        for (pattern, reason) in [
            ("frame.png", "requires a field"),
            ("frame%%d.png", "requires a field"),
            ("%02d/frame.png", "requires a field"),
            ("%d_%d.png", "more than one field"),
            ("frame_%s.png", "unsupported field"),
            ("frame_%4d.png", "unsupported field"),
            ("frame_%-4d.png", "unsupported field"),
            ("frame_%011d.png", "unsupported field"),
            ("frame_%099999999999999999999d.png", "unsupported field"),
            ("frame.png%", "unsupported field"),
        ] {
            let error = FrameNames::parse(Path::new(pattern)).unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains(pattern), "{pattern}: {error}");
        }
    }
}
