use canted_trace::{Hit, Ray};

/// A built BVH that traces rays in world space, on the calling thread.
pub(crate) trait Engine {
    /// The nearest hit of each ray; `side` is not used.
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]);

    /// Whether each ray hits anything.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);

    /// Bytes of everything that tracing reads; `None` if an engine does not report it.
    fn n_bytes(&self) -> Option<usize> {
        None
    }

    /// The engine for concurrent use by several threads; `None` if that is not supported.
    fn shared(&self) -> Option<&(dyn Engine + Sync)> {
        None
    }
}

/// The origin of an engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    Ours,
    Peer,
}

/// The guarantee of its triangle test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Promise {
    /// Speed: rays may slip between neighbors.
    Fast,
    /// No ray slips between neighbors.
    Watertight,
}

/// An engine to build.
pub(crate) struct Entry<'a> {
    pub(crate) name: String,
    pub(crate) owner: Owner,
    pub(crate) promise: Promise,
    /// Whether it uses instances instead of flattening them.
    pub(crate) is_placed: bool,
    /// Whether it builds on more than one thread.
    pub(crate) is_parallel: bool,
    /// Builds on the given number of threads, inside a pool of that size.
    pub(crate) build: Build<'a>,
}

/// Builds on a number of threads.
pub(crate) type Build<'a> = Box<dyn Fn(usize) -> anyhow::Result<Box<dyn Engine>> + Send + Sync + 'a>;
