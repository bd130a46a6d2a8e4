//! MTL material libraries, with the PBR keys `Pr`, `Pm` and `norm`. Other keys that affect rendering are reported as
//! unsupported; hints and rasterizer settings are ignored.

mod map;

use std::collections::HashMap;
use std::ops::RangeInclusive;

use super::text::{self, Line};
use crate::Material;
pub(crate) use map::Map;

/// Unsupported texture keys.
const UNSUPPORTED_MAPS: &str = "disp map_disp map_Disp decal map_decal refl map_refl map_Ns map_Tr \
                           map_Tf map_Ps map_Pc map_RMA map_ORM map_aniso";

/// Unsupported strengths of sheen, clearcoat and anisotropy. 0 disables them, as Blender writes for every material. `Pcr` and
/// `anisor` have no effect without them.
const UNSUPPORTED_FACTORS: &str = "Ps Pc aniso";

/// A material of a library; `None` for keys that are absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlMaterial {
    /// `Kd`, in 0..=1.
    pub(crate) base_color: Option<[f32; 3]>,
    /// `Ks`, in 0..=1.
    pub(crate) specular: Option<[f32; 3]>,
    /// `Tf`, in 0..=1.
    pub(crate) filter: Option<[f32; 3]>,
    /// `Ke`, not negative.
    pub(crate) emission: Option<[f32; 3]>,
    /// `Ns`, not negative.
    pub(crate) shininess: Option<f32>,
    /// `Pr`, in 0..=1.
    pub(crate) roughness: Option<f32>,
    /// `Pm`, in 0..=1.
    pub(crate) metallic: Option<f32>,
    /// `Ni`, from 1 to [`Material::MAX_IOR`].
    pub(crate) ior: Option<f32>,
    /// `illum`.
    pub(crate) illumination: Option<u32>,
    /// `d`, in 0..=1.
    pub(crate) opacity: Option<f32>,
    /// `Tr`, in 0..=1.
    pub(crate) transparency: Option<f32>,
    /// `map_Kd`.
    pub(crate) base_color_map: Option<Map>,
    /// `map_Ks`.
    pub(crate) specular_map: Option<Map>,
    /// `map_d`.
    pub(crate) mask: Option<Map>,
    /// `map_Ke`.
    pub(crate) emission_map: Option<Map>,
    /// `norm`, or a bump statement.
    pub(crate) normal_map: Option<Map>,
    /// Whether `normal_map` is of `norm`, and so not of heights.
    pub(crate) has_norm: bool,
    /// `map_Pr`.
    pub(crate) roughness_map: Option<Map>,
    /// `map_Pm`.
    pub(crate) metallic_map: Option<Map>,
    /// Unsupported keys.
    pub(crate) unsupported: Vec<&'static str>,
}

/// Materials of a library by name; the last of several with the same name wins. Invalid lines become warnings.
pub(crate) fn parse<'a>(file: &str, bytes: &'a [u8], warnings: &mut Vec<String>) -> HashMap<&'a [u8], MtlMaterial> {
    let mut library = HashMap::new();
    let mut current: Option<(&[u8], MtlMaterial)> = None;
    for line in text::lines(bytes) {
        if line.keyword == b"newmtl" {
            library.extend(current.replace((line.rest, MtlMaterial::default())));
        } else if let Some((name, material)) = &mut current
            && let Err(problem) = material.read(&line)
        {
            let warning = format!("{file}: line {}: material {}: {problem}", line.number, text::quoted(name));
            warnings.push(text::printable(&warning).into_owned());
        }
    }
    library.extend(current);
    library
}

impl MtlMaterial {
    /// Reads one line; the error is a warning.
    fn read(&mut self, line: &Line) -> Result<(), String> {
        match line.keyword {
            b"Kd" => store(&mut self.base_color, color(line, 1.0), line),
            b"Ke" => store(&mut self.emission, color(line, f32::MAX), line),
            // Only used for mirrors and glass, so invalid values are not reported.
            b"Ks" => {
                self.specular = color(line, 1.0).ok().map(|(_, kept)| kept);
                Ok(())
            }
            b"Tf" => {
                self.filter = color(line, 1.0).ok().map(|(_, kept)| kept);
                Ok(())
            }
            b"Ns" => store(&mut self.shininess, number(line, 0.0..=f32::MAX), line),
            b"Pr" => store(&mut self.roughness, number(line, 0.0..=1.0), line),
            b"Pm" => store(&mut self.metallic, number(line, 0.0..=1.0), line),
            b"Ni" => store(&mut self.ior, number(line, 1.0..=Material::MAX_IOR), line),
            b"d" => store(&mut self.opacity, number(line, 0.0..=1.0), line),
            b"Tr" => store(&mut self.transparency, number(line, 0.0..=1.0), line),
            b"illum" => {
                let number = text::words(line.rest).next().and_then(|word| std::str::from_utf8(word).ok());
                self.illumination = number.and_then(|number| number.parse().ok());
                Ok(())
            }
            b"map_Kd" => texture(&mut self.base_color_map, line),
            b"map_Ks" => texture(&mut self.specular_map, line),
            b"map_d" => texture(&mut self.mask, line),
            b"map_Ke" => texture(&mut self.emission_map, line),
            b"norm" => {
                self.has_norm = true;
                texture(&mut self.normal_map, line)
            }
            // `norm` takes precedence.
            b"bump" | b"map_bump" | b"map_Bump" if self.has_norm => Ok(()),
            b"bump" | b"map_bump" | b"map_Bump" => texture(&mut self.normal_map, line),
            b"map_Pr" => texture(&mut self.roughness_map, line),
            b"map_Pm" => texture(&mut self.metallic_map, line),
            _ => {
                self.note_unsupported(line);
                Ok(())
            }
        }
    }

    /// Records an unsupported key once.
    fn note_unsupported(&mut self, line: &Line) {
        let known = |names: &'static str| names.split(' ').find(|name| name.as_bytes() == line.keyword);
        let is_none = || text::words(line.rest).all(|word| text::float(word) == Some(0.0));
        let name = known(UNSUPPORTED_MAPS).or_else(|| known(UNSUPPORTED_FACTORS).filter(|_| !is_none()));
        self.unsupported.extend(name.filter(|name| !self.unsupported.contains(name)));
    }
}

/// Stores a value clamped to its range; the error reports clamping.
fn store<T: Copy + PartialEq>(slot: &mut Option<T>, values: Result<(T, T), String>, line: &Line) -> Result<(), String> {
    let (value, clamped) = values?;
    *slot = Some(clamped);
    if value == clamped {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("clamping {keyword} {} to the valid range", text::quoted(line.rest)))
}

/// Stores a texture; the error lists ignored options.
fn texture(slot: &mut Option<Map>, line: &Line) -> Result<(), String> {
    let (map, unsupported) = map::read(line)?;
    *slot = Some(map);
    if unsupported.is_empty() {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("ignoring options of {keyword}: {}", unsupported.join(", ")))
}

/// The number of a line and its clamped value.
fn number(line: &Line, range: RangeInclusive<f32>) -> Result<(f32, f32), String> {
    let value = text::words(line.rest).find(|&word| word != b"-halo").and_then(text::float);
    let value = value.filter(|value| !value.is_nan()).ok_or_else(|| invalid(line, "a number"))?;
    Ok((value, value.clamp(*range.start(), *range.end())))
}

/// The color of a line and its components clamped to `0..=max`. A single number is gray.
fn color(line: &Line, max: f32) -> Result<([f32; 3], [f32; 3]), String> {
    let numbers: Option<Vec<f32>> = text::words(line.rest).take(4).map(text::float).collect();
    let color = match numbers.as_deref() {
        Some(&[gray]) => [gray; 3],
        Some(&[r, g, b]) => [r, g, b],
        _ => return Err(invalid(line, "1 or 3 numbers")),
    };
    if color.iter().any(|component| component.is_nan()) {
        return Err(invalid(line, "numbers"));
    }
    Ok((color, color.map(|component| component.clamp(0.0, max))))
}

fn invalid(line: &Line, expected: &str) -> String {
    let keyword = String::from_utf8_lossy(line.keyword);
    format!("ignoring {keyword} {}: expected {expected}", text::quoted(line.rest))
}
