//! Work without Python's global lock that Ctrl-C interrupts.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::error::{Panic, guard, invalid};
use crate::threads::Threads;

/// How often a call lets Python handle signals.
const PERIOD: Duration = Duration::from_millis(20);

/// Does `jobs` on `threads`, in any order, until all are done, one fails, or a signal handler raises an exception.
///
/// A job is short compared with the time in which a call must be interruptible. Threads of the pool take jobs while this one waits, so
/// there are no rounds at whose end threads wait for each other.
pub(crate) fn for_jobs<J: Send>(
    py: Python<'_>,
    threads: &Threads,
    jobs: Vec<J>,
    job: impl Fn(J) + Sync + Send,
) -> PyResult<()> {
    let queue =
        Queue { jobs: Mutex::new(jobs.into_iter()), is_stopped: AtomicBool::new(false), panic: Mutex::new(None) };
    if threads.n() == 1 || lock(&queue.jobs).len() <= 1 {
        while !py.detach(|| queue.work(&job, Some(Instant::now() + PERIOD))) {
            py.check_signals()?;
        }
    } else {
        let (done, n_ended) = (Condvar::new(), Mutex::new(0));
        let interrupt = py.detach(|| {
            threads.on_each(
                || {
                    queue.work(&job, None);
                    *lock(&n_ended) += 1;
                    done.notify_one();
                },
                || {
                    let mut ended = lock(&n_ended);
                    while *ended < threads.n() {
                        ended = done.wait_timeout(ended, PERIOD).unwrap_or_else(PoisonError::into_inner).0;
                        // Not while holding what the others need.
                        drop(ended);
                        if let Err(interrupt) = Python::attach(|py| py.check_signals()) {
                            queue.is_stopped.store(true, Ordering::Relaxed);
                            return Err(interrupt);
                        }
                        ended = lock(&n_ended);
                    }
                    Ok(())
                },
            )
        });
        interrupt?;
    }
    match queue.panic.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(panic) => Err(panic.into()),
        None => py.check_signals(),
    }
}

/// Jobs that several threads take.
struct Queue<J> {
    jobs: Mutex<std::vec::IntoIter<J>>,
    is_stopped: AtomicBool,
    panic: Mutex<Option<Panic>>,
}

impl<J> Queue<J> {
    /// Takes jobs until there are none, one fails, the queue is stopped or time is up; whether it was not the time.
    fn work(&self, job: impl Fn(J), end: Option<Instant>) -> bool {
        while end.is_none_or(|end| Instant::now() < end) {
            if self.is_stopped.load(Ordering::Relaxed) {
                return true;
            }
            let Some(this) = lock(&self.jobs).next() else { return true };
            if let Err(failure) = guard(|| job(this)) {
                lock(&self.panic).get_or_insert(failure);
                self.is_stopped.store(true, Ordering::Relaxed);
                return true;
            }
        }
        false
    }
}

/// The content of a mutex. Jobs panic without holding one.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a task that cannot be divided on a thread of its own: after an interrupt it is abandoned, and its result is dropped when
/// it ends.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: &Threads,
    task: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    run_watched(py, threads, task, |_| Ok(()))
}

/// As [`run`], and calls `watch` several times a second with Python's lock; its error abandons the task, too.
pub(crate) fn run_watched<T: Send + 'static>(
    py: Python<'_>,
    threads: &Threads,
    task: impl FnOnce() -> T + Send + 'static,
    mut watch: impl FnMut(Python<'_>) -> PyResult<()>,
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
    let wait = || lock(&receive).recv_timeout(PERIOD);
    loop {
        match py.detach(wait) {
            Ok(result) => return Ok(result?),
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals()?;
                watch(py)?;
            }
            Err(RecvTimeoutError::Disconnected) => return Err(invalid("a thread of canted ended without a result")),
        }
    }
}
