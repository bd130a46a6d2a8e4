//! Memory sizes, as the system reports them and as text.

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
    #[expect(clippy::cast_precision_loss, reason = "a few digits are shown")]
    let n = n_bytes as f64;
    match n_bytes {
        0..1000 => format!("{n_bytes} B"),
        1000..1_000_000 => format!("{:.1} kB", n / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", n / 1e6),
        _ => format!("{:.2} GB", n / 1e9),
    }
}
