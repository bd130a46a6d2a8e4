use std::fmt;

use crate::CameraError;

/// Why there is no picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderError {
    /// The picture has no pixel, or more than 2³² - 1.
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// No sample per pixel was asked for.
    NoSamples,
    /// The samples to take are none, or not among the samples of the picture.
    Part {
        /// The first, and one past the last.
        part: [u32; 2],
        /// Samples per pixel of the picture.
        samples: u32,
    },
    /// The error to reach is not a number above zero.
    Noise {
        /// The error.
        noise: f32,
    },
    /// An error to reach was asked for together with a part of the samples.
    NoiseOfPart,
    /// A finished tile that was handed in is not one of this picture's.
    Tile {
        /// Its number.
        number: usize,
    },
    /// The radius of ambient occlusion is not above zero.
    AoRadius {
        /// The radius.
        radius: f32,
    },
    /// The radius of the pixel filter is not finite and above zero.
    FilterRadius {
        /// The radius in pixels.
        radius: f32,
    },
    /// The camera cannot be used.
    Camera(CameraError),
    /// The caller's flag stopped the work.
    Cancelled,
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { width, height } => write!(f, "a picture of {width} x {height} pixels cannot be rendered"),
            Self::Part { part: [start, end], samples } => {
                write!(f, "samples {start}..{end} are not a part of 0..{samples}")
            }
            Self::Noise { noise } => write!(f, "noise {noise} is not an error above zero"),
            Self::NoiseOfPart => write!(f, "pixels that stop by their noise have no part of their samples to take"),
            Self::Tile { number } => write!(f, "tile {number} is not of this picture"),
            Self::NoSamples => write!(f, "0 samples per pixel make no picture"),
            Self::AoRadius { radius } => write!(f, "ambient occlusion radius {radius} is not above zero"),
            Self::FilterRadius { radius } => write!(f, "pixel filter radius {radius} is not finite and above zero"),
            Self::Camera(error) => error.fmt(f),
            Self::Cancelled => write!(f, "rendering was cancelled"),
        }
    }
}

impl std::error::Error for RenderError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        if let Self::Camera(error) = self { Some(error) } else { None }
    }
}
