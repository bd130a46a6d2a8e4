use std::fmt;

use canted_gpu::GpuError;

use crate::RenderError;

/// Why a device makes no picture.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceError {
    /// There is none on any device.
    Render(RenderError),
    /// The device does not do what it is asked.
    Gpu(GpuError),
    /// Kernels do not know something that scene or settings ask for.
    Unknown {
        /// What it is.
        what: &'static str,
    },
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Render(error) => error.fmt(f),
            Self::Gpu(error) => error.fmt(f),
            Self::Unknown { what } => write!(f, "devices do not render {what}; use --device cpu"),
        }
    }
}

impl std::error::Error for DeviceError {}

impl From<RenderError> for DeviceError {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

impl From<GpuError> for DeviceError {
    fn from(error: GpuError) -> Self {
        Self::Gpu(error)
    }
}
