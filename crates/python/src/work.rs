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

/// A call from Python: its threads, and the function that is called with its progress.
pub(crate) struct Call<'py> {
    pub(crate) py: Python<'py>,
    pub(crate) threads: Threads,
    progress: Option<Py<PyAny>>,
}

impl<'py> Call<'py> {
    /// The arguments `threads` and `progress`.
    pub(crate) fn new(py: Python<'py>, threads: Option<i64>, progress: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        if let Some(progress) = progress
            && !progress.is_callable()
        {
            return Err(invalid(format!(
                "progress is a {}; use a function of the finished fraction",
                progress.get_type()
            )));
        }
        Ok(Self { py, threads: Threads::new(threads)?, progress: progress.map(|progress| progress.clone().unbind()) })
    }

    /// With all processors and without a function.
    pub(crate) fn plain(py: Python<'py>) -> PyResult<Self> {
        Self::new(py, None, None)
    }

    /// Reports the finished fraction; an exception that the function raises ends the call.
    pub(crate) fn report(&self, fraction: f64) -> PyResult<()> {
        report_progress(self.py, self.progress.as_ref(), fraction)
    }

    /// Does `jobs`, in any order, until all are done, one fails, or a signal handler or the function of progress raises an exception.
    ///
    /// A job is short compared with the time in which a call must be interruptible. Threads of the pool take jobs while this one waits, so
    /// there are no rounds at whose end threads wait for each other.
    pub(crate) fn for_jobs<J: Send>(&self, jobs: Vec<J>, job: impl Fn(J) + Sync + Send) -> PyResult<()> {
        let (py, threads, progress) = (self.py, &self.threads, self.progress.as_ref());
        let n_jobs = jobs.len();
        let queue =
            Queue { jobs: Mutex::new(jobs.into_iter()), is_stopped: AtomicBool::new(false), panic: Mutex::new(None) };
        let fraction = || 1.0 - lock(&queue.jobs).len() as f64 / n_jobs.max(1) as f64;
        if threads.n() == 1 || n_jobs <= 1 {
            while !py.detach(|| queue.work(&job, Some(Instant::now() + PERIOD))) {
                py.check_signals()?;
                report_progress(py, progress, fraction())?;
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
                            let watch = |py: Python<'_>| {
                                py.check_signals().and_then(|()| report_progress(py, progress, fraction()))
                            };
                            if let Err(interrupt) = Python::attach(watch) {
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
            None => py.check_signals().and_then(|()| self.report(1.0)),
        }
    }

    /// Runs a task that cannot be divided on a thread of its own: after an interrupt it is abandoned, and its result is dropped when it
    /// ends. The function of progress gets 0 meanwhile, and may end it, too.
    pub(crate) fn run<T: Send + 'static>(&self, task: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
        run_watched(self.py, &self.threads, task, |_| self.report(0.0))
    }

    /// Runs a short task, without Python's global lock.
    pub(crate) fn run_short<T: Send>(&self, task: impl FnOnce() -> T + Send) -> PyResult<T> {
        let threads = &self.threads;
        Ok(self.py.detach(|| guard(|| threads.run(task)))?)
    }
}

/// Calls a function of the finished fraction.
fn report_progress(py: Python<'_>, progress: Option<&Py<PyAny>>, fraction: f64) -> PyResult<()> {
    progress.map_or(Ok(()), |progress| progress.call1(py, (fraction,)).map(drop))
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

/// Runs a task on a thread of its own, and calls `watch` several times a second with Python's lock; its error abandons the task, as an
/// interrupt does.
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
