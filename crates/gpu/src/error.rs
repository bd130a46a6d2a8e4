use canted_shaders::ShaderError;

/// Why a device does not do what it is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GpuError {
    /// No adapter answers to the choice.
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of the adapters that there are.
        found: Vec<String>,
    },
    /// The adapter gives no device.
    Refused {
        /// The adapter.
        adapter: String,
        /// What it says.
        message: String,
    },
    /// A limit of the device is too low.
    Limit {
        /// What needs more.
        what: String,
        /// How much it needs.
        need: u64,
        /// What is limited.
        limit: &'static str,
        /// How much there may be.
        most: u64,
        /// What the caller may do.
        remedy: &'static str,
    },
    /// The device's memory does not hold a buffer.
    OutOfMemory {
        /// What was to be allocated, or what the driver said.
        what: String,
    },
    /// The device is lost: unplugged, reset, or timed out.
    Lost {
        /// What the driver says.
        message: String,
    },
    /// The device did not finish in time.
    TimedOut {
        /// Seconds that were waited.
        seconds: u64,
    },
    /// A scene that the device's kernels do not trace.
    Unsupported {
        /// What they do not trace.
        what: String,
    },
    /// A kernel is not what it should be.
    Shader(ShaderError),
    /// Commands that the device does not accept: an error of this crate.
    Invalid {
        /// What the device says.
        message: String,
    },
}

impl std::fmt::Display for GpuError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoAdapter { wanted, found } if found.is_empty() => {
                write!(f, "no adapter for device '{wanted}': this machine shows none; ")?;
                write!(f, "install a driver for Vulkan, Metal or DX12, or use --device cpu")
            }
            Self::NoAdapter { wanted, found } => {
                write!(f, "no adapter for device '{wanted}': there are {}", found.join(", "))
            }
            Self::Refused { adapter, message } => write!(f, "adapter '{adapter}' gives no device: {message}"),
            Self::Limit { what, need, limit, most, remedy } => {
                write!(f, "{what}: {need} {limit} are needed, the device has {most}; {remedy}")
            }
            Self::OutOfMemory { what } => {
                write!(f, "the device has not enough memory for {what}; use a smaller scene or --device cpu")
            }
            Self::Lost { message } => write!(f, "the device is lost: {message}"),
            Self::TimedOut { seconds } => write!(f, "the device did not finish within {seconds} s"),
            Self::Unsupported { what } => write!(f, "the device does not trace {what}; use --device cpu"),
            Self::Shader(error) => error.fmt(f),
            Self::Invalid { message } => write!(f, "the device does not accept a command: {message}"),
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
    fn a_kernels_error_is_the_source() {
        let Err(kernel) = canted_shaders::assemble("no/such", &canted_shaders::Specialisation::none()) else {
            panic!("there is no such kernel");
        };
        let message = kernel.to_string();
        assert_eq!(GpuError::from(kernel).source().map(ToString::to_string), Some(message));
        assert!(GpuError::TimedOut { seconds: 1 }.source().is_none());
    }
}
