//! Vertex attributes other than positions, as far as the material uses them.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, REALS};
use super::matrix::unit;
use super::normals;
use super::pose::MorphedAttribute;
use super::primitive::{PrimitiveReader, VertexTransform};
use crate::read::ReadError;
use crate::read::mesh_checks::usable_uv;
use crate::{Material, UvSet};

/// Component types of colors; integers are normalized.
const COLORS: &[ComponentType] = &[ComponentType::F32, ComponentType::U8, ComponentType::U16];

/// Attributes of the used vertices of a primitive.
pub(super) struct Attributes<'a> {
    pub(super) reader: &'a PrimitiveReader<'a, 'a>,
    pub(super) primitive: &'a Primitive,
    /// Number of vertices in the file, including unused ones.
    pub(super) n_all: usize,
    /// Indices of the used vertices in the file.
    pub(super) vertices: &'a [usize],
    /// Indices of that list.
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) warnings: &'a mut Vec<String>,
}

impl Attributes<'_> {
    /// Unit or zero normals.
    pub(super) fn normals(&self, transform: &VertexTransform<'_>) -> Result<Option<Vec<[f32; 3]>>, ReadError> {
        let Some(index) = self.find(Semantic::Normals) else { return Ok(None) };
        let (reader, location) = (self.reader, self.location("NORMAL"));
        let base = Accessor::open(reader.document, index, &location, Type::Vec3, REALS)?;
        let normals = MorphedAttribute::open(reader, self.primitive, base, |target| target.normals, &location)?;
        self.check_count(normals.count(), "NORMAL")?;
        let positions = self.find(Semantic::Positions).unwrap_or_default();
        let changes =
            normals::changes(reader, self.primitive, positions, &normals.base, self.triangles, self.vertices)?;
        let normal = |(k, &vertex): (usize, &usize)| {
            let mut normal = normals.at(vertex);
            if let Some(changes) = &changes {
                normal = std::array::from_fn(|axis| normal[axis] + changes[k][axis]);
            }
            Ok(unit(transform(vertex)?.map_or(normal, |transform| transform.normal(normal))).unwrap_or_default())
        };
        self.vertices.iter().enumerate().map(normal).collect::<Result<_, _>>().map(Some)
    }

    /// Unit tangents with sign, or zeros, if the material has a normal map or is anisotropic.
    pub(super) fn tangents(&self, transform: &VertexTransform<'_>) -> Result<Option<Vec<[f32; 4]>>, ReadError> {
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
    pub(super) fn uvs(&mut self, set: UvSet) -> Result<Option<Vec<[f32; 2]>>, ReadError> {
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
            self.warnings
                .push(format!("missing {name}, using a single texel of the texture: {}", self.reader.location));
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
    pub(super) fn colors(&self) -> Result<Option<Vec<[f32; 4]>>, ReadError> {
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

/// `x` clamped to 0..=1; NaN becomes 0.
#[expect(clippy::manual_clamp, reason = "clamp keeps a NaN")]
pub(super) fn fraction(x: f32) -> f32 {
    x.max(0.0).min(1.0)
}

/// Whether highlights depend on tangents.
fn is_anisotropic(material: &Material) -> bool {
    material.lobes.as_ref().is_some_and(|lobes| lobes.anisotropy > 0.0)
}
