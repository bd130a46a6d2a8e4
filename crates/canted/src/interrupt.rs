//! Ctrl-C: the first asks the work to stop, so that nothing half-written remains.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// A flag that Ctrl-C sets.
pub(crate) fn flag() -> &'static AtomicBool {
    // Without a handler Ctrl-C ends the process as ever, which is as good.
    let _ = ctrlc::try_set_handler(|| STOP.store(true, Ordering::Relaxed));
    &STOP
}
