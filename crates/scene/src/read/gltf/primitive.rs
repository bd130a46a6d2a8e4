//! One primitive of a glTF mesh: triangles with the vertices that they use (glTF 2.0, section 3.7.2).

use gltf::json::accessor::Type;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, INDICES, REALS};
use super::document::Document;
use super::material::UvSource;
use super::matrix::{Matrix, unit};
use super::pose::{Morphed, Pose, Skinning};
use super::topology;
use crate::read::ReadError;
use crate::read::repair::Repair;

/// What a primitive adds to its mesh.
#[derive(Default)]
pub(super) struct Patch {
    /// Corners, as indices into the lists below.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) uvs: Option<Vec<[f32; 2]>>,
}

/// What a primitive is read with.
pub(super) struct Reading<'a, 'b> {
    pub(super) document: &'a Document<'b>,
    pub(super) pose: &'a Pose<'a>,
    /// Where the texture coordinates come from; `None` where the material needs none.
    pub(super) uv_source: Option<&'a UvSource>,
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
        let weights = self.pose.weights;
        let at = format!("{place} POSITION");
        let positions = Morphed::open(self.document, primitive, position, weights, |target| target.positions, &at)?;
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

        let (mut patch, vertices) = self.compact(triangles, &positions, &bend, repair)?;
        if let Some(index) = find(Semantic::Normals) {
            let at = format!("{place} NORMAL");
            let normals = Morphed::open(self.document, primitive, index, weights, |target| target.normals, &at)?;
            self.check_count(normals.count(), positions.count(), "NORMAL")?;
            let normal = |&vertex: &usize| {
                let normal = normals.at(vertex);
                Ok(unit(bend(vertex)?.map_or(normal, |bend| bend.normal(normal))).unwrap_or_default())
            };
            patch.normals = Some(vertices.iter().map(normal).collect::<Result<_, ReadError>>()?);
        }
        if let Some(source) = self.uv_source {
            let Some(index) = find(Semantic::TexCoords(source.set)) else {
                warnings.push(format!("{place} has no TEXCOORD_{}, its texture shows one texel", source.set));
                patch.uvs = Some(vec![source.apply([0.0; 2]); vertices.len()]);
                return Ok(patch);
            };
            let uvs = Accessor::open(self.document, index, &format!("{place} TEXCOORD"), Type::Vec2, REALS)?;
            self.check_count(uvs.count, positions.count(), "TEXCOORD")?;
            patch.uvs = Some(vertices.iter().map(|&vertex| source.apply(uvs.reals(vertex))).collect());
        }
        Ok(patch)
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
        bend: &impl Fn(usize) -> Result<Option<Matrix>, ReadError>,
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

    fn check_count(&self, count: usize, n_vertices: usize, attribute: &str) -> Result<(), ReadError> {
        if count == n_vertices {
            return Ok(());
        }
        Err(self.document.malformed(self.place, format!("has {count} {attribute} for {n_vertices} vertices")))
    }
}
