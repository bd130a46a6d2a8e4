//! The clock of the card while a chapter runs, where the system tells it: `nvidia-smi`, or files of the kernel for amdgpu.

use std::process::Command;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use std::{fs, thread};

/// Time between two readings. `nvidia-smi` takes some tens of milliseconds of the CPU.
const PAUSE: Duration = Duration::from_millis(500);

/// Lowest and highest reading, in MHz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clock {
    lowest: u32,
    highest: u32,
}

impl Clock {
    fn of(readings: &[u32]) -> Option<Self> {
        Some(Self { lowest: *readings.iter().min()?, highest: *readings.iter().max()? })
    }
}

/// A sentence for the end of a chapter.
pub(super) fn sentence(clock: Option<Clock>) -> String {
    match clock {
        None => "Clock of the card: not known.".to_owned(),
        Some(Clock { lowest, highest }) => {
            format!("Clock of the card, also between dispatches: {lowest} to {highest} MHz.")
        }
    }
}

/// Does the work and reads the clock of this adapter meanwhile, at once and every [`PAUSE`]; `None` where nothing tells it.
pub(super) fn during<T>(adapter: &str, work: impl FnOnce() -> T) -> (T, Option<Clock>) {
    let (working, done) = channel::<()>();
    thread::scope(|scope| {
        let watch = scope.spawn(move || {
            let mut readings = vec![];
            while let Some(clock) = read(adapter) {
                readings.push(clock);
                if done.recv_timeout(PAUSE) != Err(RecvTimeoutError::Timeout) {
                    break;
                }
            }
            Clock::of(&readings)
        });
        let result = work();
        drop(working);
        (result, watch.join().unwrap_or(None))
    })
}

/// The clock now, in MHz.
fn read(adapter: &str) -> Option<u32> {
    let query = Command::new("nvidia-smi").args(["--query-gpu=name,clocks.sm", "--format=csv,noheader"]).output();
    let of_nvidia = query.ok().and_then(|output| of_nvidia(&String::from_utf8_lossy(&output.stdout), adapter));
    let is_of_amd = ["AMD", "Radeon"].iter().any(|maker| adapter.contains(maker));
    of_nvidia.or_else(|| {
        if !is_of_amd {
            return None;
        }
        let cards = fs::read_dir("/sys/class/drm").ok()?.flatten();
        let tables = cards.filter_map(|card| fs::read_to_string(card.path().join("device/pp_dpm_sclk")).ok());
        // Names of adapters are not in these files: the busiest card is the one that is measured.
        tables.filter_map(|table| of_amd(&table)).max()
    })
}

/// Of lines such as `NVIDIA H200, 1980 MHz` that of this adapter; of several such cards the busiest.
fn of_nvidia(lines: &str, adapter: &str) -> Option<u32> {
    let of_line = |line: &str| {
        let (name, clock) = line.rsplit_once(',')?;
        (name.trim() == adapter).then(|| clock.trim().strip_suffix("MHz")?.trim().parse().ok()).flatten()
    };
    lines.lines().filter_map(of_line).max()
}

/// Of lines such as `1: 2482Mhz *` the one with the star, which is the present state.
fn of_amd(lines: &str) -> Option<u32> {
    let line = lines.lines().find_map(|line| line.trim_end().strip_suffix('*'))?;
    line.split_once(':')?.1.trim().to_lowercase().strip_suffix("mhz")?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_read_from_what_drivers_write() {
        let lines = "NVIDIA A100, 210 MHz\nNVIDIA H200, 1980 MHz\n";
        assert_eq!(of_nvidia(lines, "NVIDIA H200"), Some(1980));
        assert_eq!(of_nvidia(lines, "NVIDIA A100"), Some(210));
        assert_eq!(of_nvidia("NVIDIA H200, 345 MHz\nNVIDIA H200, 1980 MHz\n", "NVIDIA H200"), Some(1980));
        for unknown in ["", "NVIDIA H200, [N/A]\n", "NVIDIA H200\n", "No devices were found\n"] {
            assert_eq!(of_nvidia(unknown, "NVIDIA H200"), None, "{unknown}");
        }
        assert_eq!(of_amd("0: 500Mhz \n1: 1254Mhz *\n2: 2482Mhz \n"), Some(1254));
        assert_eq!(of_amd("S: 19Mhz *\n0: 500Mhz\n"), Some(19));
        for unknown in ["", "0: 500Mhz \n", "0: *\n", "*\n"] {
            assert_eq!(of_amd(unknown), None, "{unknown}");
        }
    }

    #[test]
    fn lowest_and_highest_readings_are_kept() {
        assert_eq!(
            sentence(Clock::of(&[1410, 1980, 345])),
            "Clock of the card, also between dispatches: 345 to 1980 MHz."
        );
        assert_eq!(sentence(Clock::of(&[])), "Clock of the card: not known.");
        // No card has this name; the work is done once.
        let mut n = 0;
        let (result, _) = during("no such card", || {
            n += 1;
            n
        });
        assert_eq!((result, n), (1, 1));
    }
}
