//! What a session shows: pictures, and what is at a position of them.

use std::time::Instant;

use canted_film::Picture;
use canted_renderer::Integrator;
use canted_scene::Camera;

/// What a job renders, the same for all its pictures.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "view"), allow(dead_code, reason = "the window reads all of it"))]
pub(crate) struct View {
    /// The number of the job.
    pub(crate) number: u64,
    pub(crate) size: [u32; 2],
    /// Samples per pixel of the final picture.
    pub(crate) n_samples: u32,
    pub(crate) is_moving: bool,
    pub(crate) camera: Camera,
    /// Whether the camera is one of the file.
    pub(crate) is_file_camera: bool,
    pub(crate) integrator: Integrator,
    /// `cpu`, or the value of `--device` where a GPU renders.
    pub(crate) device: String,
    /// Distance of what is in the center of the picture.
    pub(crate) center_distance: Option<f64>,
    /// First and last time of the animation in seconds, if there is one.
    pub(crate) time_range: Option<[f32; 2]>,
    /// Levels of the structure.
    pub(crate) n_levels: u32,
    /// When the scene and its structure were ready.
    pub(crate) ready: Instant,
}

/// A picture of a job: coarse, after some passes, or final.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "view"), allow(dead_code, reason = "the window reads all of it"))]
pub(crate) struct Frame {
    pub(crate) view: View,
    /// As it is encoded; a coarse picture is smaller than the size of the view.
    pub(crate) picture: Picture,
    /// The same in sRGB, row by row: the thread of a window does not encode.
    pub(crate) bytes: Vec<u8>,
    /// Samples per pixel; 0 for a coarse picture.
    pub(crate) n_samples: u32,
    /// Whether no better picture will follow.
    pub(crate) is_settled: bool,
}

impl Frame {
    pub(super) fn new(view: View, picture: Picture, n_samples: u32, is_settled: bool) -> Self {
        let is_shown = cfg!(feature = "view");
        let pixels = picture.pixels.iter().filter(|_| is_shown);
        let bytes = pixels.flatten().map(|&x| canted_film::srgb::encode(x)).collect();
        Self { view, picture, bytes, n_samples, is_settled }
    }
}

/// What is at a position of the picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seen {
    pub(crate) instance: u32,
    /// Triangle of the mesh.
    pub(crate) primitive: u32,
    /// Distance from the camera in world units.
    pub(crate) t: f32,
    /// Weights of the second and third vertex.
    pub(crate) barycentric: [f32; 2],
    /// Texture coordinates, if the mesh has some.
    pub(crate) texture: Option<[f32; 2]>,
    pub(crate) mesh: String,
    pub(crate) material: String,
}
