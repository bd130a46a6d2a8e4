//! What the vertices of a primitive carry beside their positions, as far as its material needs it.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, REALS};
use super::matrix::unit;
use super::pose::Morphed;
use super::primitive::{Bend, Reading};
use crate::UvSet;
use crate::read::ReadError;
use crate::read::repair::usable_uv;

/// Components of colours: the integers are normalised ones.
const COLORS: &[ComponentType] = &[ComponentType::F32, ComponentType::U8, ComponentType::U16];

/// The attributes of the vertices that are kept.
pub(super) struct Attributes<'a> {
    pub(super) reading: &'a Reading<'a, 'a>,
    pub(super) primitive: &'a Primitive,
    /// Number of vertices in the file.
    pub(super) n_all: usize,
    /// The file's numbers of those that are kept.
    pub(super) vertices: &'a [usize],
    pub(super) warnings: &'a mut Vec<String>,
}

impl Attributes<'_> {
    /// Unit normals, or zero.
    pub(super) fn normals(&self, bend: &Bend<'_>) -> Result<Option<Vec<[f32; 3]>>, ReadError> {
        let Some(index) = self.find(Semantic::Normals) else { return Ok(None) };
        let (reading, place) = (self.reading, self.place("NORMAL"));
        let base = Accessor::open(reading.document, index, &place, Type::Vec3, REALS)?;
        let normals = Morphed::open(reading, self.primitive, base, |target| target.normals, &place)?;
        self.check_count(normals.count(), "NORMAL")?;
        let normal = |&vertex: &usize| {
            let normal = normals.at(vertex);
            Ok(unit(bend(vertex)?.map_or(normal, |bend| bend.normal(normal))).unwrap_or_default())
        };
        self.vertices.iter().map(normal).collect::<Result<_, _>>().map(Some)
    }

    /// Unit tangents and their sign, or zeros, where a normal map asks for them.
    pub(super) fn tangents(&self, bend: &Bend<'_>) -> Result<Option<Vec<[f32; 4]>>, ReadError> {
        let is_used = self.reading.material.normal_texture.is_some();
        let Some(index) = self.find(Semantic::Tangents).filter(|_| is_used) else { return Ok(None) };
        let (reading, place) = (self.reading, self.place("TANGENT"));
        let base = Accessor::open(reading.document, index, &place, Type::Vec4, REALS)?;
        let tangents = Morphed::open(reading, self.primitive, base, |target| target.tangents, &place)?;
        self.check_count(tangents.count(), "TANGENT")?;
        let tangent = |&vertex: &usize| {
            let (along, bend) = (tangents.at(vertex), bend(vertex)?);
            let Some([x, y, z]) = unit(bend.as_ref().map_or(along, |bend| bend.vector(along))) else {
                return Ok([0.0; 4]);
            };
            let [.., sign]: [f32; 4] = tangents.base.reals(vertex);
            // The cross product of normal and tangent turns over in a mirror, and the direction of growing v does not.
            let is_mirrored = bend.is_some_and(|bend| bend.sign() < 0.0);
            Ok([x, y, z, if (sign < 0.0) == is_mirrored { 1.0 } else { -1.0 }])
        };
        self.vertices.iter().map(tangent).collect::<Result<_, _>>().map(Some)
    }

    /// Coordinates of a set, `v` up, where a texture is looked up by them; at the origin where the file has none.
    pub(super) fn uvs(&mut self, set: UvSet) -> Result<Option<Vec<[f32; 2]>>, ReadError> {
        if !self.reading.material.textures().any(|texture| texture.uv_set == set) {
            return Ok(None);
        }
        let number = match set {
            UvSet::First => 0,
            UvSet::Second => 1,
        };
        let name = format!("TEXCOORD_{number}");
        let Some(index) = self.find(Semantic::TexCoords(number)) else {
            self.warnings.push(format!("{} has no {name}, its texture shows one texel", self.reading.place));
            return Ok(Some(vec![[0.0, 1.0]; self.vertices.len()]));
        };
        let uvs = Accessor::open(self.reading.document, index, &self.place(&name), Type::Vec2, REALS)?;
        self.check_count(uvs.count, &name)?;
        let uv = |&vertex: &usize| {
            let [u, v] = uvs.reals(vertex);
            usable_uv([u, 1.0 - v])
        };
        Ok(Some(self.vertices.iter().map(uv).collect()))
    }

    /// Colours and alpha in 0..=1; none where all are white.
    pub(super) fn colors(&self) -> Result<Option<Vec<[f32; 4]>>, ReadError> {
        let Some(index) = self.find(Semantic::Colors(0)) else { return Ok(None) };
        let (document, place) = (self.reading.document, self.place("COLOR_0"));
        let source = document.get(&document.root.accessors, index, "accessor", &place)?;
        let has_alpha = source.type_ == Checked::Valid(Type::Vec4);
        let element = if has_alpha { Type::Vec4 } else { Type::Vec3 };
        let colors = Accessor::open(document, index, &place, element, COLORS)?;
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

    fn place(&self, attribute: &str) -> String {
        format!("{} {attribute}", self.reading.place)
    }

    fn check_count(&self, count: usize, attribute: &str) -> Result<(), ReadError> {
        if count == self.n_all {
            return Ok(());
        }
        let message = format!("has {count} {attribute} for {} vertices", self.n_all);
        Err(self.reading.document.malformed(self.reading.place, message))
    }
}

/// A number clamped to 0..=1; NaN becomes 0.
#[expect(clippy::manual_clamp, reason = "clamp keeps a NaN")]
pub(super) fn fraction(x: f32) -> f32 {
    x.max(0.0).min(1.0)
}
