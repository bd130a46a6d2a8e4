//! A tree of a level is replaced by one that was built on its own.

use bytemuck::{Pod, Zeroable};

use super::{BuildConfig, Built, Items, Range, Run};
use crate::{GpuError, NamedBinding, Specialisation};

/// `Place` of `build/adopt`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Place {
    first: u32,
}

impl Built {
    /// Builds tree `number` again over its items, whose vertices have moved. The other trees stay.
    pub(crate) fn rebuild_tree(
        &mut self,
        run: &mut Run<'_>,
        number: usize,
        config: BuildConfig,
    ) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let Range { first, count } = self.items.ranges()[number];
        if count == 0 {
            return Ok(());
        }
        let items = Items::unknown_triangles(gpu, vec![Range { first: 0, count }])?;
        let (Some(all), Some(own)) = (self.items.corners(), items.corners()) else { return Ok(()) };
        run.stage("corners", |dispatches| {
            dispatches.work.copy_range((&**all, first), (&**own, 0), count);
            Ok(())
        })?;
        let own = Self::new(run, items, config)?;
        self.adopt(run, &own, first)
    }

    /// Replaces the tree over the items from `first` on by one over as many items of its own.
    fn adopt(&self, run: &mut Run<'_>, own: &Self, first: u32) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let n = own.items.len();
        let place = gpu.uniform("place of a tree", &Place { first })?;
        let bound: [NamedBinding<'_>; 7] = [
            ("place", &place),
            ("own_nodes", &own.trees.nodes),
            ("own_parents", &own.trees.parents),
            ("own_leaves", &own.leaves),
            ("nodes", &self.trees.nodes),
            ("parents", &self.trees.parents),
            ("leaves", &self.leaves),
        ];
        run.stage("adopt", |dispatches| {
            let kernel = gpu.kernel("build/adopt", &Specialisation::none())?;
            dispatches.items(&kernel, &bound, n)?;
            let work = &mut dispatches.work;
            work.copy_range((&own.trees.heights, 0), (&self.trees.heights, first), n);
            work.copy_range((&own.aabbs, 0), (&self.aabbs, first), n);
            if let (Some(own), Some(all)) = (&own.obbs, &self.obbs) {
                work.copy_range((own, 0), (all, first), n);
            }
            Ok(())
        })
    }
}
