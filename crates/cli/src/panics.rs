//! Panics of libraries that readers catch: they are errors of a file, which is reported with its name, and print nothing themselves.

use std::panic::{self, PanicHookInfo};

/// Crates whose panics `canted-scene` catches, as they are in the paths of their sources.
const CAUGHT: [&str; 2] = ["basisu", "ktx2"];

/// Prints panics as before, except those that are caught.
pub(crate) fn quieten() {
    let print = panic::take_hook();
    panic::set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
        if !info.location().is_some_and(|at| is_caught(at.file())) {
            print(info);
        }
    }));
}

/// Whether a source file is one of those crates: `.../ktx2-0.5.0/src/lib.rs`.
fn is_caught(file: &str) -> bool {
    let mut folders = file.split(['/', '\\']);
    folders.any(|folder| folder.split_once('-').is_some_and(|(name, _)| CAUGHT.contains(&name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_panics_of_these_crates_are_silent() {
        for file in ["/registry/src/index/ktx2-0.5.0/src/lib.rs", "C:\\src\\basisu-0.1.0\\src\\etc1s.rs"] {
            assert!(is_caught(file), "{file}");
        }
        for file in ["crates/scene/src/read/ktx2.rs", "/src/index/png-0.17/src/lib.rs", "library/core/src/option.rs"] {
            assert!(!is_caught(file), "{file}");
        }
    }
}
