use super::page::{Page, number, numbers, quoted};
use super::table::{Bounds, Table};
use crate::{AlphaMode, Encoding, Material, ReadError, TextureId, TextureRef};

/// What a key of a material changes.
#[derive(Clone, Copy)]
enum Part {
    Number(Bounds, fn(&mut Material) -> &mut f32),
    Color(Bounds, fn(&mut Material) -> &mut [f32; 3]),
    Flag(fn(&mut Material) -> &mut bool),
    AlphaMode,
    AlphaCutoff,
    Texture(Encoding, fn(&mut Material) -> &mut Option<TextureRef>),
}

/// All keys of a material in the order in which they take effect, each with what it means.
const FIELDS: [(&str, Part, &str); 18] = [
    ("base_color", Part::Color(Bounds::Fraction, |m| &mut m.base_color), "diffuse, of metals at normal incidence"),
    ("metallic", Part::Number(Bounds::Fraction, |m| &mut m.metallic), "0 for bodies, 1 for metals"),
    ("roughness", Part::Number(Bounds::Fraction, |m| &mut m.roughness), "0 for polished, 1 for rough"),
    ("specular", Part::Number(Bounds::Fraction, |m| &mut m.specular), "0 to 1; 0 makes bodies Lambert"),
    ("transmission", Part::Number(Bounds::Fraction, |m| &mut m.transmission), "0 to 1; 1 for glass"),
    ("ior", Part::Number(Bounds::Ior, |m| &mut m.ior), "index of refraction, 1 to 1000"),
    ("thin_walled", Part::Flag(|m| &mut m.thin_walled), "a sheet, which light passes straight"),
    ("normal_scale", Part::Number(Bounds::Finite, |m| &mut m.normal_scale), "of the texture of normals"),
    ("emission", Part::Color(Bounds::NotNegative, |m| &mut m.emission), "radiance on both sides, W/(m2 sr)"),
    ("alpha", Part::Number(Bounds::Fraction, |m| &mut m.alpha), "0 to 1"),
    ("alpha_mode", Part::AlphaMode, "opaque, mask, blend"),
    ("alpha_cutoff", Part::AlphaCutoff, "of a mask: least alpha of what is there"),
    ("base_color_texture", Part::Texture(Encoding::Srgb, |m| &mut m.base_color_texture), ""),
    ("metallic_roughness_texture", Part::Texture(Encoding::Linear, |m| &mut m.metallic_roughness_texture), ""),
    ("transmission_texture", Part::Texture(Encoding::Linear, |m| &mut m.transmission_texture), ""),
    ("normal_texture", Part::Texture(Encoding::Linear, |m| &mut m.normal_texture), ""),
    ("emission_texture", Part::Texture(Encoding::Srgb, |m| &mut m.emission_texture), ""),
    ("alpha_texture", Part::Texture(Encoding::Srgb, |m| &mut m.alpha_texture), ""),
];

const ALPHA_MODES: [&str; 3] = ["opaque", "mask", "blend"];

/// Least alpha of a mask where nothing is said, that of glTF.
const ALPHA_CUTOFF: f32 = 0.5;

/// Says that there is no texture, where a file would be named.
const NO_TEXTURE: &str = "none";

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f32),
    Color([f32; 3]),
    Flag(bool),
    /// An alpha mode, by its position among them.
    Mode(usize),
    /// An image file, or [`NO_TEXTURE`].
    Texture(String),
}

/// Changes of a material: what a scene file says of it, and nothing else.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialEdits {
    /// The value of a field, by its position among them, ascending.
    values: Vec<(usize, Value)>,
}

impl MaterialEdits {
    /// Reads the fields of a table that may hold `other` keys too.
    pub(super) fn read(table: &Table<'_>, other: &[&str]) -> Result<Self, ReadError> {
        let known: Vec<&str> = other.iter().copied().chain(FIELDS.map(|(key, ..)| key)).collect();
        table.only(&known)?;
        let mut values = Vec::new();
        for (i, (key, part, _)) in FIELDS.into_iter().enumerate() {
            let value = match part {
                Part::Number(bounds, _) => table.number(key, bounds)?.map(Value::Number),
                Part::Color(bounds, _) => table.numbers(key, bounds)?.map(Value::Color),
                Part::Flag(_) => table.flag(key)?.map(Value::Flag),
                Part::AlphaMode => table.choice(key, &ALPHA_MODES)?.map(Value::Mode),
                Part::AlphaCutoff => table.number(key, Bounds::NotNegative)?.map(Value::Number),
                Part::Texture(..) => table.text(key)?.map(|file| Value::Texture(file.to_owned())),
            };
            values.extend(value.map(|value| (i, value)));
        }
        Ok(Self { values })
    }

    /// Changes `material`; `load` turns the name of an image into a texture.
    pub(super) fn apply<E>(
        &self,
        material: &mut Material,
        mut load: impl FnMut(&str, Encoding) -> Result<TextureId, E>,
    ) -> Result<(), E> {
        for (i, value) in &self.values {
            match (FIELDS[*i].1, value) {
                (Part::Number(_, get), Value::Number(x)) => *get(material) = *x,
                (Part::Color(_, get), Value::Color(color)) => *get(material) = *color,
                (Part::Flag(get), Value::Flag(flag)) => *get(material) = *flag,
                (Part::AlphaMode, Value::Mode(mode)) => material.alpha_mode = alpha_mode(*mode, material.alpha_mode),
                (Part::AlphaCutoff, Value::Number(new)) => {
                    if let AlphaMode::Mask { cutoff } = &mut material.alpha_mode {
                        *cutoff = *new;
                    }
                }
                (Part::Texture(encoding, get), Value::Texture(file)) => {
                    let texture = if file == NO_TEXTURE { None } else { Some(load(file, encoding)?) };
                    *get(material) = texture.map(TextureRef::new);
                }
                // Reading pairs each field with values of its own kind.
                _ => {}
            }
        }
        Ok(())
    }

    /// The same changes, and every other field as `material` has it; textures stay unsaid where they were.
    pub(super) fn spelled_out(&self, material: &Material) -> Self {
        let mut material = material.clone();
        let fields = FIELDS.into_iter().enumerate();
        let values = fields.filter_map(|(i, (_, part, _))| {
            let value = match part {
                Part::Number(_, get) => Value::Number(*get(&mut material)),
                Part::Color(_, get) => Value::Color(*get(&mut material)),
                Part::Flag(get) => Value::Flag(*get(&mut material)),
                Part::AlphaMode => Value::Mode(match material.alpha_mode {
                    AlphaMode::Opaque => 0,
                    AlphaMode::Mask { .. } => 1,
                    AlphaMode::Blend => 2,
                }),
                Part::AlphaCutoff => match material.alpha_mode {
                    AlphaMode::Mask { cutoff } => Value::Number(cutoff),
                    AlphaMode::Opaque | AlphaMode::Blend => Value::Number(ALPHA_CUTOFF),
                },
                Part::Texture(..) => self.values.iter().find(|(k, _)| *k == i)?.1.clone(),
            };
            Some((i, value))
        });
        Self { values: values.collect() }
    }

    /// These changes, and those of `earlier` for what these do not say.
    pub(super) fn or(mut self, earlier: &Self) -> Self {
        let more = earlier.values.iter().filter(|(i, _)| self.values.iter().all(|(k, _)| k != i)).cloned();
        let more: Vec<_> = more.collect();
        self.values.extend(more);
        self.values.sort_by_key(|(i, _)| *i);
        self
    }

    /// Whether a texture is put on.
    pub(super) fn adds_texture(&self) -> bool {
        self.values.iter().any(|(_, value)| matches!(value, Value::Texture(file) if file != NO_TEXTURE))
    }

    /// The image files named, to be changed.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        self.values.iter_mut().filter_map(|(_, value)| match value {
            Value::Texture(file) if file != NO_TEXTURE => Some(file),
            _ => None,
        })
    }

    /// Writes a line a field.
    pub(super) fn write(&self, page: &mut Page) {
        for (i, value) in &self.values {
            let (key, _, comment) = FIELDS[*i];
            let text = match value {
                Value::Number(x) => number(*x),
                Value::Color(color) => numbers(color),
                Value::Flag(flag) => flag.to_string(),
                Value::Mode(mode) => quoted(ALPHA_MODES[*mode]),
                Value::Texture(file) => quoted(file),
            };
            page.line(key, &text, comment);
        }
    }
}

/// The alpha mode at a position among their names; a mask keeps its cutoff.
fn alpha_mode(mode: usize, before: AlphaMode) -> AlphaMode {
    match (mode, before) {
        (0, _) => AlphaMode::Opaque,
        (1, AlphaMode::Mask { cutoff }) => AlphaMode::Mask { cutoff },
        (1, _) => AlphaMode::Mask { cutoff: ALPHA_CUTOFF },
        _ => AlphaMode::Blend,
    }
}
