//! The thread that renders: it takes the latest job, shows a coarse picture at once, then passes of 1, 1, 2, 4, ... samples.
//!
//! A new job cancels the passes of the last one after at most a pixel, but not a coarse picture: while a camera moves, each
//! job shows something.

use std::{
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, Sender},
    },
    time::Duration,
};

use canted_renderer::RenderError;

use super::{
    frame::{Frame, Seen},
    options::Options,
    passes,
};
use crate::output;

/// A picture to render.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Increases with each job.
    pub(super) number: u64,
    pub(super) options: Options,
    /// Whether another job will follow soon.
    pub(super) is_moving: bool,
}

/// What the thread reports.
pub(super) enum Message {
    Frame(Frame),
    /// What is at the position of a click.
    Seen(Option<Seen>),
    /// Why a job has no picture.
    Failed {
        number: u64,
        reason: String,
    },
    /// Warnings and notes.
    Warnings(Vec<String>),
}

/// What the thread has to do.
#[derive(Default)]
struct Inbox {
    job: Option<Job>,
    clicks: Vec<[f64; 2]>,
    is_closed: bool,
}

/// Between the session and its thread.
#[derive(Default)]
pub(super) struct Desk {
    inbox: Mutex<Inbox>,
    changed: Condvar,
    cancel: AtomicBool,
}

impl Desk {
    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what there is to do, and cancels what runs.
    fn post(&self, change: impl FnOnce(&mut Inbox)) {
        let mut inbox = self.inbox();
        change(&mut inbox);
        self.cancel.store(true, Ordering::Relaxed);
        self.changed.notify_all();
    }

    /// Waits for something to do: a job or clicks; `None` once the session is closed.
    fn next(&self) -> Option<(Option<Job>, Vec<[f64; 2]>)> {
        let mut inbox = self.inbox();
        loop {
            if inbox.is_closed {
                return None;
            }
            if inbox.job.is_some() || !inbox.clicks.is_empty() {
                self.cancel.store(false, Ordering::Relaxed);
                return Some((inbox.job.take(), std::mem::take(&mut inbox.clicks)));
            }
            inbox = self.changed.wait(inbox).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The clicks during a job, after which it goes on; `None` if another job is there.
    pub(super) fn clicks(&self) -> Option<Vec<[f64; 2]>> {
        let mut inbox = self.inbox();
        if inbox.job.is_some() || inbox.is_closed {
            return None;
        }
        self.cancel.store(false, Ordering::Relaxed);
        Some(std::mem::take(&mut inbox.clicks))
    }

    /// Whether another job comes within a time.
    pub(super) fn is_followed_within(&self, time: Duration) -> bool {
        let has_none = |inbox: &mut Inbox| inbox.job.is_none() && !inbox.is_closed;
        let waited = self.changed.wait_timeout_while(self.inbox(), time, has_none);
        let (inbox, _) = waited.unwrap_or_else(PoisonError::into_inner);
        inbox.job.is_some() || inbox.is_closed
    }

    /// Set while there is something else to do.
    pub(super) fn cancel(&self) -> &AtomicBool {
        &self.cancel
    }
}

/// Sends messages, and wakes the receiver.
pub(super) struct Outbox {
    sender: Sender<Message>,
    wake: Box<dyn Fn() + Send>,
}

impl Outbox {
    pub(super) fn send(&self, message: Message) {
        // A session that is closed receives nothing.
        let _ = self.sender.send(message);
        (self.wake)();
    }
}

/// The thread and the ends of its channels.
pub(super) struct Worker {
    desk: Arc<Desk>,
    pub(super) messages: Receiver<Message>,
    /// Disconnected once the thread has ended.
    ended: Receiver<()>,
}

/// How long a session that closes waits for its thread. One that still reads a file or builds a structure ends with the program.
const LONGEST_END: Duration = Duration::from_millis(300);

impl Worker {
    /// Starts the thread, which calls `wake` after each message.
    pub(super) fn start(wake: Box<dyn Fn() + Send>) -> Self {
        let (sender, messages) = mpsc::channel();
        let (alive, ended) = mpsc::channel();
        let desk = Arc::new(Desk::default());
        let of_thread = Arc::clone(&desk);
        std::thread::spawn(move || {
            let _alive = alive;
            work(&of_thread, &Outbox { sender, wake });
        });
        Self { desk, messages, ended }
    }

    /// Replaces the job that waits, and cancels the one that runs.
    pub(super) fn render(&self, job: Job) {
        self.desk.post(|inbox| inbox.job = Some(job));
    }

    /// Asks what is at a position in pixels of the latest picture.
    pub(super) fn click(&self, position: [f64; 2]) {
        self.desk.post(|inbox| inbox.clicks.push(position));
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.desk.post(|inbox| inbox.is_closed = true);
        let _ = self.ended.recv_timeout(LONGEST_END);
    }
}

/// Serves jobs and clicks until the session is closed.
fn work(desk: &Desk, outbox: &Outbox) {
    let mut renderer = passes::Renderer::default();
    let mut reported = Vec::new();
    while let Some((job, clicks)) = desk.next() {
        let (_, warnings) = output::collecting(|| {
            if let Some(job) = job {
                let number = job.number;
                if let Err(error) = renderer.serve(&job, desk, outbox) {
                    let is_cancelled = matches!(error.downcast_ref(), Some(RenderError::Cancelled));
                    if !is_cancelled {
                        outbox.send(Message::Failed { number, reason: error.to_string() });
                    }
                }
            }
            renderer.answer(clicks, outbox);
        });
        let new: Vec<String> = warnings.into_iter().filter(|warning| !reported.contains(warning)).collect();
        reported.extend(new.iter().cloned());
        if !new.is_empty() {
            outbox.send(Message::Warnings(new));
        }
    }
}
