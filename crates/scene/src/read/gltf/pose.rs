//! Vertex deformation: morph targets and skins.

use gltf::json::Index;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, INDICES, REALS};
use super::document::Document;
use super::matrix::Matrix;
use super::nodes::Nodes;
use super::primitive::PrimitiveReader;
use crate::read::ReadError;

/// Deformation of a mesh.
#[derive(Default)]
pub(super) struct Pose<'a> {
    /// Morph target weights; missing ones are zero.
    pub(super) weights: &'a [f32],
    /// Joint transforms from bind pose to world; `None` without a skin.
    pub(super) world_from_bind: Option<Vec<Matrix>>,
}

/// Joint transforms of a skin from bind pose to world.
pub(super) fn joints(
    document: &Document<'_>,
    nodes: &Nodes,
    skin_index: usize,
    location: &str,
) -> Result<Vec<Matrix>, ReadError> {
    let skin = document.get(&document.root.skins, skin_index, "skin", location)?;
    let location = format!("skin {skin_index}");
    let inverse_binds = skin
        .inverse_bind_matrices
        .map(|index| Accessor::open(document, index.value(), &location, Type::Mat4, &[ComponentType::F32]))
        .transpose()?;
    if let Some(short) = inverse_binds.as_ref().filter(|matrices| matrices.count < skin.joints.len()) {
        return Err(document
            .malformed(location, format!("{} inverse bind matrices for {} joints", short.count, skin.joints.len())));
    }
    let matrix = |(k, joint): (usize, &Index<_>)| {
        let world_from_joint = document.get(&nodes.world_from_node, joint.value(), "node", &location)?;
        let Some(matrices) = &inverse_binds else { return Ok(*world_from_joint) };
        let joint_from_bind = Matrix::from_4x4(&matrices.reals(k))
            .ok_or_else(|| document.malformed(&location, format!("the last row of matrix {k} is not 0 0 0 1")))?;
        Ok(world_from_joint.after(&joint_from_bind))
    };
    skin.joints.iter().enumerate().map(matrix).collect()
}

/// Positions, normals or tangents with morph targets.
pub(super) struct MorphedAttribute<'a> {
    /// Values without morph targets; the first three components are morphed.
    pub(super) base: Accessor<'a>,
    targets: Vec<(f64, Accessor<'a>)>,
}

impl<'a> MorphedAttribute<'a> {
    /// Opens the accessors that `target_of` selects in targets of nonzero weight.
    pub(super) fn open(
        reader: &PrimitiveReader<'a, 'a>,
        primitive: &Primitive,
        base: Accessor<'a>,
        target_of: fn(&MorphTarget) -> Option<Index<gltf::json::Accessor>>,
        location: &str,
    ) -> Result<Self, ReadError> {
        let mut targets = Vec::new();
        for (target, &weight) in primitive.targets.iter().flatten().zip(reader.pose.weights) {
            let Some(index) = target_of(target).filter(|_| weight != 0.0) else { continue };
            let offsets = Accessor::open(reader.document, index.value(), location, Type::Vec3, REALS)?;
            if offsets.count != base.count {
                let message = format!("morph target has {} elements, expected {}", offsets.count, base.count);
                return Err(reader.document.malformed(location, message));
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

/// Joints and weights of the vertices of a primitive.
pub(super) struct Skinning<'a> {
    /// Joint indices and weights, four per set.
    sets: Vec<(Accessor<'a>, Accessor<'a>)>,
    world_from_bind: &'a [Matrix],
}

impl<'a> Skinning<'a> {
    /// Opens the sets of joints and weights; at least one is required.
    pub(super) fn open(
        document: &'a Document<'_>,
        primitive: &Primitive,
        world_from_bind: &'a [Matrix],
        count: usize,
        location: &str,
    ) -> Result<Self, ReadError> {
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let mut sets = Vec::new();
        for set in 0.. {
            let (Some(joints), Some(weights)) = (find(Semantic::Joints(set)), find(Semantic::Weights(set))) else {
                break;
            };
            let joints = Accessor::open(document, joints, &format!("{location} JOINTS_{set}"), Type::Vec4, INDICES)?;
            let weights = Accessor::open(document, weights, &format!("{location} WEIGHTS_{set}"), Type::Vec4, REALS)?;
            if joints.count != count || weights.count != count {
                return Err(document.malformed(location, format!("joints or weights do not match {count} vertices")));
            }
            sets.push((joints, weights));
        }
        if sets.is_empty() {
            return Err(document.malformed(location, "a skinned primitive needs joints and weights"));
        }
        Ok(Self { sets, world_from_bind })
    }

    /// The weighted mean of the joint transforms of a vertex. `Err` with an invalid joint index.
    ///
    /// Weights are normalized, as integer weights rarely sum to one. A vertex with zero weights follows the first joint, so that
    /// it stays with the mesh.
    pub(super) fn at(&self, vertex: usize) -> Result<Matrix, u32> {
        let mut sum = Matrix { columns: [[0.0; 3]; 4] };
        let mut total = 0.0;
        for (joints, weights) in &self.sets {
            let joints: [u32; 4] = joints.integers(vertex);
            let weights: [f32; 4] = weights.reals(vertex);
            for (joint, weight) in joints.into_iter().zip(weights.map(f64::from)).filter(|&(_, weight)| weight != 0.0) {
                let world_from_bind = self.world_from_bind.get(joint as usize).ok_or(joint)?;
                sum = sum.add_scaled(weight, world_from_bind);
                total += weight;
            }
        }
        if total == 0.0 {
            return self.world_from_bind.first().copied().ok_or(0);
        }
        Ok(Matrix { columns: sum.columns.map(|column| column.map(|x| x / total)) })
    }

    /// Whether the weights of a vertex sum to zero.
    pub(super) fn has_zero_weight(&self, vertex: usize) -> bool {
        self.sets.iter().flat_map(|(_, weights)| weights.reals::<4>(vertex)).map(f64::from).sum::<f64>() == 0.0
    }
}
