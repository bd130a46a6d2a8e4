//! Primitives: triangles with the vertices they use (glTF 2.0, section 3.7.2).

use gltf::json::Index;
use gltf::json::accessor::Type;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, INDICES, REALS};
use super::attributes::Attributes;
use super::document::Document;
use super::matrix::Matrix;
use super::pose::{MorphedAttribute, Pose, Skinning};
use super::topology;
use crate::read::ReadError;
use crate::read::mesh_checks::MeshChecks;
use crate::{Material, UvSet};

/// Triangles and vertices of a primitive.
#[derive(Default)]
pub(super) struct PrimitiveMesh {
    /// Indices into the lists below.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) tangents: Option<Vec<[f32; 4]>>,
    pub(super) uvs: Option<Vec<[f32; 2]>>,
    pub(super) second_uvs: Option<Vec<[f32; 2]>>,
    pub(super) colors: Option<Vec<[f32; 4]>>,
}

/// The skinning transform of a vertex, if any.
pub(super) type VertexTransform<'a> = dyn Fn(usize) -> Result<Option<Matrix>, ReadError> + 'a;

/// Context for reading a primitive.
pub(super) struct PrimitiveReader<'a, 'b> {
    pub(super) document: &'a Document<'b>,
    pub(super) pose: &'a Pose<'a>,
    pub(super) material: &'a Material,
    /// Index of the mesh, and of the primitive in it.
    pub(super) mesh: usize,
    pub(super) number: usize,
    /// `mesh 3 primitive 0`.
    pub(super) location: &'a str,
}

impl PrimitiveReader<'_, '_> {
    /// Reads a primitive. Primitives without triangles give an empty mesh and a warning.
    pub(super) fn read(
        &self,
        primitive: &Primitive,
        checks: &mut MeshChecks,
        warnings: &mut Vec<String>,
    ) -> Result<PrimitiveMesh, ReadError> {
        let location = self.location;
        self.check_compression(primitive)?;
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(position) = find(Semantic::Positions) else {
            warnings.push(format!("skipping {location}: missing POSITION"));
            return Ok(PrimitiveMesh::default());
        };
        let at = format!("{location} POSITION");
        let base = Accessor::open(self.document, position, &at, Type::Vec3, REALS)?;
        let positions = MorphedAttribute::open(self, primitive, base, |target| target.positions, &at)?;
        let Some(triangles) = self.triangles(primitive, positions.count(), warnings)? else {
            return Ok(PrimitiveMesh::default());
        };
        let skinning = self
            .pose
            .world_from_bind
            .as_deref()
            .map(|joints| Skinning::open(self.document, primitive, joints, positions.count(), location))
            .transpose()?;
        let transform = |vertex: usize| {
            let world_from_bind = skinning.as_ref().map(|skinning| skinning.at(vertex)).transpose();
            world_from_bind.map_err(|joint| {
                self.document.malformed(location, format!("joint {joint} of vertex {vertex} is not in the skin"))
            })
        };

        let (primitive_mesh, vertices) = self.compact(triangles, &positions, &transform, checks)?;
        if let Some(skinning) = &skinning {
            checks.n_unweighted_vertices += vertices.iter().filter(|&&vertex| skinning.has_zero_weight(vertex)).count();
        }
        let mut attributes = Attributes {
            reader: self,
            primitive,
            n_all: positions.count(),
            vertices: &vertices,
            triangles: &primitive_mesh.triangles,
            warnings,
        };
        Ok(PrimitiveMesh {
            normals: attributes.normals(&transform)?,
            tangents: attributes.tangents(&transform)?,
            uvs: attributes.uvs(UvSet::First)?,
            second_uvs: attributes.uvs(UvSet::Second)?,
            colors: attributes.colors()?,
            ..primitive_mesh
        })
    }

    /// Rejects compressed geometry, which the file may not declare as required. Accessors without data would be zeros.
    fn check_compression(&self, primitive: &Primitive) -> Result<(), ReadError> {
        const DRACO: &str = "KHR_draco_mesh_compression";
        let is_compressed = primitive.extensions.as_ref().is_some_and(|all| all.others.contains_key(DRACO));
        let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions)).copied();
        let mut accessors = position.into_iter().chain(primitive.indices);
        let has_no_data = |index: Index<_>| {
            let accessor = self.document.root.accessors.get(index.value());
            accessor.is_some_and(|accessor| accessor.buffer_view.is_none() && accessor.sparse.is_none())
        };
        if is_compressed && accessors.any(has_no_data) {
            let what = format!("Draco compression ({DRACO}, {})", self.location);
            return Err(ReadError::unsupported(self.document.path(), what));
        }
        Ok(())
    }

    /// Triangles with indices below `n_vertices`; `None` with a warning for points and lines.
    fn triangles(
        &self,
        primitive: &Primitive,
        n_vertices: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Vec<[u32; 3]>>, ReadError> {
        let (document, location) = (self.document, self.location);
        let Checked::Valid(mode) = primitive.mode else {
            return Err(document.malformed(location, "unknown mode"));
        };
        let corners: Vec<u32> = match primitive.indices {
            Some(index) => {
                let indices =
                    Accessor::open(document, index.value(), &format!("{location} indices"), Type::Scalar, INDICES)?;
                (0..indices.count).map(|k| indices.integers::<1>(k)[0]).collect()
            }
            None => (0..n_vertices)
                .map(u32::try_from)
                .collect::<Result<_, _>>()
                .map_err(|_| document.malformed(location, format!("{n_vertices} vertices (limit: 2^32)")))?,
        };
        if let Some((k, index)) = corners.iter().enumerate().find(|&(_, &index)| index as usize >= n_vertices) {
            return Err(
                document.malformed(location, format!("index {k} is {index}, out of range ({n_vertices} vertices)"))
            );
        }
        let Some((triangles, n_unused)) = topology::triangles(mode, &corners) else {
            warnings.push(format!("skipping {location}: points and lines are not supported"));
            return Ok(None);
        };
        if n_unused > 0 {
            warnings.push(format!("ignoring {n_unused} trailing indices of {location}"));
        }
        Ok(Some(triangles))
    }

    /// Rejects a pose that makes a vertex infinite or NaN; `posed` are the vertices from `first` on.
    fn check_pose(
        &self,
        triangles: &[[u32; 3]],
        positions: &MorphedAttribute<'_>,
        first: u32,
        posed: &[[f32; 3]],
    ) -> Result<(), ReadError> {
        let is_lost = |&&corner: &&u32| {
            let is_finite = |position: [f32; 3]| position.iter().all(|x| x.is_finite());
            !is_finite(posed[(corner - first) as usize]) && is_finite(positions.base.reals(corner as usize))
        };
        let lost = triangles.as_flattened().iter().filter(is_lost).min();
        lost.map_or(Ok(()), |&vertex| {
            let name = format!("primitive {} vertex {vertex}", self.number);
            Err(self.document.not_finite(self.mesh, name, posed[(vertex - first) as usize]))
        })
    }

    /// Deforms the vertices, drops non-finite triangles and unused vertices. Vertices keep the order of the file.
    ///
    /// Primitives may share one large vertex list, so only the range from the smallest to the largest index is processed.
    /// Also returns the indices of the used vertices in the file.
    #[expect(clippy::cast_possible_truncation, reason = "positions are rounded to f32; vertex numbers are below 2^32")]
    fn compact(
        &self,
        mut triangles: Vec<[u32; 3]>,
        positions: &MorphedAttribute<'_>,
        transform: &VertexTransform<'_>,
        checks: &mut MeshChecks,
    ) -> Result<(PrimitiveMesh, Vec<usize>), ReadError> {
        let corners = triangles.as_flattened();
        let (Some(&min_index), Some(&max_index)) = (corners.iter().min(), corners.iter().max()) else {
            return Ok((PrimitiveMesh::default(), Vec::new()));
        };
        let position = |vertex: u32| {
            let position = positions.at(vertex as usize);
            Ok(transform(vertex as usize)?.map_or(position, |transform| transform.point(position)).map(|x| x as f32))
        };
        let all = (min_index..=max_index).map(position).collect::<Result<Vec<[f32; 3]>, ReadError>>()?;
        if self.document.requires_finite {
            self.check_pose(&triangles, positions, min_index, &all)?;
        }
        triangles.retain(|triangle| checks.keeps(triangle.map(|corner| all[(corner - min_index) as usize])));

        let mut renumbered = vec![u32::MAX; all.len()];
        triangles.as_flattened().iter().for_each(|&corner| renumbered[(corner - min_index) as usize] = 0);
        let (mut kept, mut vertices) = (Vec::new(), Vec::new());
        for (k, number) in renumbered.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
            *number = kept.len() as u32;
            kept.push(all[k]);
            vertices.push(min_index as usize + k);
        }
        triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = renumbered[(*corner - min_index) as usize]);
        Ok((PrimitiveMesh { triangles, positions: kept, ..PrimitiveMesh::default() }, vertices))
    }
}
