//! The WGSL files, embedded so that a program finds them wherever it runs, and their names as constants and enums, which `build.rs` writes.

/// The name of a file or part, such as that of a kernel: one of the constants in [`wgsl`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ShaderName(&'static str);

impl ShaderName {
    /// Path without its extension, and the part of the file, if it is one.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        self.0
    }
}

impl std::fmt::Display for ShaderName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0)
    }
}

/// A part that fills a slot of kernels: the enums in [`choice`] implement it.
pub trait Choice {
    /// The slot.
    const SLOT: &'static str;

    /// Name of the part.
    fn part(self) -> &'static str;
}

include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// All kernels: files and parts with an entry point.
pub fn kernels() -> impl Iterator<Item = ShaderName> {
    KERNELS.iter().map(|name| ShaderName(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_files() {
        assert_eq!(wgsl::trace::CLOSEST.to_string(), "trace/closest");
        assert!(kernels().any(|name| name == wgsl::trace::CLOSEST));
        assert!(kernels().all(|name| name != wgsl::SHARED && name != wgsl::shared::BVH));
        assert_eq!(
            (choice::NodeKinds::SLOT, choice::NodeKinds::Any.part()),
            ("node_kinds", "shared/bvh/node_kinds/any")
        );
    }
}
