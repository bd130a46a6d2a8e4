use crate::ShaderName;

/// Why a kernel cannot be assembled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShaderError {
    /// A slot or constant of the kernel has no choice.
    MissingChoice {
        /// The kernel.
        kernel: ShaderName,
        /// The slot or constant.
        what: &'static str,
    },
    /// A choice was made for a slot, constant or override that the kernel does not have.
    UnknownChoice {
        /// The kernel.
        kernel: String,
        /// The slot, constant or override.
        what: String,
    },
    /// A name of the caller's choice is no name in WGSL.
    BadName {
        /// The name, or the start of one.
        name: String,
    },
    /// The text is not valid WGSL.
    Invalid {
        /// The kernel.
        kernel: String,
        /// Message of the compiler, with the location.
        message: String,
    },
}

impl std::fmt::Display for ShaderError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::MissingChoice { kernel, what } => write!(f, "kernel '{kernel}' needs a choice for '{what}'"),
            Self::UnknownChoice { kernel, what } => write!(f, "kernel '{kernel}' has no slot or constant '{what}'"),
            Self::BadName { name } => {
                write!(f, "'{name}' is no name in WGSL; use letters, digits and underscores, a letter first")
            }
            Self::Invalid { kernel, message } => write!(f, "kernel '{kernel}' is not valid: {message}"),
        }
    }
}

impl std::error::Error for ShaderError {}
