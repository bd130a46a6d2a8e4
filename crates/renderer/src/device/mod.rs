//! Renders pictures on a GPU: packs what the CPU's integrators read into buffers, and collects samples from kernels.

mod collector;
mod curves;
mod device_picture;
mod frames;
mod geometry;
mod lights;
mod materials;
mod picture;
mod raster;
mod records;
mod scene;
mod slack;
mod streams;
mod sums;
mod traced;
#[doc(hidden)]
pub mod twins;
mod vertices;

pub use device_picture::{DevicePicture, SharedFilm};
pub use frames::{DeviceFrames, DeviceUpdates};
pub use raster::{GBuffer, SurfaceInfo};
pub use traced::{Traced, built_scene, traced_frame, traced_scene};

use std::fmt;

use canted_gpu::GpuError;

use crate::{PrepareError, RenderError};

/// Why a GPU cannot render a picture.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceError {
    /// No device can render it.
    Render(RenderError),
    /// The BVH of a mesh cannot be built.
    Prepare(PrepareError),
    /// An error of the device.
    Gpu(GpuError),
    /// The kernels do not support a feature.
    Unsupported {
        /// The feature.
        what: &'static str,
    },
    /// The first hits of a picture cannot be rasterized, only traced.
    Raster {
        /// What prevents it.
        what: &'static str,
    },
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Render(error) => error.fmt(f),
            Self::Prepare(error) => error.fmt(f),
            Self::Gpu(error) => error.fmt(f),
            Self::Unsupported { what } => write!(f, "GPUs do not support {what}"),
            Self::Raster { what } => write!(f, "the first hits of {what} are not rasterized"),
        }
    }
}

impl std::error::Error for DeviceError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Render(error) => Some(error),
            Self::Prepare(error) => Some(error),
            Self::Gpu(error) => Some(error),
            Self::Unsupported { .. } | Self::Raster { .. } => None,
        }
    }
}

impl From<RenderError> for DeviceError {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

impl From<PrepareError> for DeviceError {
    fn from(error: PrepareError) -> Self {
        Self::Prepare(error)
    }
}

impl From<GpuError> for DeviceError {
    fn from(error: GpuError) -> Self {
        Self::Gpu(error)
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;

    #[test]
    fn wrapped_errors_are_sources() {
        let lost = GpuError::Lost { message: "gone".to_owned() };
        assert_eq!(DeviceError::from(lost.clone()).source().map(ToString::to_string), Some(lost.to_string()));
        let none = RenderError::NoSamples;
        assert_eq!(DeviceError::from(none).source().map(ToString::to_string), Some(none.to_string()));
        assert!(DeviceError::Unsupported { what: "anything" }.source().is_none());
    }
}
