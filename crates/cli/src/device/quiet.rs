//! Keeps messages of GPU drivers and of the Vulkan loader off standard error: they complain about a missing desktop.

/// Runs `open` while standard error is discarded, unless `-v` is given.
#[cfg(unix)]
pub(super) fn quietly<T>(open: impl FnOnce() -> T) -> T {
    use std::{
        fs::File,
        os::fd::{AsFd, OwnedFd},
    };

    /// Standard error as it was; restored on drop, also by a panic.
    struct Kept(OwnedFd);
    impl Drop for Kept {
        fn drop(&mut self) {
            let _ = rustix::stdio::dup2_stderr(&self.0);
        }
    }

    if crate::output::is_verbose() {
        return open();
    }
    let kept = std::io::stderr().as_fd().try_clone_to_owned();
    let (Ok(kept), Ok(nothing)) = (kept, File::options().write(true).open("/dev/null")) else { return open() };
    // Restored even if the call fails halfway.
    let _kept = Kept(kept);
    let _ = rustix::stdio::dup2_stderr(&nothing);
    open()
}

/// Runs `open`: loaders of other systems print nothing.
#[cfg(not(unix))]
pub(super) fn quietly<T>(open: impl FnOnce() -> T) -> T {
    open()
}
