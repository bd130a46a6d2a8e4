//! Material libraries of OBJ files, with the keys `Pr`, `Pm` and `norm` of their extension for metals and roughness.
//! What else would change a picture is told by name; hints, and what concerns rasterizers alone, are ignored.

mod map;

use std::collections::HashMap;
use std::ops::RangeInclusive;

use super::text::{self, Line};
use crate::Material;
pub(crate) use map::Map;

/// Textures that others look up and nothing here does.
const UNREAD_MAPS: &str = "bump map_bump map_Bump disp map_disp map_Disp decal map_decal refl map_refl map_Ks map_Ns map_Tr \
                           map_Tf map_Pr map_Pm map_Ps map_Pc map_RMA map_ORM map_aniso";

/// Strengths of sheen, coat and anisotropy, which surfaces here lack. At 0 there is none, as Blender writes for all that it
/// exports; `Pcr` and `anisor` say how they are, and change nothing without them.
const UNREAD_STRENGTHS: &str = "Ps Pc aniso";

/// A material as its library states it; `None` for what it does not state.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Recipe {
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
    /// Texture of `map_Kd`.
    pub(crate) base_color_map: Option<Map>,
    /// Texture of `map_d`.
    pub(crate) mask: Option<Map>,
    /// Texture of `map_Ke`.
    pub(crate) emission_map: Option<Map>,
    /// Texture of `norm`.
    pub(crate) normal_map: Option<Map>,
    /// What else it asks for.
    pub(crate) ignored: Vec<&'static str>,
}

/// Materials of a library by name; of two with one name the later counts. Doubtful lines become warnings.
pub(crate) fn recipes<'a>(file: &str, bytes: &'a [u8], warnings: &mut Vec<String>) -> HashMap<&'a [u8], Recipe> {
    let mut recipes = HashMap::new();
    let mut current: Option<(&[u8], Recipe)> = None;
    for line in text::lines(bytes) {
        if line.keyword == b"newmtl" {
            recipes.extend(current.replace((line.rest, Recipe::default())));
        } else if let Some((name, recipe)) = &mut current
            && let Err(doubt) = recipe.read(&line)
        {
            let warning = format!("{file}, line {}: material {}: {doubt}", line.number, text::quoted(name));
            warnings.push(text::printable(&warning).into_owned());
        }
    }
    recipes.extend(current);
    recipes
}

impl Recipe {
    /// Takes one line into the recipe; the error says what is doubtful in it.
    fn read(&mut self, line: &Line) -> Result<(), String> {
        match line.keyword {
            b"Kd" => kept(&mut self.base_color, colour(line, 1.0), line),
            b"Ke" => kept(&mut self.emission, colour(line, f32::MAX), line),
            // These colour mirrors and glass alone, so doubts about them are rarely worth a word.
            b"Ks" => {
                self.specular = colour(line, 1.0).ok().map(|(_, kept)| kept);
                Ok(())
            }
            b"Tf" => {
                self.filter = colour(line, 1.0).ok().map(|(_, kept)| kept);
                Ok(())
            }
            b"Ns" => kept(&mut self.shininess, number(line, 0.0..=f32::MAX), line),
            b"Pr" => kept(&mut self.roughness, number(line, 0.0..=1.0), line),
            b"Pm" => kept(&mut self.metallic, number(line, 0.0..=1.0), line),
            b"Ni" => kept(&mut self.ior, number(line, 1.0..=Material::MAX_IOR), line),
            b"d" => kept(&mut self.opacity, number(line, 0.0..=1.0), line),
            b"Tr" => kept(&mut self.transparency, number(line, 0.0..=1.0), line),
            b"illum" => {
                self.illumination = std::str::from_utf8(line.rest).ok().and_then(|rest| rest.parse().ok());
                Ok(())
            }
            b"map_Kd" => texture(&mut self.base_color_map, line),
            b"map_d" => texture(&mut self.mask, line),
            b"map_Ke" => texture(&mut self.emission_map, line),
            b"norm" => texture(&mut self.normal_map, line),
            _ => {
                self.ignore(line);
                Ok(())
            }
        }
    }

    /// Remembers, once and as the file writes it, what is not read and would change a picture.
    fn ignore(&mut self, line: &Line) {
        let known = |names: &'static str| names.split(' ').find(|name| name.as_bytes() == line.keyword);
        let is_none = || text::words(line.rest).all(|word| text::float(word) == Some(0.0));
        let name = known(UNREAD_MAPS).or_else(|| known(UNREAD_STRENGTHS).filter(|_| !is_none()));
        self.ignored.extend(name.filter(|name| !self.ignored.contains(name)));
    }
}

/// Keeps what a line states, in its range; the error says where that differs.
fn kept<T: Copy + PartialEq>(slot: &mut Option<T>, values: Result<(T, T), String>, line: &Line) -> Result<(), String> {
    let (stated, kept) = values?;
    *slot = Some(kept);
    if stated == kept {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("{keyword} {} is out of range and clamped", text::quoted(line.rest)))
}

/// Keeps the texture that a line names; the error says which of its options are not applied.
fn texture(slot: &mut Option<Map>, line: &Line) -> Result<(), String> {
    let (map, not_applied) = map::read(line)?;
    *slot = Some(map);
    if not_applied.is_empty() {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("{keyword}: not applied: {}", not_applied.join(", ")))
}

/// The number of a line as stated and as kept, in a range.
fn number(line: &Line, range: RangeInclusive<f32>) -> Result<(f32, f32), String> {
    let stated = text::words(line.rest).find(|&word| word != b"-halo").and_then(text::float);
    let stated = stated.filter(|stated| !stated.is_nan()).ok_or_else(|| not_a_number(line))?;
    Ok((stated, stated.clamp(*range.start(), *range.end())))
}

/// The colour of a line as stated and as kept, each component in `0..=most`. One number stands for three.
fn colour(line: &Line, most: f32) -> Result<([f32; 3], [f32; 3]), String> {
    let keyword = String::from_utf8_lossy(line.keyword);
    let numbers: Option<Vec<f32>> = text::words(line.rest).take(4).map(text::float).collect();
    let stated = match numbers.as_deref() {
        Some(&[grey]) => [grey; 3],
        Some(&[r, g, b]) => [r, g, b],
        _ => return Err(format!("{keyword} {} is not a colour; it keeps its default", text::quoted(line.rest))),
    };
    if stated.iter().any(|component| component.is_nan()) {
        return Err(not_a_number(line));
    }
    Ok((stated, stated.map(|component| component.clamp(0.0, most))))
}

fn not_a_number(line: &Line) -> String {
    let keyword = String::from_utf8_lossy(line.keyword);
    format!("{keyword} {} is not a number; it keeps its default", text::quoted(line.rest))
}
