use std::fmt;

use crate::CameraError;

/// Why a picture was not rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderError {
    /// The picture has no pixel, or more than 2³² - 1.
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// [`crate::Settings::samples`] is zero.
    NoSamples,
    /// [`crate::Settings::part`] is empty, or exceeds the samples of the picture.
    Part {
        /// The first, and one past the last.
        part: [u32; 2],
        /// Samples per pixel of the picture.
        samples: u32,
    },
    /// [`crate::Settings::noise`] is not positive.
    Noise {
        /// The error to reach.
        noise: f32,
    },
    /// [`crate::Settings::noise`] and [`crate::Settings::part`] are both set.
    NoiseOfPart,
    /// A finished tile does not belong to this picture.
    Tile {
        /// Its number.
        number: usize,
    },
    /// [`crate::Settings::ao_radius`] is not positive.
    AoRadius {
        /// The radius.
        radius: f32,
    },
    /// The radius of the pixel filter is not finite and positive.
    FilterRadius {
        /// The radius in pixels.
        radius: f32,
    },
    /// The camera is invalid.
    Camera(CameraError),
    /// [`crate::Monitor::cancel`] was set.
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
            Self::NoiseOfPart => write!(f, "a noise target and a part of the samples exclude each other"),
            Self::Tile { number } => write!(f, "tile {number} does not belong to this picture"),
            Self::NoSamples => write!(f, "a picture needs at least one sample per pixel"),
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
