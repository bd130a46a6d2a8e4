//! Ctrl-C, and the signals by which schedulers end a job: they ask the work to stop, so that nothing half-written
//! remains.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// A flag that Ctrl-C sets, SIGTERM and SIGHUP too.
pub(crate) fn flag() -> &'static AtomicBool {
    // Without a handler Ctrl-C ends the process as ever, which is as good.
    let _ = ctrlc::try_set_handler(|| STOP.store(true, Ordering::Relaxed));
    &STOP
}
