use canted_obb::Affine;

use crate::{MaterialId, UvSet};

/// Index of a mesh in [`crate::Scene::meshes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MeshId(pub u32);

/// A run of consecutive triangles of one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// First triangle of the run; it ends where the next part begins.
    pub first_triangle: u32,
    /// Material of the run.
    pub material: MaterialId,
}

/// Indexed triangles in object space. Every index is in range and every used position finite.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, for messages.
    pub name: String,
    /// Vertex positions, object space.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise seen from the front, in file order.
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals, one per position, unit or zero (zero: use the geometric one); `None` where the file has none.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Directions of growing `u` of the normal map, one per position: unit vectors, and the sign by which
    /// `normal × tangent` becomes the direction of growing `v`; `None`, or zeros at a vertex, where they follow from the
    /// texture coordinates.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// First texture coordinates, one per position, `v` up; kept only where a material needs them.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Second texture coordinates, likewise.
    pub second_uvs: Option<Vec<[f32; 2]>>,
    /// Colours and alpha that multiply those of the material, one per position, linear.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Material runs; the first starts at triangle 0.
    pub parts: Vec<Part>,
}

impl Mesh {
    /// Texture coordinates of a set.
    #[must_use]
    pub fn uv_set(&self, set: UvSet) -> Option<&[[f32; 2]]> {
        match set {
            UvSet::First => self.uvs.as_deref(),
            UvSet::Second => self.second_uvs.as_deref(),
        }
    }

    /// Positions of the vertices that triangles use, each once.
    pub(crate) fn used_positions(&self) -> Vec<[f32; 3]> {
        let mut is_used = vec![false; self.positions.len()];
        for &index in self.triangles.iter().flatten() {
            is_used[index as usize] = true;
        }
        self.positions.iter().zip(is_used).filter_map(|(&position, is_used)| is_used.then_some(position)).collect()
    }

    /// Material of a triangle.
    #[must_use]
    pub fn material_of(&self, triangle: u32) -> MaterialId {
        let after = self.parts.partition_point(|part| part.first_triangle <= triangle);
        self.parts[after - 1].material
    }
}

/// A placed mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The mesh placed.
    pub mesh: MeshId,
    /// Invertible affine transform; of a moving one, as the shutter opens.
    pub world_from_object: Affine,
    /// Of a moving one, the transform as the shutter closes; each number of it changes in a straight line meanwhile.
    pub world_from_object_close: Option<Affine>,
    /// Number, in file order, of the mesh's triangle 0 in this instance.
    pub first_primitive: u32,
}
