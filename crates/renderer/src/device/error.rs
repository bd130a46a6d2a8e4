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

impl std::error::Error for DeviceError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Render(error) => Some(error),
            Self::Gpu(error) => Some(error),
            Self::Unknown { .. } => None,
        }
    }
}

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

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;

    #[test]
    fn what_is_wrapped_is_the_source() {
        let lost = GpuError::Lost { message: "gone".to_owned() };
        assert_eq!(DeviceError::from(lost.clone()).source().map(ToString::to_string), Some(lost.to_string()));
        let none = RenderError::NoSamples;
        assert_eq!(DeviceError::from(none).source().map(ToString::to_string), Some(none.to_string()));
        assert!(DeviceError::Unknown { what: "anything" }.source().is_none());
    }
}
