//! Ctrl-C, and the signals by which schedulers end a job: SIGTERM and SIGHUP. Nothing half-written remains, whether the work is
//! asked to stop or the process ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of who was interrupted, as a shell shows it.
pub(crate) const CODE: u8 = 130;

static STOP: AtomicBool = AtomicBool::new(false);

/// A flag that Ctrl-C sets, for work that looks at it and has something to keep.
pub(crate) fn flag() -> &'static AtomicBool {
    // Without a handler Ctrl-C ends the process as ever, which is as good.
    let _ = ctrlc::try_set_handler(|| STOP.store(true, Ordering::Relaxed));
    &STOP
}

/// Lets Ctrl-C end the process, for work that has nothing to keep; where this was called, nobody sets the flag.
pub(crate) fn ends_the_process() {
    // Without a handler it ends too, but for what is half-written just then.
    let _ = ctrlc::try_set_handler(|| {
        let _discarded = canted_renderer::discard_unfinished();
        std::process::exit(CODE.into());
    });
}
