use canted_obb::Aabb;

use super::{LoadError, VERSION};
use crate::bvh::PredictedCost;
use crate::config::{Baseline, Costs, RayCost};
use crate::node::{CacheLine, ChildWord, MAX_LEAF};

/// First bytes of every file.
pub(super) const MAGIC: [u8; 8] = *b"CANTWIDE";

/// Bytes before the first node.
///
/// A multiple of a cache line, so that nodes of a mapped file start on one.
pub(super) const HEADER_BYTES: usize = 192;

/// Bytes of the header that are in use.
const USED_BYTES: usize = 164;

/// Bytes of the checksum at the end.
pub(super) const CHECKSUM_BYTES: usize = 8;

/// What precedes nodes and leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Header {
    pub(super) n_lines: u64,
    /// Units of all leaves.
    pub(super) n_units: u64,
    pub(super) n_primitives: u64,
    pub(super) root: ChildWord,
    pub(super) depth: u32,
    pub(super) frame: [[f32; 3]; 3],
    pub(super) bounds: Aabb,
    pub(super) predicted: PredictedCost,
    pub(super) baseline: Baseline,
    /// Bytes of a unit, and of a primitive that is stored in addition.
    pub(super) n_unit_bytes: u32,
    pub(super) n_primitive_bytes: u32,
    /// The error of hits for which boxes are padded.
    pub(super) hit_error: f32,
    /// The point that boxes are relative to.
    pub(super) reference: [f32; 3],
}

/// The cost before a first refit that has not happened: costs are not negative.
const NOT_YET: f32 = -1.0;

impl Header {
    /// Appends it.
    pub(super) fn write(&self, out: &mut Vec<u8>) {
        let Costs { aligned_node, oriented_node, leaf, block, max_leaf } = self.baseline.costs;
        let PredictedCost { aligned, chosen } = self.predicted;
        out.extend(MAGIC);
        out.extend(VERSION.to_le_bytes());
        for word in [self.root.0, self.depth, u32::try_from(max_leaf).unwrap_or(u32::MAX)] {
            out.extend(word.to_le_bytes());
        }
        for count in [self.n_lines, self.n_units, self.n_primitives] {
            out.extend(count.to_le_bytes());
        }
        let costs = [aligned_node, oriented_node, leaf, block, aligned, chosen];
        let built = self.baseline.built.map_or([NOT_YET; 2], |built| [built.per_ray, built.per_primitive]);
        let groups = [self.frame.as_flattened(), &self.bounds.min, &self.bounds.max, &costs, &built];
        for number in groups.into_iter().flatten() {
            out.extend(number.to_le_bytes());
        }
        for size in [self.n_unit_bytes, self.n_primitive_bytes] {
            out.extend(size.to_le_bytes());
        }
        for number in [self.hit_error].iter().chain(&self.reference) {
            out.extend(number.to_le_bytes());
        }
        out.extend([0; HEADER_BYTES - USED_BYTES]);
    }

    /// Reads it; checks only the number of bytes, the magic bytes, the version and that costs are numbers.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, LoadError> {
        // A file of another kind is no truncated BVH, however short it is.
        let start = &bytes[..bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(start) {
            let mut found = [0; MAGIC.len()];
            found[..start.len()].copy_from_slice(start);
            return Err(LoadError::Magic { found });
        }
        let Some(header) = bytes.first_chunk::<HEADER_BYTES>() else {
            return Err(LoadError::Length { n_bytes: bytes.len(), n_expected: HEADER_BYTES as u64 });
        };
        let mut fields = Fields(header);
        fields.take::<8>();
        let version = fields.word();
        if version != VERSION {
            return Err(LoadError::Version { found: version });
        }
        let [root, depth, max_leaf] = [(); 3].map(|()| fields.word());
        let [n_lines, n_units, n_primitives] = [(); 3].map(|()| u64::from_le_bytes(fields.take()));
        let frame = [[(); 3]; 3].map(|row| row.map(|()| fields.number()));
        let [min, max] = [[(); 3]; 2].map(|corner| corner.map(|()| fields.number()));
        let costs @ [aligned_node, oriented_node, leaf, block, aligned, chosen] = [(); 6].map(|()| fields.number());
        let [per_ray, per_primitive] = [(); 2].map(|()| fields.number());
        let built = (per_ray >= 0.0 && per_primitive >= 0.0).then_some(RayCost { per_ray, per_primitive });
        let [n_unit_bytes, n_primitive_bytes] = [(); 2].map(|()| fields.word());
        let hit_error = fields.number();
        let reference = [(); 3].map(|()| fields.number());
        // Costs may be infinite: that disables a kind of node.
        if let Some(&value) = costs.iter().find(|cost| cost.is_nan()) {
            return Err(LoadError::Cost { value });
        }
        let costs = Costs { aligned_node, oriented_node, leaf, block, max_leaf: (max_leaf as usize).min(MAX_LEAF) };
        Ok(Self {
            n_lines,
            n_units,
            n_primitives,
            root: ChildWord(root),
            depth,
            frame,
            bounds: Aabb { min, max },
            predicted: PredictedCost { aligned, chosen },
            baseline: Baseline { costs, built, now: None },
            n_unit_bytes,
            n_primitive_bytes,
            hit_error,
            reference,
        })
    }

    /// Bytes of nodes, of leaves, and of primitives that are stored in addition; saturates.
    pub(super) fn section_bytes(&self) -> [u64; 3] {
        let lines = self.n_lines.saturating_mul(size_of::<CacheLine>() as u64);
        let units = self.n_units.saturating_mul(self.n_unit_bytes.into());
        [lines, units, self.n_primitives.saturating_mul(self.n_primitive_bytes.into())]
    }

    /// Bytes of the whole file; saturates.
    pub(super) fn n_bytes(&self) -> u64 {
        self.section_bytes().into_iter().fold((HEADER_BYTES + CHECKSUM_BYTES) as u64, u64::saturating_add)
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

const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// Checksum of `bytes`.
pub fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(OFFSET, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(PRIME))
}

#[cfg(test)]
mod tests {
    use super::checksum;

    /// The values of the RFC's own test.
    #[test]
    fn known_sums() {
        assert_eq!(checksum(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(checksum(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(checksum(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
