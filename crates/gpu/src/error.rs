use canted_shaders::ShaderError;

/// Errors of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GpuError {
    /// No matching adapter.
    NoAdapter {
        /// The requested adapter.
        wanted: String,
        /// Names of the available adapters.
        found: Vec<String>,
    },
    /// The adapter provides no device.
    Refused {
        /// The adapter.
        adapter: String,
        /// Message of the driver.
        message: String,
    },
    /// A limit of the device is too low.
    Limit {
        /// What exceeds the limit.
        what: String,
        /// The required amount.
        need: u64,
        /// The limit.
        limit: &'static str,
        /// The available amount.
        most: u64,
        /// What the caller can do, as in "use a smaller scene".
        remedy: &'static str,
    },
    /// The device memory is too small for a buffer.
    OutOfMemory {
        /// The buffer, or the message of the driver.
        what: String,
    },
    /// The device is lost: removed, reset, or timed out.
    Lost {
        /// Message of the driver.
        message: String,
    },
    /// The device did not finish in time.
    TimedOut {
        /// Seconds waited.
        seconds: u64,
    },
    /// A call that waits, in a browser, where nothing may block.
    Blocking,
    /// A scene that the kernels do not support.
    Unsupported {
        /// What is not supported.
        what: String,
    },
    /// A kernel cannot be assembled.
    Shader(ShaderError),
    /// Buffers, transforms or counts of the program that are not valid.
    Input {
        /// What is wrong, as a sentence.
        message: String,
    },
    /// The device rejected a command: a bug in this crate.
    Invalid {
        /// Message of the device.
        message: String,
    },
}

impl GpuError {
    /// Whether the device works, but this scene, or the way it is built, exceeds what the device or the kernels support.
    #[must_use]
    pub fn is_of_scene(&self) -> bool {
        matches!(self, Self::Limit { .. } | Self::OutOfMemory { .. } | Self::Unsupported { .. })
    }
}

impl std::fmt::Display for GpuError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoAdapter { wanted, found } if found.is_empty() => {
                write!(f, "no adapter for device '{wanted}': none found; ")?;
                write!(f, "install a driver for Vulkan, Metal or DX12")
            }
            Self::NoAdapter { wanted, found } => {
                write!(f, "no adapter for device '{wanted}'; available: {}", found.join(", "))
            }
            Self::Refused { adapter, message } => write!(f, "adapter '{adapter}' provides no device: {message}"),
            Self::Limit { what, need, limit, most, remedy } => {
                write!(f, "{what}: requires {need} {limit}, the device supports {most}; {remedy}")
            }
            Self::OutOfMemory { what } => {
                write!(f, "out of device memory for {what}; use a smaller scene")
            }
            Self::Lost { message } => write!(f, "device lost: {message}"),
            Self::TimedOut { seconds } => write!(f, "the device did not finish within {seconds} s"),
            Self::Blocking => f.write_str("a browser cannot wait for the device; await the call instead of block_on"),
            Self::Unsupported { what } => write!(f, "not supported on the GPU: {what}"),
            Self::Shader(error) => error.fmt(f),
            Self::Input { message } => f.write_str(message),
            Self::Invalid { message } => write!(f, "the device rejected a command: {message}"),
        }
    }
}

impl std::error::Error for GpuError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        if let Self::Shader(error) = self { Some(error) } else { None }
    }
}

impl From<ShaderError> for GpuError {
    fn from(error: ShaderError) -> Self {
        Self::Shader(error)
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;

    #[test]
    fn shader_errors_are_the_source() {
        let Err(kernel) =
            canted_shaders::assemble(canted_shaders::wgsl::trace::CLOSEST, &canted_shaders::Variant::none())
        else {
            panic!("there is no such kernel");
        };
        let message = kernel.to_string();
        assert_eq!(GpuError::from(kernel).source().map(ToString::to_string), Some(message));
        assert!(GpuError::TimedOut { seconds: 1 }.source().is_none());
        assert!(!GpuError::Blocking.is_of_scene());
        assert!(GpuError::OutOfMemory { what: String::new() }.is_of_scene());
    }
}
