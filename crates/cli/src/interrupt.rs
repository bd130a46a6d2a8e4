//! Ctrl-C, and the signals by which schedulers end a job: SIGTERM and SIGHUP. Nothing half-written remains, whether the work is
//! asked to stop or the process ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of who was interrupted, as a shell shows it.
pub(crate) const CODE: u8 = 130;

/// Whether work looks at [`STOP`], so that a signal is no end yet.
static IS_LOOKED_AT: AtomicBool = AtomicBool::new(false);

static STOP: AtomicBool = AtomicBool::new(false);

/// Lets signals end the process, which has nothing to keep until work asks for [`flag`].
pub(crate) fn ends_the_process() {
    on_signals(|| {
        if IS_LOOKED_AT.load(Ordering::Relaxed) {
            STOP.store(true, Ordering::Relaxed);
            return;
        }
        let _discarded = canted_film::discard_unfinished();
        leave();
    });
}

/// A flag that a signal sets from here on, in place of the end, for work that looks at it and has something to keep. What is
/// written behind that work is written whole.
pub(crate) fn flag() -> &'static AtomicBool {
    IS_LOOKED_AT.store(true, Ordering::Relaxed);
    &STOP
}

/// Ends the process without what runs at its exit: a driver's own would take apart what another thread still sets up.
#[cfg(unix)]
fn leave() -> ! {
    signal_hook::low_level::exit(CODE.into())
}

#[cfg(not(unix))]
fn leave() -> ! {
    std::process::exit(CODE.into())
}

/// Calls a function at each of the signals; without a handler they end the process as ever.
#[cfg(unix)]
fn on_signals(call: fn()) {
    use signal_hook::{consts, iterator::Signals};
    // Where nobody tells whether `nohup` has it ignored, SIGHUP keeps its own way.
    let hang_up = cfg!(target_os = "linux").then_some(consts::SIGHUP);
    let all = [consts::SIGINT, consts::SIGTERM].into_iter().chain(hang_up);
    let wanted = all.filter(|&signal| !is_ignored(signal));
    let Ok(mut signals) = Signals::new(wanted) else { return };
    std::thread::spawn(move || signals.forever().for_each(|_| call()));
}

#[cfg(not(unix))]
fn on_signals(call: fn()) {
    let _ = ctrlc::try_set_handler(call);
}

/// Whether whoever started the process wants a signal to be ignored, as `nohup` does and a script's `&`; known on Linux alone.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
