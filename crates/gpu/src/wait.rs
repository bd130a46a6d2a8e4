//! Waiting for the device: blocking in programs, asynchronous in browsers.
//!
//! Everything that reads results back is an `async fn`. A program blocks on it: the device is polled within, so that the future is ready
//! when it is polled first. In a browser nothing may block, and the page's event loop completes the future.

use std::{
    future::{Future, poll_fn},
    sync::{Arc, Mutex, PoisonError},
    task::{Poll, Waker},
};

use crate::GpuError;

/// A clock that works in browsers.
#[cfg(not(target_family = "wasm"))]
pub(crate) use std::time::Instant;
#[cfg(target_family = "wasm")]
pub(crate) use web_time::Instant;

/// Waits for a call that is an `async fn`, in programs that have no executor. All calls of this crate that wait for the device are such functions.
///
/// ```no_run
/// use canted_gpu::{Choice, Gpu, block_on};
///
/// # fn example() -> Result<(), canted_gpu::GpuError> {
/// let gpu = block_on(Gpu::open(&Choice::Best))?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Those of the call; [`GpuError::Blocking`] in a browser, where only calls that need not wait can be passed, such as that of a recorded build.
pub fn block_on<T>(future: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
    #[cfg(not(target_family = "wasm"))]
    return pollster::block_on(future);
    #[cfg(target_family = "wasm")]
    {
        let mut context = std::task::Context::from_waker(Waker::noop());
        match std::pin::pin!(future).poll(&mut context) {
            Poll::Ready(output) => output,
            Poll::Pending => Err(GpuError::Blocking),
        }
    }
}

/// A value that a callback delivers.
struct Slot<T> {
    value: Option<T>,
    /// No value will come after this one.
    is_closed: bool,
    waker: Option<Waker>,
}

/// The end of a slot that a callback fills.
pub(crate) struct Sender<T>(Arc<Mutex<Slot<T>>>);

/// The end of a slot that is awaited.
pub(crate) struct Receiver<T>(Arc<Mutex<Slot<T>>>);

/// A slot for one value.
pub(crate) fn slot<T>() -> (Sender<T>, Receiver<T>) {
    let shared = Arc::new(Mutex::new(Slot { value: None, is_closed: false, waker: None }));
    (Sender(shared.clone()), Receiver(shared))
}

impl<T> Sender<T> {
    /// Delivers the value.
    pub(crate) fn send(self, value: T) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).value = Some(value);
    }
}

impl<T> Receiver<T> {
    /// The value, once it is delivered; `None` if the callback was dropped without a call.
    pub(crate) async fn receive(self) -> Option<T> {
        poll_fn(|context| {
            let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            match slot.value.take() {
                Some(value) => Poll::Ready(Some(value)),
                None if slot.is_closed => Poll::Ready(None),
                None => {
                    slot.waker = Some(context.waker().clone());
                    Poll::Pending
                }
            }
        })
        .await
    }
}

impl<T> Drop for Sender<T> {
    /// Wakes the receiver, also of a callback that is dropped without a call.
    fn drop(&mut self) {
        let waker = {
            let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            slot.is_closed = true;
            slot.waker.take()
        };
        if let Some(waker) = waker {
            waker.wake();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_arrives_before_and_after_it_is_awaited() {
        let (sender, receiver) = slot();
        sender.send(7);
        assert_eq!(pollster::block_on(receiver.receive()), Some(7));
        let (sender, receiver) = slot();
        let thread = std::thread::spawn(move || pollster::block_on(receiver.receive()));
        std::thread::sleep(std::time::Duration::from_millis(20));
        sender.send(8);
        assert_eq!(thread.join().unwrap(), Some(8));
    }

    #[test]
    fn a_dropped_callback_ends_the_wait() {
        let (sender, receiver) = slot::<u32>();
        let thread = std::thread::spawn(move || pollster::block_on(receiver.receive()));
        std::thread::sleep(std::time::Duration::from_millis(20));
        drop(sender);
        assert_eq!(thread.join().unwrap(), None);
    }
}
