//! How the runs of a node are divided between its children: by bins, or by Morton codes.

use canted_lbvh::Sorted;
use canted_obb::Aabb;

use crate::{
    TopDownConfig, curve, par,
    reference::Reference,
    top_down::{Span, split},
};

/// References per job.
const CHUNK: usize = 1 << 13;

/// The runs of a node.
pub(crate) trait Divide: Sized + Send {
    fn references(&self) -> &[Reference];

    /// Those of both children of the node, which is at `depth`; at least two runs, and each child has one.
    fn divided(self, depth: u32) -> [Self; 2];
}

/// Divided between bins.
pub(crate) struct Binned<'a> {
    pub(crate) span: Span<'a>,
    pub(crate) config: &'a TopDownConfig,
}

impl Divide for Binned<'_> {
    fn references(&self) -> &[Reference] {
        self.span.references
    }

    fn divided(self, depth: u32) -> [Self; 2] {
        let Self { mut span, config } = self;
        let n_left = split(&mut span, config, depth);
        span.at(n_left).map(|span| Self { span, config })
    }
}

/// Divided where sorted codes differ in the highest bit; equal codes in halves. So the depth is that of a radix tree.
#[derive(Clone, Copy)]
pub(crate) struct Coded<'a> {
    pub(crate) references: &'a [Reference],
    pub(crate) codes: &'a [u64],
}

impl Divide for Coded<'_> {
    fn references(&self) -> &[Reference] {
        self.references
    }

    fn divided(self, _: u32) -> [Self; 2] {
        let (first, last) = (self.codes[0], self.codes[self.codes.len() - 1]);
        let n_left = match (first ^ last).checked_ilog2() {
            None => self.codes.len().div_ceil(2),
            Some(bit) => self.codes.partition_point(|code| code >> bit & 1 == 0),
        };
        let (left, right) = self.references.split_at(n_left);
        let (left_codes, right_codes) = self.codes.split_at(n_left);
        [Self { references: left, codes: left_codes }, Self { references: right, codes: right_codes }]
    }
}

/// The runs along a Morton curve, with the codes of their centers.
pub(crate) fn along_curve(references: Vec<Reference>) -> (Vec<Reference>, Vec<u64>) {
    let boxes = par::map(&references, CHUNK, Reference::aabb);
    let parts = par::map_chunks(&boxes, CHUNK, |_, boxes| around(boxes));
    let (Sorted { codes, leaves }, _) = curve::along_curve(&boxes, &around(&parts));
    (par::map(&leaves, CHUNK, |leaf| references[leaf.index()]), codes)
}

fn around(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
}
