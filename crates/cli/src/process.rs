//! The process: signals that end it (Ctrl-C, and SIGTERM and SIGHUP, by which schedulers end a job), and its memory.
//!
//! No half-written file remains, whether the work stops by itself or the process ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of an interrupted run, as shells report it.
pub(crate) const EXIT_CODE: u8 = 130;

/// Whether the running work polls [`CANCEL`]. If not, a signal ends the process.
static IS_POLLED: AtomicBool = AtomicBool::new(false);

static CANCEL: AtomicBool = AtomicBool::new(false);

/// Makes signals end the process until [`cancel_flag`] is called.
pub(crate) fn install_handlers() {
    on_signals(|| {
        // A second signal does not wait for the partial result.
        if IS_POLLED.load(Ordering::Relaxed) && !CANCEL.swap(true, Ordering::Relaxed) {
            return;
        }
        let _discarded = canted_film::discard_unfinished();
        exit();
    });
}

/// Starts the program anew with a folder in `XDG_RUNTIME_DIR` where it is missing: a layer of Mesa's Vulkan driver, which asks Wayland for
/// the default adapter, reports that as an error.
#[cfg(all(target_os = "linux", feature = "gpu"))]
pub(crate) fn set_runtime_folder() {
    use std::{env, os::unix::process::CommandExt, path::Path, process::Command};
    const VARIABLE: &str = "XDG_RUNTIME_DIR";
    if env::var_os(VARIABLE).is_some_and(|folder| Path::new(&folder).is_absolute()) {
        return;
    }
    let mut args = env::args_os();
    if let (Ok(program), Some(name)) = (env::current_exe(), args.next()) {
        // Returns only where the program cannot be started.
        let _ = Command::new(program).arg0(name).args(args).env(VARIABLE, "/tmp").exec();
    }
}

/// Only that driver needs it.
#[cfg(not(all(target_os = "linux", feature = "gpu")))]
pub(crate) fn set_runtime_folder() {}

/// A flag that the first signal from now on sets instead of ending the process, so that the caller can write its partial result.
pub(crate) fn cancel_flag() -> &'static AtomicBool {
    IS_POLLED.store(true, Ordering::Relaxed);
    &CANCEL
}

/// Whether a signal has stopped the work.
pub(crate) fn is_interrupted() -> bool {
    CANCEL.load(Ordering::Relaxed)
}

/// Ends the process without exit handlers: those of a GPU driver would destroy what another thread still initializes.
#[cfg(unix)]
fn exit() -> ! {
    signal_hook::low_level::exit(EXIT_CODE.into())
}

#[cfg(not(unix))]
fn exit() -> ! {
    std::process::exit(EXIT_CODE.into())
}

/// Calls a function on each signal. If no handler can be installed, signals keep their default action.
#[cfg(unix)]
fn on_signals(call: fn()) {
    use signal_hook::{consts, iterator::Signals};
    // Only Linux reports whether `nohup` ignores SIGHUP; elsewhere SIGHUP keeps its default action.
    let hang_up = cfg!(target_os = "linux").then_some(consts::SIGHUP);
    let all = [consts::SIGINT, consts::SIGTERM].into_iter().chain(hang_up);
    let Ok(mut signals) = Signals::new(all.filter(|&signal| !is_ignored(signal))) else { return };
    std::thread::spawn(move || signals.forever().for_each(|_| call()));
}

#[cfg(not(unix))]
fn on_signals(call: fn()) {
    let _ = ctrlc::try_set_handler(call);
}

/// Whether the parent process set a signal to be ignored, as `nohup` and the `&` of scripts do. Known on Linux only.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Peak resident memory of this process; `None` where the system does not report it.
pub(crate) fn peak_bytes() -> Option<u64> {
    entry_bytes("/proc/self/status", "VmHWM:")
}

/// Available memory of this machine; `None` where the system does not report it.
#[cfg(feature = "gpu")]
pub(crate) fn available_bytes() -> Option<u64> {
    entry_bytes("/proc/meminfo", "MemAvailable:")
}

/// An entry of a file of the form `key: N kB`.
fn entry_bytes(path: &str, key: &str) -> Option<u64> {
    let text = std::fs::read_to_string(path).ok()?;
    let entry = text.lines().find_map(|line| line.strip_prefix(key))?;
    entry.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib * 1024)
}

/// A size with a unit and three or four digits.
pub(crate) fn human(n_bytes: u64) -> String {
    let n = n_bytes as f64;
    match n_bytes {
        0..1000 => format!("{n_bytes} B"),
        1000..1_000_000 => format!("{:.1} kB", n / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", n / 1e6),
        _ => format!("{:.2} GB", n / 1e9),
    }
}
