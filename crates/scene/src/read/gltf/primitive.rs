//! Primitives: triangles with the vertices they use (glTF 2.0, section 3.7.2), their attributes as far as the material uses them, and their
//! deformation by morph targets and skins.

use std::collections::HashMap;

use canted_obb::vector::{add, cross, length, sub};
use gltf::json::Index;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, INDICES, REALS};
use super::document::{DRACO, Document};
use super::material::fraction;
use super::nodes::{Matrix, Nodes};
use crate::read::error::ReadError;
use crate::read::mesh::{MeshChecks, unit, usable_uv};
use crate::{Material, Mesh, UvSet};

/// The skinning transform of a vertex, if any.
type VertexTransform<'a> = dyn Fn(usize) -> Result<Option<Matrix>, ReadError> + 'a;

/// What is skipped or replaced, and where.
pub(super) type Warnings = Vec<(String, String)>;

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
    /// Reads a primitive as a mesh without name and parts. Primitives without triangles give an empty mesh and a warning.
    pub(super) fn read(
        &self,
        primitive: &Primitive,
        checks: &mut MeshChecks,
        warnings: &mut Warnings,
    ) -> Result<Mesh, ReadError> {
        let location = self.location;
        // With the feature there are none left.
        if self.document.needs_draco(primitive) {
            let what = format!("Draco compression ({DRACO}, {location}; built without the feature 'draco')");
            return Err(ReadError::unsupported(self.document.path(), what));
        }
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(position) = find(Semantic::Positions) else {
            warnings.push(("skipping primitives without POSITION".to_owned(), location.to_owned()));
            return Ok(Mesh::default());
        };
        let at = format!("{location} POSITION");
        let base = Accessor::open(self.document, position, &at, Type::Vec3, REALS)?;
        let positions = MorphedAttribute::open(self, primitive, base, |target| target.positions, &at)?;
        let Some(triangles) = self.triangles(primitive, positions.count(), warnings)? else {
            return Ok(Mesh::default());
        };
        let skinning = self.skinning(primitive, positions.count())?;
        let transform = |vertex: usize| self.skinned(skinning.as_ref(), vertex);

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
        Ok(Mesh {
            normals: attributes.normals(&transform)?,
            tangents: attributes.tangents(&transform)?,
            uvs: attributes.uvs(UvSet::First)?,
            second_uvs: attributes.uvs(UvSet::Second)?,
            colors: attributes.colors()?,
            ..primitive_mesh
        })
    }

    /// Triangles with indices below `n_vertices`; `None` with a warning for points and lines.
    fn triangles(
        &self,
        primitive: &Primitive,
        n_vertices: usize,
        warnings: &mut Warnings,
    ) -> Result<Option<Vec<[u32; 3]>>, ReadError> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(self.document.malformed(self.location, "unknown mode"));
        };
        let Some((triangles, n_unused)) = triangles(mode, &self.corners(primitive, n_vertices)?) else {
            warnings.push(("skipping points and lines (not supported)".to_owned(), self.location.to_owned()));
            return Ok(None);
        };
        if n_unused > 0 {
            warnings.push((format!("ignoring {n_unused} trailing indices"), self.location.to_owned()));
        }
        Ok(Some(triangles))
    }

    /// The vertices in the order of the primitive, all of them below `n_vertices`.
    fn corners(&self, primitive: &Primitive, n_vertices: usize) -> Result<Vec<u32>, ReadError> {
        let (document, location) = (self.document, self.location);
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
        Ok(corners)
    }

    /// The joints and weights of a primitive of a skinned node.
    fn skinning(&self, primitive: &Primitive, n_vertices: usize) -> Result<Option<Skinning<'_>>, ReadError> {
        let joints = self.pose.world_from_bind.as_deref();
        joints.map(|joints| Skinning::open(self.document, primitive, joints, n_vertices, self.location)).transpose()
    }

    /// The skinning transform of a vertex.
    fn skinned(&self, skinning: Option<&Skinning<'_>>, vertex: usize) -> Result<Option<Matrix>, ReadError> {
        skinning.map(|skinning| skinning.at(vertex)).transpose().map_err(|joint| {
            self.document.malformed(self.location, format!("joint {joint} of vertex {vertex} is not in the skin"))
        })
    }

    /// Positions and colors in the order of the primitive: what lines and points are made of. At most `n_max` of them.
    pub(super) fn polyline(&self, primitive: &Primitive, n_max: usize) -> Result<(Vec<[f64; 3]>, Colors), ReadError> {
        let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions)).map(|index| index.value());
        let Some(position) = position else { return Ok((Vec::new(), None)) };
        let at = format!("{} POSITION", self.location);
        let base = Accessor::open(self.document, position, &at, Type::Vec3, REALS)?;
        let positions = MorphedAttribute::open(self, primitive, base, |target| target.positions, &at)?;
        let skinning = self.skinning(primitive, positions.count())?;
        let corners = self.corners(primitive, positions.count())?;
        if corners.len() > n_max {
            let message = format!("{} vertices of lines exceed what the file can hold", corners.len());
            return Err(self.document.malformed(self.location, message));
        }
        let vertices: Vec<usize> = corners.into_iter().map(|corner| corner as usize).collect();
        let posed = |&vertex: &usize| {
            let position = positions.at(vertex);
            Ok(self.skinned(skinning.as_ref(), vertex)?.map_or(position, |transform| transform.point(position)))
        };
        let n_all = positions.count();
        let (triangles, warnings) = (&[][..], &mut Warnings::new());
        let attributes = Attributes { reader: self, primitive, n_all, vertices: &vertices, triangles, warnings };
        Ok((vertices.iter().map(posed).collect::<Result<_, _>>()?, attributes.colors()?))
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
    fn compact(
        &self,
        mut triangles: Vec<[u32; 3]>,
        positions: &MorphedAttribute<'_>,
        transform: &VertexTransform<'_>,
        checks: &mut MeshChecks,
    ) -> Result<(Mesh, Vec<usize>), ReadError> {
        let corners = triangles.as_flattened();
        let (Some(&min_index), Some(&max_index)) = (corners.iter().min(), corners.iter().max()) else {
            return Ok((Mesh::default(), Vec::new()));
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
        Ok((Mesh { triangles, positions: kept, ..Mesh::default() }, vertices))
    }
}

/// Triangles with consistent winding, and the number of unused corners; `None` for points and lines.
///
/// As in the specification, every second triangle of a strip swaps its last two corners, and the first corner of a fan is the
/// last of each triangle.
fn triangles(mode: Mode, corners: &[u32]) -> Option<(Vec<[u32; 3]>, usize)> {
    let n = corners.len();
    match mode {
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => None,
        Mode::Triangles => {
            let (triangles, rest) = corners.as_chunks();
            Some((triangles.to_vec(), rest.len()))
        }
        Mode::TriangleStrip | Mode::TriangleFan if n < 3 => Some((Vec::new(), n)),
        Mode::TriangleStrip => {
            let triangle = |i: usize| [corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]];
            Some(((0..n - 2).map(triangle).collect(), 0))
        }
        Mode::TriangleFan => {
            let triangle = |i: usize| [corners[i + 1], corners[i + 2], corners[0]];
            Some(((0..n - 2).map(triangle).collect(), 0))
        }
    }
}

/// RGBA colors, if not all are white.
pub(super) type Colors = Option<Vec<[f32; 4]>>;

/// Component types of colors; integers are normalized.
const COLORS: &[ComponentType] = &[ComponentType::F32, ComponentType::U8, ComponentType::U16];

/// Attributes of the used vertices of a primitive.
struct Attributes<'a> {
    reader: &'a PrimitiveReader<'a, 'a>,
    primitive: &'a Primitive,
    /// Number of vertices in the file, including unused ones.
    n_all: usize,
    /// Indices of the used vertices in the file.
    vertices: &'a [usize],
    /// Indices of that list.
    triangles: &'a [[u32; 3]],
    warnings: &'a mut Warnings,
}

impl Attributes<'_> {
    /// Unit or zero normals.
    fn normals(&self, transform: &VertexTransform<'_>) -> Result<Option<Vec<[f32; 3]>>, ReadError> {
        let Some(index) = self.find(Semantic::Normals) else { return Ok(None) };
        let (reader, location) = (self.reader, self.location("NORMAL"));
        let base = Accessor::open(reader.document, index, &location, Type::Vec3, REALS)?;
        let normals = MorphedAttribute::open(reader, self.primitive, base, |target| target.normals, &location)?;
        self.check_count(normals.count(), "NORMAL")?;
        let positions = self.find(Semantic::Positions).unwrap_or_default();
        let changes = normal_changes(reader, self.primitive, positions, &normals.base, self.triangles, self.vertices)?;
        let normal = |(k, &vertex): (usize, &usize)| {
            let mut normal = normals.at(vertex);
            if let Some(changes) = &changes {
                normal = add(normal, changes[k]);
            }
            Ok(unit(transform(vertex)?.map_or(normal, |transform| transform.normal(normal))).unwrap_or_default())
        };
        self.vertices.iter().enumerate().map(normal).collect::<Result<_, _>>().map(Some)
    }

    /// Unit tangents with sign, or zeros, if the material has a normal map or is anisotropic.
    fn tangents(&self, transform: &VertexTransform<'_>) -> Result<Option<Vec<[f32; 4]>>, ReadError> {
        let material = self.reader.material;
        let is_used = material.normal_texture.is_some() || is_anisotropic(material);
        let Some(index) = self.find(Semantic::Tangents).filter(|_| is_used) else { return Ok(None) };
        let (reader, location) = (self.reader, self.location("TANGENT"));
        let base = Accessor::open(reader.document, index, &location, Type::Vec4, REALS)?;
        let tangents = MorphedAttribute::open(reader, self.primitive, base, |target| target.tangents, &location)?;
        self.check_count(tangents.count(), "TANGENT")?;
        let tangent = |&vertex: &usize| {
            let (along, transform) = (tangents.at(vertex), transform(vertex)?);
            let Some([x, y, z]) = unit(transform.as_ref().map_or(along, |transform| transform.vector(along))) else {
                return Ok([0.0; 4]);
            };
            let [.., sign]: [f32; 4] = tangents.base.reals(vertex);
            // A mirroring transform flips the cross product of normal and tangent, but not the direction of increasing v.
            let is_mirrored = transform.is_some_and(|transform| transform.sign() < 0.0);
            Ok([x, y, z, if (sign < 0.0) == is_mirrored { 1.0 } else { -1.0 }])
        };
        self.vertices.iter().map(tangent).collect::<Result<_, _>>().map(Some)
    }

    /// Texture coordinates of a set, `v` up, if a texture uses them; glTF (0, 0) if the file has none.
    fn uvs(&mut self, set: UvSet) -> Result<Option<Vec<[f32; 2]>>, ReadError> {
        let material = self.reader.material;
        // Where the file has no tangents, anisotropy needs texture coordinates, if there are any.
        let is_along = set == UvSet::First && is_anisotropic(material) && self.find(Semantic::TexCoords(0)).is_some();
        if !is_along && !material.textures().any(|texture| texture.uv_set == set) {
            return Ok(None);
        }
        let number = match set {
            UvSet::First => 0,
            UvSet::Second => 1,
        };
        let name = format!("TEXCOORD_{number}");
        let Some(index) = self.find(Semantic::TexCoords(number)) else {
            let what = format!("missing {name}, using a single texel of the texture");
            self.warnings.push((what, self.reader.location.to_owned()));
            return Ok(Some(vec![[0.0, 1.0]; self.vertices.len()]));
        };
        let uvs = Accessor::open(self.reader.document, index, &self.location(&name), Type::Vec2, REALS)?;
        self.check_count(uvs.count, &name)?;
        let uv = |&vertex: &usize| {
            let [u, v] = uvs.reals(vertex);
            usable_uv([u, 1.0 - v])
        };
        Ok(Some(self.vertices.iter().map(uv).collect()))
    }

    /// RGBA colors in 0..=1; `None` if all are white.
    fn colors(&self) -> Result<Colors, ReadError> {
        let Some(index) = self.find(Semantic::Colors(0)) else { return Ok(None) };
        let (document, location) = (self.reader.document, self.location("COLOR_0"));
        let source = document.get(&document.root.accessors, index, "accessor", &location)?;
        let has_alpha = source.type_ == Checked::Valid(Type::Vec4);
        let element = if has_alpha { Type::Vec4 } else { Type::Vec3 };
        let colors = Accessor::open(document, index, &location, element, COLORS)?;
        self.check_count(colors.count, "COLOR_0")?;
        let color = |&vertex: &usize| {
            let color: [f32; 4] = if has_alpha {
                colors.reals(vertex)
            } else {
                let [red, green, blue] = colors.reals(vertex);
                [red, green, blue, 1.0]
            };
            color.map(fraction)
        };
        let colors: Vec<_> = self.vertices.iter().map(color).collect();
        Ok(colors.iter().any(|color| *color != [1.0; 4]).then_some(colors))
    }

    fn find(&self, semantic: Semantic) -> Option<usize> {
        self.primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value())
    }

    fn location(&self, attribute: &str) -> String {
        format!("{} {attribute}", self.reader.location)
    }

    fn check_count(&self, count: usize, attribute: &str) -> Result<(), ReadError> {
        if count == self.n_all {
            return Ok(());
        }
        let message = format!("{count} {attribute} values for {} vertices", self.n_all);
        Err(self.reader.document.malformed(self.reader.location, message))
    }
}

/// Whether highlights depend on tangents.
fn is_anisotropic(material: &Material) -> bool {
    material.lobes.as_ref().is_some_and(|lobes| lobes.anisotropy > 0.0)
}

/// The changes of the normals of morphed vertices whose targets store none: the file's own hold for the unmorphed shape only.
///
/// The change of a vertex normal is that of the mean normal of the triangles around the vertex, weighted by area, between the
/// unmorphed positions and those with the targets that store no normals. It is added to the file's normal, as the offsets of a
/// target are: a small weight changes normals little, and what the file says about the unmorphed shape stays. Vertices with
/// equal position and normal count as one, so that seams of texture coordinates do not become creases; creases stay creases.
///
/// `vertices` are numbers in the file; `triangles` are indices of that list. `None` where all
/// targets of nonzero weight store normals.
fn normal_changes(
    reader: &PrimitiveReader<'_, '_>,
    primitive: &Primitive,
    positions: usize,
    normals: &Accessor<'_>,
    triangles: &[[u32; 3]],
    vertices: &[usize],
) -> Result<Option<Vec<[f64; 3]>>, ReadError> {
    let lacks_normals = |target: &MorphTarget| -> Option<Index<gltf::json::Accessor>> {
        target.positions.filter(|_| target.normals.is_none())
    };
    let mut active = primitive.targets.iter().flatten().zip(reader.pose.weights);
    if !active.any(|(target, &weight)| weight != 0.0 && lacks_normals(target).is_some()) {
        return Ok(None);
    }
    let location = format!("{} POSITION", reader.location);
    let base = Accessor::open(reader.document, positions, &location, Type::Vec3, REALS)?;
    let morphed = MorphedAttribute::open(reader, primitive, base, lacks_normals, &location)?;
    let (before, after): (Vec<[f64; 3]>, Vec<[f64; 3]>) =
        vertices.iter().map(|&vertex| (morphed.base.reals(vertex).map(f64::from), morphed.at(vertex))).unzip();
    let mut numbers = HashMap::new();
    let groups: Vec<usize> = (vertices.iter().zip(&before))
        .map(|(&vertex, position)| {
            let normal: [f32; 3] = normals.reals(vertex);
            // Adding zero makes -0.0 positive.
            let key = (position.map(|x| (x + 0.0).to_bits()), normal.map(|x| (x + 0.0).to_bits()));
            let next = numbers.len();
            *numbers.entry(key).or_insert(next)
        })
        .collect();
    let means = |positions: &[[f64; 3]]| mean_normals(positions, triangles, &groups, numbers.len());
    let of_groups: Vec<[f64; 3]> = means(&before).into_iter().zip(means(&after)).map(change).collect();
    Ok(Some(groups.into_iter().map(|group| of_groups[group]).collect()))
}

/// The difference of two unit normals; zero where one has no direction.
fn change((before, after): ([f64; 3], [f64; 3])) -> [f64; 3] {
    let (a, b) = (length(before), length(after));
    if !(a > 0.0 && b > 0.0 && a.is_finite() && b.is_finite()) {
        return [0.0; 3];
    }
    sub(after.map(|x| x / b), before.map(|x| x / a))
}

/// Sums of the normals of the triangles around each group of vertices, as long as twice the area.
fn mean_normals(positions: &[[f64; 3]], triangles: &[[u32; 3]], groups: &[usize], n_groups: usize) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; n_groups];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let normal = cross(sub(b, a), sub(c, a));
        for &corner in triangle {
            let sum = &mut sums[groups[corner as usize]];
            *sum = add(*sum, normal);
        }
    }
    sums
}

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
struct MorphedAttribute<'a> {
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
struct Skinning<'a> {
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
    fn has_zero_weight(&self, vertex: usize) -> bool {
        self.sets.iter().flat_map(|(_, weights)| weights.reals::<4>(vertex)).map(f64::from).sum::<f64>() == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_of_a_convex_polygon_have_equal_winding() {
        // All signed areas must be positive.
        let at = |k: u32| (f64::from(k) * std::f64::consts::TAU / 7.0).sin_cos();
        let doubled_area = |[a, b, c]: [u32; 3]| {
            let ((ay, ax), (by, bx), (cy, cx)) = (at(a), at(b), at(c));
            (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        };
        let total = |triangles: Vec<[u32; 3]>| {
            assert!(triangles.iter().all(|&triangle| doubled_area(triangle) > 0.0));
            triangles.into_iter().map(doubled_area).sum::<f64>()
        };
        let (fan, _) = triangles(Mode::TriangleFan, &[0, 1, 2, 3, 4, 5, 6]).unwrap();
        let (strip, _) = triangles(Mode::TriangleStrip, &[0, 1, 6, 2, 5, 3, 4]).unwrap();
        let n_roundings = 100.0 * f64::EPSILON;
        assert!((total(fan) - total(strip)).abs() < n_roundings);
    }

    #[test]
    fn fewer_than_three_corners_make_no_triangle() {
        for mode in [Mode::TriangleStrip, Mode::TriangleFan] {
            for n in 0..3 {
                assert_eq!(triangles(mode, &[0, 1][..n.min(2)]).unwrap(), (vec![], n.min(2)));
            }
        }
        assert!(triangles(Mode::Lines, &[0, 1, 2]).is_none());
    }
}
