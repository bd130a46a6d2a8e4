//! One primitive of a glTF mesh: triangles with the vertices that they use (glTF 2.0, section 3.7.2).

use gltf::json::accessor::Type;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, INDICES, REALS};
use super::attributes::Attributes;
use super::document::Document;
use super::matrix::Matrix;
use super::pose::{Morphed, Pose, Skinning};
use super::topology;
use crate::read::ReadError;
use crate::read::repair::Repair;
use crate::{Material, UvSet};

/// What a primitive adds to its mesh.
#[derive(Default)]
pub(super) struct Patch {
    /// Corners, as indices into the lists below.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) tangents: Option<Vec<[f32; 4]>>,
    pub(super) uvs: Option<Vec<[f32; 2]>>,
    pub(super) second_uvs: Option<Vec<[f32; 2]>>,
    pub(super) colors: Option<Vec<[f32; 4]>>,
}

/// How a vertex of a number is moved, where it is in a skin.
pub(super) type Bend<'a> = dyn Fn(usize) -> Result<Option<Matrix>, ReadError> + 'a;

/// What a primitive is read with.
pub(super) struct Reading<'a, 'b> {
    pub(super) document: &'a Document<'b>,
    pub(super) pose: &'a Pose<'a>,
    pub(super) material: &'a Material,
    /// `mesh 3 primitive 0`.
    pub(super) place: &'a str,
}

impl Reading<'_, '_> {
    /// Reads a primitive. One that is not made of triangles gives an empty patch and a warning.
    pub(super) fn read(
        &self,
        primitive: &Primitive,
        repair: &mut Repair,
        warnings: &mut Vec<String>,
    ) -> Result<Patch, ReadError> {
        let place = self.place;
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(position) = find(Semantic::Positions) else {
            warnings.push(format!("{place} has no POSITION and is left out"));
            return Ok(Patch::default());
        };
        let at = format!("{place} POSITION");
        let base = Accessor::open(self.document, position, &at, Type::Vec3, REALS)?;
        let positions = Morphed::open(self, primitive, base, |target| target.positions, &at)?;
        let Some(triangles) = self.triangles(primitive, positions.count(), warnings)? else {
            return Ok(Patch::default());
        };
        let skinning = self
            .pose
            .world_from_bind
            .as_deref()
            .map(|joints| Skinning::open(self.document, primitive, joints, positions.count(), place))
            .transpose()?;
        let bend = |vertex: usize| {
            let world_from_bind = skinning.as_ref().map(|skinning| skinning.at(vertex)).transpose();
            world_from_bind.map_err(|joint| {
                self.document.malformed(place, format!("vertex {vertex} names joint {joint}, which its skin lacks"))
            })
        };

        let (patch, vertices) = self.compact(triangles, &positions, &bend, repair)?;
        if let Some(skinning) = &skinning {
            repair.n_loose_vertices += vertices.iter().filter(|&&vertex| skinning.is_loose(vertex)).count();
        }
        let mut attributes =
            Attributes { reading: self, primitive, n_all: positions.count(), vertices: &vertices, warnings };
        Ok(Patch {
            normals: attributes.normals(&bend)?,
            tangents: attributes.tangents(&bend)?,
            uvs: attributes.uvs(UvSet::First)?,
            second_uvs: attributes.uvs(UvSet::Second)?,
            colors: attributes.colors()?,
            ..patch
        })
    }

    /// Triangles as indices below `n_vertices`; `None`, with a warning, for points and lines.
    fn triangles(
        &self,
        primitive: &Primitive,
        n_vertices: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Vec<[u32; 3]>>, ReadError> {
        let (document, place) = (self.document, self.place);
        let Checked::Valid(mode) = primitive.mode else {
            return Err(document.malformed(place, "has an unknown mode"));
        };
        let corners: Vec<u32> = match primitive.indices {
            Some(index) => {
                let indices =
                    Accessor::open(document, index.value(), &format!("{place} indices"), Type::Scalar, INDICES)?;
                (0..indices.count).map(|k| indices.integers::<1>(k)[0]).collect()
            }
            None => (0..n_vertices).map(u32::try_from).collect::<Result<_, _>>().map_err(|_| {
                document.malformed(place, format!("has {n_vertices} vertices, more than 32 bits count"))
            })?,
        };
        if let Some((k, index)) = corners.iter().enumerate().find(|&(_, &index)| index as usize >= n_vertices) {
            return Err(document.malformed(place, format!("index {k} names vertex {index} of {n_vertices}")));
        }
        let Some((triangles, n_left_over)) = topology::triangles(mode, &corners) else {
            warnings.push(format!("{place} is made of points or lines and is left out"));
            return Ok(None);
        };
        if n_left_over > 0 {
            warnings.push(format!("{place} has {n_left_over} indices that make no triangle"));
        }
        Ok(Some(triangles))
    }

    /// Bends the vertices, drops triangles that are not finite, and keeps the vertices that are used, in file order.
    ///
    /// Files share one large list of vertices among many primitives, so only what lies between the least and the
    /// greatest index is ever held. Returns the file's numbers of the kept vertices beside the patch.
    #[expect(clippy::cast_possible_truncation, reason = "positions are rounded to f32; vertex numbers are below 2^32")]
    fn compact(
        &self,
        mut triangles: Vec<[u32; 3]>,
        positions: &Morphed<'_>,
        bend: &Bend<'_>,
        repair: &mut Repair,
    ) -> Result<(Patch, Vec<usize>), ReadError> {
        let corners = triangles.as_flattened();
        let (Some(&least), Some(&greatest)) = (corners.iter().min(), corners.iter().max()) else {
            return Ok((Patch::default(), Vec::new()));
        };
        let position = |vertex: u32| {
            let position = positions.at(vertex as usize);
            Ok(bend(vertex as usize)?.map_or(position, |bend| bend.point(position)).map(|x| x as f32))
        };
        let all = (least..=greatest).map(position).collect::<Result<Vec<[f32; 3]>, ReadError>>()?;
        triangles.retain(|triangle| repair.keeps(triangle.map(|corner| all[(corner - least) as usize])));

        let mut renumbered = vec![u32::MAX; all.len()];
        triangles.as_flattened().iter().for_each(|&corner| renumbered[(corner - least) as usize] = 0);
        let (mut kept, mut vertices) = (Vec::new(), Vec::new());
        for (k, number) in renumbered.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
            *number = kept.len() as u32;
            kept.push(all[k]);
            vertices.push(least as usize + k);
        }
        triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = renumbered[(*corner - least) as usize]);
        Ok((Patch { triangles, positions: kept, ..Patch::default() }, vertices))
    }
}
