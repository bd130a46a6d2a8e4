//! Work without Python's global lock that Ctrl-C interrupts.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::error::{Panic, guard, invalid};
use crate::threads::Threads;

/// How long work runs before Python may handle signals. Calls of 16 threads at once that share a pool still handle them
/// several times a second.
const ROUND: Duration = Duration::from_millis(10);

/// Does `jobs` on `threads`, in any order, until all are done, one fails, or a signal handler raises an exception.
///
/// A job is short compared with the time in which a call must be interruptible.
pub(crate) fn for_jobs<J: Send>(
    py: Python<'_>,
    threads: &Threads,
    jobs: Vec<J>,
    job: impl Fn(J) + Sync + Send,
) -> PyResult<()> {
    let alone = jobs.len() <= 1;
    let waiting = Mutex::new(jobs.into_iter());
    let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
    loop {
        let is_done = py.detach(|| {
            let end = Instant::now() + ROUND;
            let panic: Mutex<Option<Panic>> = Mutex::new(None);
            threads.on_each(alone, || {
                while Instant::now() < end
                    && let Some(this) = next()
                {
                    if let Err(failure) = guard(|| job(this)) {
                        panic.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(failure);
                        return;
                    }
                }
            });
            match panic.into_inner().unwrap_or_else(PoisonError::into_inner) {
                Some(panic) => Err(panic),
                None => Ok(waiting.lock().unwrap_or_else(PoisonError::into_inner).len() == 0),
            }
        })?;
        py.check_signals()?;
        if is_done {
            return Ok(());
        }
    }
}

/// Runs a task that cannot be divided on a thread of its own: after an interrupt it is abandoned, and its result is dropped when
/// it ends.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: &Threads,
    task: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (send, receive) = channel();
    let threads = threads.clone();
    let start = move || {
        // The receiver is gone after an interrupt.
        let _ = send.send(guard(|| threads.run(task)));
    };
    std::thread::Builder::new().spawn(start).map_err(|error| invalid(format!("cannot start a thread: {error}")))?;
    // Only so that it may be shared while the lock is released.
    let receive = Mutex::new(receive);
    let wait = || receive.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(ROUND);
    loop {
        match py.detach(wait) {
            Ok(result) => return Ok(result?),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => return Err(invalid("a thread of canted ended without a result")),
        }
    }
}
