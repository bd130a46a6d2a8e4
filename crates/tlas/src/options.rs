use canted_trace::Query;

/// The mask and the time of a ray. Pass it to the queries that end in `_with`.
///
/// A query of your own sets both by [`Query::mask`] and [`Query::time`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayOptions {
    /// The ray tests the instances whose mask shares a bit with this one. All bits by default.
    pub mask: u32,
    /// The time of moving instances: 0 as the shutter opens, 1 as it closes. Clamped to `[0, 1]`; 0 by default.
    pub time: f32,
}

impl Default for RayOptions {
    fn default() -> Self {
        Self { mask: u32::MAX, time: 0.0 }
    }
}

impl RayOptions {
    /// A ray that tests the instances whose mask shares a bit with `mask`.
    #[must_use]
    pub fn mask(mask: u32) -> Self {
        Self { mask, ..Self::default() }
    }

    /// A ray that tests moving instances at `time`.
    #[must_use]
    pub fn time(time: f32) -> Self {
        Self { time, ..Self::default() }
    }
}

impl Query for RayOptions {
    const MAY_REJECT: bool = false;

    #[inline(always)]
    fn mask(&self) -> u32 {
        self.mask
    }

    #[inline(always)]
    fn time(&self) -> f32 {
        self.time
    }
}
