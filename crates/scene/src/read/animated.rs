//! A scene at many times of its animation, and two of them in one: what moves while the shutter is open.

use std::path::Path;

use super::error::ReadError;
use super::input::{Format, Input, ReadOptions, open};
use super::{gltf, is_lines, lines, read_static};
use crate::{Instance, Mesh, MeshClose, Scene};

/// An open file that poses its scene at any time of an animation, without reading materials and images again.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("triangle.ply");
/// # std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
/// # property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")?;
/// use canted_scene::{AnimatedScene, ReadOptions};
///
/// let (mut animated, mut scene) = AnimatedScene::open(&path, &ReadOptions::default())?;
/// for frame in 0..3_u8 {
///     animated.pose(f32::from(frame) / 24.0, &mut scene)?;
/// }
/// assert!(!animated.is_animated(), "a PLY file has no animation, so poses do not change the scene");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct AnimatedScene(Option<gltf::Poses>);

impl AnimatedScene {
    /// Reads a file as [`read_with`](super::read_with) does, but reports a pose that makes a vertex infinite or NaN, and
    /// accepts a time for a file without animation.
    ///
    /// # Errors
    /// As [`read_with`](super::read_with), and [`ReadError::VertexNotFinite`].
    pub fn open(path: &Path, options: &ReadOptions) -> Result<(Self, Scene), ReadError> {
        if is_lines(path) || options.reads_lines() {
            return Ok((Self(None), lines::scene(path, options)?));
        }
        let Input { format, bytes } = open(path, options)?;
        if format == Format::Gltf {
            let (poses, scene) = gltf::Poses::open(path, &bytes, options)?;
            return Ok((Self(poses), scene));
        }
        Ok((Self(None), read_static(path, format, &bytes, options)?))
    }

    /// Whether the file has an animation.
    #[must_use]
    pub fn is_animated(&self) -> bool {
        self.0.is_some()
    }

    /// First and last key time in seconds of the animation that is shown; `None` without an animation, or where it has no valid
    /// keyframe. Poses outside are those of the nearer end.
    ///
    /// ```no_run
    /// # use canted_scene::{AnimatedScene, ReadOptions};
    /// let (animated, _) = AnimatedScene::open("fox.glb".as_ref(), &ReadOptions::default())?;
    /// if let Some([first, last]) = animated.time_range() {
    ///     println!("it moves for {} seconds", last - first);
    /// }
    /// # Ok::<(), canted_scene::ReadError>(())
    /// ```
    #[must_use]
    pub fn time_range(&self) -> Option<[f32; 2]> {
        self.0.as_ref()?.time_range()
    }

    /// Replaces meshes, instances, cameras and lights of `scene` by those at a time in seconds: the scene is then that of
    /// [`read_with`](super::read_with) at this time. Its warnings are those of the pose; materials, textures and the
    /// environment stay. Without an animation, the scene does not change.
    ///
    /// # Errors
    /// [`ReadError::VertexNotFinite`], and those of [`read_with`](super::read_with). The scene then stays as it is.
    pub fn pose(&mut self, time: f32, scene: &mut Scene) -> Result<(), ReadError> {
        let Some(poses) = &mut self.0 else { return Ok(()) };
        let posed = poses.at(time)?;
        replace(scene, posed);
        Ok(())
    }

    /// As [`AnimatedScene::pose`], for a shutter that is open between two times in seconds: meshes and instances are those of the
    /// first time, and at shutter close those of the second. Cameras and lights stand still, as at the first time.
    ///
    /// ```no_run
    /// # use canted_scene::{AnimatedScene, ReadOptions};
    /// let (mut animated, mut scene) = AnimatedScene::open("fox.glb".as_ref(), &ReadOptions::default())?;
    /// animated.pose_shutter([1.0, 1.02], &mut scene)?;
    /// let n_deforming = scene.meshes.iter().filter(|mesh| mesh.close.is_some()).count();
    /// # Ok::<(), canted_scene::ReadError>(())
    /// ```
    ///
    /// # Errors
    /// As [`AnimatedScene::pose`], and [`ReadError::Shutter`] where an instance or a triangle is at one of the times only, for
    /// example because its transform is not invertible at the other.
    pub fn pose_shutter(&mut self, times: [f32; 2], scene: &mut Scene) -> Result<(), ReadError> {
        let Some(poses) = &mut self.0 else { return Ok(()) };
        let [open, close] = times;
        let mut posed = poses.at(open)?;
        let later = poses.at(close)?;
        let fail = |what| ReadError::Shutter { path: poses.path().to_owned(), times, what };
        join(&mut posed, later).map_err(fail)?;
        replace(scene, posed);
        Ok(())
    }
}

/// Replaces what poses change.
fn replace(scene: &mut Scene, posed: Scene) {
    let Scene { meshes, instances, cameras, camera_names, lights, warnings, .. } = posed;
    scene.meshes = meshes;
    scene.ground = None;
    scene.instances = instances;
    scene.cameras = cameras;
    scene.camera_names = camera_names;
    scene.lights = lights;
    scene.warnings = warnings;
}

/// Adds the positions of `close`, a later pose of the same scene, to those of `open` as the ones at shutter close.
///
/// # Errors
/// What differs, other than positions, normals, tangents and transforms.
fn join(open: &mut Scene, close: Scene) -> Result<(), &'static str> {
    if open.meshes.len() != close.meshes.len() {
        return Err("other meshes");
    }
    let is_same = |(a, b): (&Instance, &Instance)| a.mesh == b.mesh && a.first_primitive == b.first_primitive;
    if open.instances.len() != close.instances.len() || !open.instances.iter().zip(&close.instances).all(is_same) {
        return Err("other instances");
    }
    let is_same = |(a, b): (&Mesh, &Mesh)| a.triangles == b.triangles && a.positions.len() == b.positions.len();
    if !open.meshes.iter().zip(&close.meshes).all(is_same) {
        return Err("other triangles");
    }
    for (mesh, later) in open.meshes.iter_mut().zip(close.meshes) {
        if mesh.positions != later.positions {
            let Mesh { positions, normals, tangents, .. } = later;
            mesh.close = Some(MeshClose { positions, normals, tangents, radii: None });
        }
    }
    for (instance, later) in open.instances.iter_mut().zip(close.instances) {
        let close = later.world_from_object;
        instance.world_from_object_close = (close != instance.world_from_object).then_some(close);
    }
    for warning in close.warnings {
        if !open.warnings.contains(&warning) {
            open.warnings.push(warning);
        }
    }
    Ok(())
}
