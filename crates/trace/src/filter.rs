use crate::{Hit, Query};

/// A query that accepts the hits for which a function returns `true`.
///
/// The function must decide by the hit alone, as [`Query::accepts`] requires.
#[derive(Clone, Copy, Debug)]
pub struct HitFilter<F>(pub F);

impl<F: FnMut(&Hit) -> bool> Query for HitFilter<F> {
    #[inline(always)]
    fn accepts(&mut self, hit: &Hit) -> bool {
        (self.0)(hit)
    }
}
