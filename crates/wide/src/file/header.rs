use canted_obb::Aabb;

use super::LoadError;
use crate::layout::{Half, Line, MAX_LEAF, Word};
use crate::refit::{Prediction, Wear};
use crate::{Costs, PredictedCost};

/// First bytes of every file.
pub(super) const MAGIC: [u8; 8] = *b"CANTWIDE";

/// Changes with what the bytes mean.
pub(super) const VERSION: u32 = 3;

/// Bytes before the first node.
pub(super) const HEADER_BYTES: usize = 160;

/// Bytes of the header that mean something.
const USED_BYTES: usize = 140;

/// Bytes of the checksum at the end.
pub(super) const CHECKSUM_BYTES: usize = 8;

/// What stands before nodes and blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Header {
    pub(super) n_lines: u64,
    pub(super) n_halves: u64,
    pub(super) n_triangles: u64,
    pub(super) root: Word,
    pub(super) depth: u32,
    pub(super) frame: [[f32; 3]; 3],
    pub(super) bounds: Aabb,
    pub(super) predicted: PredictedCost,
    pub(super) wear: Wear,
}

/// Stands for no cost before the first refit: costs are not negative.
const NOT_YET: f32 = -1.0;

impl Header {
    /// Appends it.
    pub(super) fn write(&self, out: &mut Vec<u8>) {
        let Costs { aligned_node, oriented_node, leaf, block, max_leaf } = self.wear.costs;
        let PredictedCost { aligned, chosen } = self.predicted;
        out.extend(MAGIC);
        out.extend(VERSION.to_le_bytes());
        for word in [self.root.0, self.depth, u32::try_from(max_leaf).unwrap_or(u32::MAX)] {
            out.extend(word.to_le_bytes());
        }
        for count in [self.n_lines, self.n_halves, self.n_triangles] {
            out.extend(count.to_le_bytes());
        }
        let costs = [aligned_node, oriented_node, leaf, block, aligned, chosen];
        let fresh = self.wear.fresh.map_or([NOT_YET; 2], |fresh| [fresh.per_ray, fresh.per_triangle]);
        let groups = [self.frame.as_flattened(), &self.bounds.min, &self.bounds.max, &costs, &fresh];
        for number in groups.into_iter().flatten() {
            out.extend(number.to_le_bytes());
        }
        out.extend([0; HEADER_BYTES - USED_BYTES]);
    }

    /// Reads it; only the number of bytes, the magic ones, the version and costs are looked at.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, LoadError> {
        let Some(header) = bytes.first_chunk::<HEADER_BYTES>() else {
            return Err(LoadError::Length { n_bytes: bytes.len(), n_told: HEADER_BYTES as u64 });
        };
        let mut fields = Fields(header);
        let magic = fields.take();
        if magic != MAGIC {
            return Err(LoadError::Magic { found: magic });
        }
        let version = fields.word();
        if version != VERSION {
            return Err(LoadError::Version { found: version });
        }
        let [root, depth, max_leaf] = [(); 3].map(|()| fields.word());
        let [n_lines, n_halves, n_triangles] = [(); 3].map(|()| u64::from_le_bytes(fields.take()));
        let frame = [[(); 3]; 3].map(|row| row.map(|()| fields.number()));
        let [min, max] = [[(); 3]; 2].map(|corner| corner.map(|()| fields.number()));
        let costs @ [aligned_node, oriented_node, leaf, block, aligned, chosen] = [(); 6].map(|()| fields.number());
        let [per_ray, per_triangle] = [(); 2].map(|()| fields.number());
        let fresh = (per_ray >= 0.0 && per_triangle >= 0.0).then_some(Prediction { per_ray, per_triangle });
        // Costs may be infinite: that forbids a kind of node.
        if let Some(&value) = costs.iter().find(|cost| cost.is_nan()) {
            return Err(LoadError::Cost { value });
        }
        let costs = Costs { aligned_node, oriented_node, leaf, block, max_leaf: (max_leaf as usize).min(MAX_LEAF) };
        Ok(Self {
            n_lines,
            n_halves,
            n_triangles,
            root: Word(root),
            depth,
            frame,
            bounds: Aabb { min, max },
            predicted: PredictedCost { aligned, chosen },
            wear: Wear { costs, fresh },
        })
    }

    /// Bytes of the whole file that it tells of; saturates.
    pub(super) fn n_bytes(&self) -> u64 {
        let lines = self.n_lines.saturating_mul(size_of::<Line>() as u64);
        let halves = self.n_halves.saturating_mul(size_of::<Half>() as u64);
        lines.saturating_add(halves).saturating_add((HEADER_BYTES + CHECKSUM_BYTES) as u64)
    }
}

/// Fields one after the other.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    /// The next `N` bytes; zeros past the end, where no field of a header lies.
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((field, rest)) = self.0.split_first_chunk::<N>() else { return [0; N] };
        self.0 = rest;
        *field
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn number(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }
}
