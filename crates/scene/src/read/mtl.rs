//! Material libraries of OBJ files: diffuse and emitted colour, textures, masks. Everything else is ignored.

use std::collections::HashMap;

use super::text::{self, Line};

/// A material as its library states it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Recipe {
    /// `Kd`, in 0..=1.
    pub(crate) base_color: Option<[f32; 3]>,
    /// `Ke`, not negative.
    pub(crate) emission: [f32; 3],
    /// File named by `map_Kd`.
    pub(crate) base_color_map: Option<String>,
    /// File named by `map_d`.
    pub(crate) mask: Option<String>,
    /// Whether `d` or `Tr` ask for a surface that lets light through.
    pub(crate) is_translucent: bool,
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
            warnings.push(format!("{file}, line {}: material {}: {doubt}", line.number, text::quoted(name)));
        }
    }
    recipes.extend(current);
    recipes
}

impl Recipe {
    /// Takes one line into the recipe; the error says what is doubtful in it.
    fn read(&mut self, line: &Line) -> Result<(), String> {
        match line.keyword {
            b"Kd" => {
                let (stated, kept) = colour(line, 1.0)?;
                self.base_color = Some(kept);
                clamped(line, stated, kept)
            }
            b"Ke" => {
                let (stated, kept) = colour(line, f32::MAX)?;
                self.emission = kept;
                clamped(line, stated, kept)
            }
            b"map_Kd" => {
                let (name, doubt) = texture(line)?;
                self.base_color_map = Some(name);
                doubt
            }
            b"map_d" => {
                let (name, doubt) = texture(line)?;
                self.mask = Some(name);
                doubt
            }
            b"map_Ke" => Err("map_Ke is not read; the surface emits evenly".into()),
            b"d" => self.transparency(line, |d| d < 1.0),
            b"Tr" => self.transparency(line, |tr| tr > 0.0),
            _ => Ok(()),
        }
    }

    fn transparency(&mut self, line: &Line, is_translucent: impl Fn(f32) -> bool) -> Result<(), String> {
        let number = text::words(line.rest).find(|&word| word != b"-halo").and_then(text::float);
        let number = number
            .filter(|number| !number.is_nan())
            .ok_or_else(|| format!("{} is not a number", text::quoted(line.rest)))?;
        self.is_translucent = is_translucent(number);
        Ok(())
    }
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
        return Err(format!("{keyword} {} is not a number; it keeps its default", text::quoted(line.rest)));
    }
    Ok((stated, stated.map(|component| component.clamp(0.0, most))))
}

fn clamped(line: &Line, stated: [f32; 3], kept: [f32; 3]) -> Result<(), String> {
    if stated == kept {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("{keyword} {} is out of range and clamped", text::quoted(line.rest)))
}

/// An option before the file name of a texture.
struct TextureOption {
    name: &'static [u8],
    n_arguments_most: usize,
    /// The argument that leaves the texture where it is; `None` for options that do not move it.
    neutral: Option<&'static [u8]>,
}

const OPTIONS: [TextureOption; 13] = [
    moving(b"-s", 3, b"1"),
    moving(b"-o", 3, b"0"),
    moving(b"-t", 3, b"0"),
    moving(b"-clamp", 1, b"off"),
    other(b"-mm", 2),
    other(b"-bm", 1),
    other(b"-boost", 1),
    other(b"-texres", 1),
    other(b"-blendu", 1),
    other(b"-blendv", 1),
    other(b"-cc", 1),
    other(b"-imfchan", 1),
    other(b"-type", 1),
];

const fn moving(name: &'static [u8], n_arguments_most: usize, neutral: &'static [u8]) -> TextureOption {
    TextureOption { name, n_arguments_most, neutral: Some(neutral) }
}

const fn other(name: &'static [u8], n_arguments_most: usize) -> TextureOption {
    TextureOption { name, n_arguments_most, neutral: None }
}

/// The file that a texture line names, which may contain blanks, behind its options; and a doubt where an option would
/// move the texture.
fn texture(line: &Line) -> Result<(String, Result<(), String>), String> {
    let mut rest = line.rest;
    let mut doubt = Ok(());
    while let Some(option) = OPTIONS.iter().find(|option| first_word(rest) == option.name) {
        rest = rest[option.name.len()..].trim_ascii_start();
        for k in 0..option.n_arguments_most {
            let word = first_word(rest);
            // The second and third number of a vector may be left out.
            if word.is_empty() || k > 0 && text::float(word).is_none() {
                break;
            }
            let changes = |neutral: &[u8]| match (text::float(word), text::float(neutral)) {
                (Some(number), Some(neutral)) => number != neutral,
                _ => word != neutral,
            };
            if option.neutral.is_some_and(changes) {
                doubt = Err(format!("texture option {} is not applied", text::quoted(option.name)));
            }
            rest = rest[word.len()..].trim_ascii_start();
        }
    }
    if rest.is_empty() {
        return Err(format!("{} names no file", String::from_utf8_lossy(line.keyword)));
    }
    Ok((String::from_utf8_lossy(rest).into_owned(), doubt))
}

fn first_word(text: &[u8]) -> &[u8] {
    &text[..text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len())]
}
