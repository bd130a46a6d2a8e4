use canted_obb::Affine;

use crate::{MaterialId, UvSet};

/// Index of a mesh in [`crate::Scene::meshes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MeshId(pub u32);

/// Consecutive triangles that share a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// First triangle; the part ends where the next one starts.
    pub first_triangle: u32,
    /// Material of these triangles.
    pub material: MaterialId,
}

/// Vertices of a mesh that deforms while the shutter is open, as it closes. In between, everything is interpolated linearly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshClose {
    /// As [`Mesh::positions`], and as many.
    pub positions: Vec<[f32; 3]>,
    /// As [`Mesh::normals`].
    pub normals: Option<Vec<[f32; 3]>>,
    /// As [`Mesh::tangents`].
    pub tangents: Option<Vec<[f32; 4]>>,
}

/// An indexed triangle mesh in object space. Every index is in range and every referenced position is finite.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name from the file, used in messages.
    pub name: String,
    /// Vertex positions, object space.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices in file order, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals, one per position, of length 1 or 0 (0: use the geometric normal); `None` if the file has none.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Tangents of the normal map, one per position: a unit vector towards increasing `u`, and the sign of
    /// `normal × tangent` relative to increasing `v`. `None`, or zeros at a vertex: derive them from the texture coordinates.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// First texture coordinates, one per position, `v` up; kept only if a material uses them.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Second texture coordinates, like `uvs`.
    pub second_uvs: Option<Vec<[f32; 2]>>,
    /// Linear RGBA vertex colors, one per position, multiplied by the material's color and alpha.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Parts in ascending order; the first starts at triangle 0.
    pub parts: Vec<Part>,
    /// The vertices at shutter close of a mesh that deforms while the shutter is open; the lists above are those at shutter open.
    pub close: Option<MeshClose>,
}

impl Mesh {
    /// Texture coordinates of the given set.
    #[must_use]
    pub fn uv_set(&self, set: UvSet) -> Option<&[[f32; 2]]> {
        match set {
            UvSet::First => self.uvs.as_deref(),
            UvSet::Second => self.second_uvs.as_deref(),
        }
    }

    /// Positions referenced by triangles, each once; those at shutter close too.
    pub(crate) fn used_positions(&self) -> Vec<[f32; 3]> {
        let mut is_used = vec![false; self.positions.len()];
        for &index in self.triangles.iter().flatten() {
            is_used[index as usize] = true;
        }
        let close = self.close.as_ref().map(|close| &close.positions);
        let of_list = |list: &Vec<[f32; 3]>| {
            list.iter().zip(&is_used).filter_map(|(&position, &is_used)| is_used.then_some(position)).collect()
        };
        let mut used: Vec<[f32; 3]> = of_list(&self.positions);
        used.extend(close.map(of_list).unwrap_or_default());
        used
    }

    /// Material of the given triangle.
    #[must_use]
    pub fn material_of(&self, triangle: u32) -> MaterialId {
        let after = self.parts.partition_point(|part| part.first_triangle <= triangle);
        self.parts[after - 1].material
    }
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The instanced mesh.
    pub mesh: MeshId,
    /// Invertible affine transform; for a moving instance, the one at shutter open.
    pub world_from_object: Affine,
    /// Transform at shutter close for a moving instance. Matrix entries are interpolated linearly in between.
    pub world_from_object_close: Option<Affine>,
    /// Global number, in file order, of triangle 0 of this instance.
    pub first_primitive: u32,
}
