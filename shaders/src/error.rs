/// Why a kernel cannot be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShaderError {
    /// There is no file of that name.
    NoSuchFile {
        /// The name that was asked for.
        name: String,
    },
    /// A kernel leaves a part or a number open that was not chosen.
    NotChosen {
        /// The kernel.
        kernel: String,
        /// The part or number.
        what: String,
    },
    /// A part, number or override was chosen that the kernel does not leave open.
    NotOpen {
        /// The kernel.
        kernel: String,
        /// What was chosen.
        what: String,
    },
    /// The text is not valid WGSL.
    Invalid {
        /// The kernel.
        kernel: String,
        /// What the compiler says, with the place.
        message: String,
    },
}

impl std::fmt::Display for ShaderError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSuchFile { name } => write!(f, "there is no shader file '{name}'"),
            Self::NotChosen { kernel, what } => {
                write!(f, "kernel '{kernel}' leaves '{what}' open and nothing was chosen")
            }
            Self::NotOpen { kernel, what } => write!(f, "kernel '{kernel}' has no '{what}' to choose"),
            Self::Invalid { kernel, message } => write!(f, "kernel '{kernel}' is not valid: {message}"),
        }
    }
}

impl std::error::Error for ShaderError {}
