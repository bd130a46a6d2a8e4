use canted_trace::{Hit, Ray};

/// A built tree that answers rays in world space, on the thread that asks.
pub(crate) trait Engine {
    /// The nearest hit of each ray; `side` is not asked for.
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]);

    /// Whether each ray hits anything.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);

    /// Bytes of everything that tracing reads; `None` where an engine does not tell.
    fn n_bytes(&self) -> Option<usize> {
        None
    }

    /// The same for several threads to ask at once; `None` where it is not to be.
    fn shared(&self) -> Option<&(dyn Engine + Sync)> {
        None
    }
}

/// Whose engine it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    Ours,
    Peer,
}

/// What its triangle test promises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Promise {
    /// Speed: rays may slip between neighbours.
    Fast,
    /// No ray slips between neighbours.
    Watertight,
}

/// An engine to be built.
pub(crate) struct Entry<'a> {
    pub(crate) name: String,
    pub(crate) owner: Owner,
    pub(crate) promise: Promise,
    /// Whether it places meshes instead of flattening them.
    pub(crate) is_placed: bool,
    /// Whether it builds on more than one thread.
    pub(crate) is_parallel: bool,
    /// Builds on the given number of threads, which a pool of that size surrounds.
    pub(crate) build: Build<'a>,
}

/// Builds on a number of threads.
pub(crate) type Build<'a> = Box<dyn Fn(usize) -> anyhow::Result<Box<dyn Engine>> + Send + Sync + 'a>;
