//! Posed vertices: morph targets by their weights, skins by where their joints stand.

use gltf::json::Index;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, INDICES, REALS};
use super::document::Document;
use super::matrix::Matrix;
use super::nodes::Nodes;
use super::primitive::Reading;
use crate::read::ReadError;

/// How a mesh is bent before it is placed.
#[derive(Default)]
pub(super) struct Pose<'a> {
    /// Weights of the morph targets; missing ones are zero.
    pub(super) weights: &'a [f32],
    /// Transforms of the joints from the bind pose to the world; `None` for a mesh without a skin.
    pub(super) world_from_bind: Option<Vec<Matrix>>,
}

/// Transforms of the joints of a skin from the bind pose to the world.
pub(super) fn joints(
    document: &Document<'_>,
    nodes: &Nodes,
    skin_index: usize,
    place: &str,
) -> Result<Vec<Matrix>, ReadError> {
    let skin = document.get(&document.root.skins, skin_index, "skin", place)?;
    let place = format!("skin {skin_index}");
    let inverse_binds = skin
        .inverse_bind_matrices
        .map(|index| Accessor::open(document, index.value(), &place, Type::Mat4, &[ComponentType::F32]))
        .transpose()?;
    if let Some(short) = inverse_binds.as_ref().filter(|matrices| matrices.count < skin.joints.len()) {
        return Err(document.malformed(place, format!("has {} matrices for {} joints", short.count, skin.joints.len())));
    }
    let matrix = |(k, joint): (usize, &Index<_>)| {
        let world_from_joint = document.get(&nodes.world_from_node, joint.value(), "node", &place)?;
        let Some(matrices) = &inverse_binds else { return Ok(*world_from_joint) };
        let joint_from_bind = Matrix::from_4x4(&matrices.reals(k))
            .ok_or_else(|| document.malformed(&place, format!("matrix {k} has a last row that is not 0 0 0 1")))?;
        Ok(world_from_joint.after(&joint_from_bind))
    };
    skin.joints.iter().enumerate().map(matrix).collect()
}

/// Positions, normals or tangents with what morph targets add to them.
pub(super) struct Morphed<'a> {
    /// What the file has without its targets; three numbers of an element are morphed.
    pub(super) base: Accessor<'a>,
    targets: Vec<(f64, Accessor<'a>)>,
}

impl<'a> Morphed<'a> {
    /// Opens the accessors that `target_of` finds in the targets of weight other than zero.
    pub(super) fn open(
        reading: &Reading<'a, 'a>,
        primitive: &Primitive,
        base: Accessor<'a>,
        target_of: fn(&MorphTarget) -> Option<Index<gltf::json::Accessor>>,
        place: &str,
    ) -> Result<Self, ReadError> {
        let mut targets = Vec::new();
        for (target, &weight) in primitive.targets.iter().flatten().zip(reading.pose.weights) {
            let Some(index) = target_of(target).filter(|_| weight != 0.0) else { continue };
            let offsets = Accessor::open(reading.document, index.value(), place, Type::Vec3, REALS)?;
            if offsets.count != base.count {
                let message = format!("has a morph target of {} elements for {}", offsets.count, base.count);
                return Err(reading.document.malformed(place, message));
            }
            targets.push((f64::from(weight), offsets));
        }
        Ok(Self { base, targets })
    }

    /// Number of vertices.
    pub(super) fn count(&self) -> usize {
        self.base.count
    }

    /// The value at a vertex.
    pub(super) fn at(&self, vertex: usize) -> [f64; 3] {
        let mut value = self.base.reals(vertex).map(f64::from);
        for (weight, offsets) in &self.targets {
            let offset: [f32; 3] = offsets.reals(vertex);
            for (sum, x) in value.iter_mut().zip(offset) {
                *sum += weight * f64::from(x);
            }
        }
        value
    }
}

/// The joints that move each vertex of a primitive.
pub(super) struct Skinning<'a> {
    /// Joint numbers and weights, four a set.
    sets: Vec<(Accessor<'a>, Accessor<'a>)>,
    world_from_bind: &'a [Matrix],
}

impl<'a> Skinning<'a> {
    /// Opens the sets of joints and weights, of which there must be one at least.
    pub(super) fn open(
        document: &'a Document<'_>,
        primitive: &Primitive,
        world_from_bind: &'a [Matrix],
        count: usize,
        place: &str,
    ) -> Result<Self, ReadError> {
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let mut sets = Vec::new();
        for set in 0.. {
            let (Some(joints), Some(weights)) = (find(Semantic::Joints(set)), find(Semantic::Weights(set))) else {
                break;
            };
            let joints = Accessor::open(document, joints, &format!("{place} JOINTS_{set}"), Type::Vec4, INDICES)?;
            let weights = Accessor::open(document, weights, &format!("{place} WEIGHTS_{set}"), Type::Vec4, REALS)?;
            if joints.count != count || weights.count != count {
                return Err(document.malformed(place, format!("has joints or weights for other than {count} vertices")));
            }
            sets.push((joints, weights));
        }
        if sets.is_empty() {
            return Err(document.malformed(place, "has a skin but no joints and weights"));
        }
        Ok(Self { sets, world_from_bind })
    }

    /// Transform of a vertex: the mean of its joints' transforms by weight. `Err` with the number of a missing joint.
    ///
    /// Weights are divided by their sum, as bytes rarely add up to one. A vertex whose weights add up to zero follows the
    /// skin's first joint, so that it stays with the rest of the skin wherever that is taken.
    pub(super) fn at(&self, vertex: usize) -> Result<Matrix, u32> {
        let mut sum = Matrix { columns: [[0.0; 3]; 4] };
        let mut total = 0.0;
        for (joints, weights) in &self.sets {
            let joints: [u32; 4] = joints.integers(vertex);
            let weights: [f32; 4] = weights.reals(vertex);
            for (joint, weight) in joints.into_iter().zip(weights.map(f64::from)).filter(|&(_, weight)| weight != 0.0) {
                let world_from_bind = self.world_from_bind.get(joint as usize).ok_or(joint)?;
                sum = sum.plus(weight, world_from_bind);
                total += weight;
            }
        }
        if total == 0.0 {
            return self.world_from_bind.first().copied().ok_or(0);
        }
        Ok(Matrix { columns: sum.columns.map(|column| column.map(|x| x / total)) })
    }

    /// Whether no joint has a hold on a vertex.
    pub(super) fn is_loose(&self, vertex: usize) -> bool {
        self.sets.iter().flat_map(|(_, weights)| weights.reals::<4>(vertex)).map(f64::from).sum::<f64>() == 0.0
    }
}
