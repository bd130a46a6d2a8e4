use std::fmt;

use serde::de::{self, Deserialize, DeserializeSeed, Deserializer, MapAccess, Visitor};

use super::tables::Bounds;
use super::writer::{TomlWriter, number, numbers, quoted};
use crate::{AlphaMode, Encoding, Lobes, Material, TextureId, TextureRef};

/// Type of a material field, with its accessor.
#[derive(Clone, Copy)]
enum Field {
    Number(Bounds, fn(&mut Material) -> &mut f32),
    Color(Bounds, fn(&mut Material) -> &mut [f32; 3]),
    Flag(fn(&mut Material) -> &mut bool),
    AlphaMode,
    AlphaCutoff,
    Texture(Encoding, fn(&mut Material) -> &mut Option<TextureRef>),
}

/// All material keys in the order in which they are applied: key, field, comment.
const FIELDS: [(&str, Field, &str); 36] = [
    (
        "base_color",
        Field::Color(Bounds::Fraction, |m| &mut m.base_color),
        "diffuse reflectance, or reflectance at normal incidence of metals",
    ),
    ("metallic", Field::Number(Bounds::Fraction, |m| &mut m.metallic), "0 for dielectrics, 1 for metals"),
    ("roughness", Field::Number(Bounds::Fraction, |m| &mut m.roughness), "0 for smooth, 1 for rough"),
    ("specular", Field::Number(Bounds::Fraction, |m| &mut m.specular), "0 to 1; 0 for Lambertian"),
    ("transmission", Field::Number(Bounds::Fraction, |m| &mut m.transmission), "0 to 1; 1 for glass"),
    ("ior", Field::Number(Bounds::Ior, |m| &mut m.ior), "index of refraction, 1 to 1000"),
    ("thin_walled", Field::Flag(|m| &mut m.thin_walled), "thin sheet without refraction"),
    ("normal_scale", Field::Number(Bounds::Finite, |m| &mut m.normal_scale), "scale of the normal map"),
    ("emission", Field::Color(Bounds::NotNegative, |m| &mut m.emission), "radiance on both sides, W/(m2 sr)"),
    ("alpha", Field::Number(Bounds::Fraction, |m| &mut m.alpha), "0 to 1"),
    ("alpha_mode", Field::AlphaMode, "opaque, mask, blend"),
    ("alpha_cutoff", Field::AlphaCutoff, "for mask: smallest visible alpha"),
    ("double_sided", Field::Flag(|m| &mut m.double_sided), "whether the back is seen, too"),
    ("base_color_texture", Field::Texture(Encoding::Srgb, |m| &mut m.base_color_texture), ""),
    ("metallic_roughness_texture", Field::Texture(Encoding::Linear, |m| &mut m.metallic_roughness_texture), ""),
    ("transmission_texture", Field::Texture(Encoding::Linear, |m| &mut m.transmission_texture), ""),
    ("normal_texture", Field::Texture(Encoding::Linear, |m| &mut m.normal_texture), ""),
    ("emission_texture", Field::Texture(Encoding::Srgb, |m| &mut m.emission_texture), ""),
    ("alpha_texture", Field::Texture(Encoding::Srgb, |m| &mut m.alpha_texture), ""),
    (
        "specular_color",
        Field::Color(Bounds::NotNegative, |m| &mut m.lobes_mut().specular_color),
        "tint of the reflection of dielectrics",
    ),
    (
        "clearcoat",
        Field::Number(Bounds::Fraction, |m| &mut m.lobes_mut().clearcoat),
        "strength of a clear coat, 0 to 1",
    ),
    ("clearcoat_roughness", Field::Number(Bounds::Fraction, |m| &mut m.lobes_mut().clearcoat_roughness), "0 to 1"),
    (
        "sheen_color",
        Field::Color(Bounds::Fraction, |m| &mut m.lobes_mut().sheen_color),
        "color of the fibers of a cloth",
    ),
    ("sheen_roughness", Field::Number(Bounds::Fraction, |m| &mut m.lobes_mut().sheen_roughness), "0 to 1"),
    ("anisotropy", Field::Number(Bounds::Fraction, |m| &mut m.lobes_mut().anisotropy), "length of highlights, 0 to 1"),
    (
        "anisotropy_rotation",
        Field::Number(Bounds::Finite, |m| &mut m.lobes_mut().anisotropy_rotation),
        "from the tangent, counter-clockwise, radians",
    ),
    (
        "iridescence",
        Field::Number(Bounds::Fraction, |m| &mut m.lobes_mut().iridescence),
        "strength of a thin film, 0 to 1",
    ),
    ("iridescence_ior", Field::Number(Bounds::Ior, |m| &mut m.lobes_mut().iridescence_ior), "of the film, 1 to 1000"),
    (
        "iridescence_thickness",
        Field::Number(Bounds::NotNegative, |m| &mut m.lobes_mut().iridescence_thickness[1]),
        "of the film, nanometers",
    ),
    (
        "absorption",
        Field::Color(Bounds::NotNegative, |m| &mut m.lobes_mut().absorption),
        "inside a transmissive solid, per unit of length",
    ),
    ("hair", Field::Flag(|m| &mut m.hair_mut().is_on), "scattering of hair, on curves"),
    (
        "melanin",
        Field::Number(Bounds::NotNegative, |m| &mut m.hair_mut().melanin),
        "of hair: 0.3 blond, 1.3 brown, 8 black",
    ),
    (
        "pheomelanin",
        Field::Number(Bounds::NotNegative, |m| &mut m.hair_mut().pheomelanin),
        "of hair: makes it red; without both, base_color",
    ),
    ("hair_roughness", Field::Number(Bounds::Fraction, |m| &mut m.hair_mut().roughness), "along the hair, 0 to 1"),
    (
        "hair_roughness_around",
        Field::Number(Bounds::Fraction, |m| &mut m.hair_mut().roughness_around),
        "around the hair, 0 to 1",
    ),
    ("hair_tilt_degrees", Field::Number(Bounds::Finite, |m| &mut m.hair_mut().tilt_degrees), "angle of the scales"),
];

static ALPHA_MODES: [&str; 3] = ["opaque", "mask", "blend"];

/// Default alpha cutoff, as in glTF.
const ALPHA_CUTOFF: f32 = 0.5;

/// Value of a texture key that removes the texture.
const NO_TEXTURE: &str = "none";

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f32),
    Color([f32; 3]),
    Flag(bool),
    /// Index into [`ALPHA_MODES`].
    Mode(usize),
    /// An image file, or [`NO_TEXTURE`].
    Texture(String),
}

/// Changes to a material: the fields that a scene file sets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialEdits {
    /// Values by index into [`FIELDS`], ascending.
    values: Vec<(usize, Value)>,
}

impl MaterialEdits {
    /// Applies the changes to `material`; `load` loads a texture file.
    pub(super) fn apply<E>(
        &self,
        material: &mut Material,
        mut load: impl FnMut(&str, Encoding) -> Result<TextureId, E>,
    ) -> Result<(), E> {
        for (i, value) in &self.values {
            match (FIELDS[*i].1, value) {
                (Field::Number(_, get), Value::Number(x)) => *get(material) = *x,
                (Field::Color(_, get), Value::Color(color)) => *get(material) = *color,
                (Field::Flag(get), Value::Flag(flag)) => *get(material) = *flag,
                (Field::AlphaMode, Value::Mode(mode)) => material.alpha_mode = alpha_mode(*mode, material.alpha_mode),
                (Field::AlphaCutoff, Value::Number(new)) => {
                    if let AlphaMode::Mask { cutoff } = &mut material.alpha_mode {
                        *cutoff = *new;
                    }
                }
                (Field::Texture(encoding, get), Value::Texture(file)) => {
                    let texture = if file == NO_TEXTURE { None } else { Some(load(file, encoding)?) };
                    *get(material) = texture.map(TextureRef::new);
                }
                // `read` pairs each field with a value of its type.
                _ => {}
            }
        }
        material.lobes = material.lobes.take().filter(|lobes| **lobes != Lobes::default());
        material.hair = material.hair.take().filter(|hair| hair.is_on);
        Ok(())
    }

    /// These changes plus all other fields of `material` except textures.
    pub(super) fn explicit(&self, material: &Material) -> Self {
        let mut material = material.clone();
        let fields = FIELDS.into_iter().enumerate();
        let values = fields.filter_map(|(i, (_, field, _))| {
            let value = match field {
                Field::Number(_, get) => Value::Number(*get(&mut material)),
                Field::Color(_, get) => Value::Color(*get(&mut material)),
                Field::Flag(get) => Value::Flag(*get(&mut material)),
                Field::AlphaMode => Value::Mode(match material.alpha_mode {
                    AlphaMode::Opaque => 0,
                    AlphaMode::Mask { .. } => 1,
                    AlphaMode::Blend => 2,
                }),
                Field::AlphaCutoff => match material.alpha_mode {
                    AlphaMode::Mask { cutoff } => Value::Number(cutoff),
                    AlphaMode::Opaque | AlphaMode::Blend => Value::Number(ALPHA_CUTOFF),
                },
                Field::Texture(..) => self.values.iter().find(|(k, _)| *k == i)?.1.clone(),
            };
            Some((i, value))
        });
        Self { values: values.collect() }
    }

    /// These changes, completed by those of `earlier`.
    pub(super) fn or(mut self, earlier: &Self) -> Self {
        let more = earlier.values.iter().filter(|(i, _)| self.values.iter().all(|(k, _)| k != i)).cloned();
        let more: Vec<_> = more.collect();
        self.values.extend(more);
        self.values.sort_by_key(|(i, _)| *i);
        self
    }

    /// Whether a texture is set.
    pub(super) fn adds_texture(&self) -> bool {
        self.values.iter().any(|(_, value)| matches!(value, Value::Texture(file) if file != NO_TEXTURE))
    }

    /// All texture file names.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        self.values.iter_mut().filter_map(|(_, value)| match value {
            Value::Texture(file) if file != NO_TEXTURE => Some(file),
            _ => None,
        })
    }

    /// Writes one line per field.
    pub(super) fn write(&self, out: &mut TomlWriter) {
        for (i, value) in &self.values {
            let (key, _, comment) = FIELDS[*i];
            let text = match value {
                Value::Number(x) => number(*x),
                Value::Color(color) => numbers(color),
                Value::Flag(flag) => flag.to_string(),
                Value::Mode(mode) => quoted(ALPHA_MODES[*mode]),
                Value::Texture(file) => quoted(file),
            };
            out.entry(key, &text, comment);
        }
    }
}

/// The alpha mode with index `mode`; a mask keeps its cutoff.
fn alpha_mode(mode: usize, before: AlphaMode) -> AlphaMode {
    match (mode, before) {
        (0, _) => AlphaMode::Opaque,
        (1, AlphaMode::Mask { cutoff }) => AlphaMode::Mask { cutoff },
        (1, _) => AlphaMode::Mask { cutoff: ALPHA_CUTOFF },
        _ => AlphaMode::Blend,
    }
}

/// A table of `[[materials]]` or `[[overrides]]`: the fields that it sets, and names.
#[derive(Default)]
pub(super) struct MaterialTable<const IS_NEW: bool> {
    pub(super) name: Option<String>,
    pub(super) asset: Option<String>,
    pub(super) material: Option<String>,
    pub(super) edits: MaterialEdits,
}

impl<const IS_NEW: bool> MaterialTable<IS_NEW> {
    const NAMES: &'static [&'static str] = if IS_NEW { &["name"] } else { &["asset", "material"] };
}

impl<'de, const IS_NEW: bool> Deserialize<'de> for MaterialTable<IS_NEW> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(TableVisitor::<IS_NEW>)
    }
}

struct TableVisitor<const IS_NEW: bool>;

impl<'de, const IS_NEW: bool> Visitor<'de> for TableVisitor<IS_NEW> {
    type Value = MaterialTable<IS_NEW>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut table = MaterialTable::default();
        while let Some(key) = map.next_key::<String>()? {
            if MaterialTable::<IS_NEW>::NAMES.contains(&&key[..]) {
                let value = Some(map.next_value()?);
                *match &key[..] {
                    "name" => &mut table.name,
                    "asset" => &mut table.asset,
                    _ => &mut table.material,
                } = value;
                continue;
            }
            let Some(i) = FIELDS.iter().position(|(known, ..)| *known == key) else {
                return Err(de::Error::unknown_field(&key, known_keys(IS_NEW)));
            };
            table.edits.values.push((i, map.next_value_seed(FIELDS[i].1)?));
        }
        table.edits.values.sort_by_key(|(i, _)| *i);
        Ok(table)
    }
}

/// All keys of a table with material fields.
fn known_keys(is_new: bool) -> &'static [&'static str] {
    static KEYS: std::sync::LazyLock<[Vec<&str>; 2]> = std::sync::LazyLock::new(|| {
        [MaterialTable::<false>::NAMES, MaterialTable::<true>::NAMES]
            .map(|names| names.iter().copied().chain(FIELDS.map(|(key, ..)| key)).collect())
    });
    &KEYS[usize::from(is_new)]
}

impl<'de> DeserializeSeed<'de> for Field {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        Ok(match self {
            Self::Number(bounds, _) => Value::Number(bounds.read(deserializer)?),
            Self::Color(bounds, _) => Value::Color(bounds.read(deserializer)?),
            Self::Flag(_) => Value::Flag(bool::deserialize(deserializer)?),
            Self::AlphaMode => {
                let name = String::deserialize(deserializer)?;
                let mode = ALPHA_MODES.iter().position(|known| *known == name);
                Value::Mode(mode.ok_or_else(|| de::Error::unknown_variant(&name, &ALPHA_MODES))?)
            }
            Self::AlphaCutoff => Value::Number(Bounds::NotNegative.read(deserializer)?),
            Self::Texture(..) => Value::Texture(String::deserialize(deserializer)?),
        })
    }
}
