//! Texture lines of material libraries: a file, behind options that say how it is laid on.

use crate::read::text::{self, Line};
use crate::{TextureId, TextureRef, UvTransform, Wrap};

/// A texture as a library asks for it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Map {
    /// The file, as the line names it; it may contain blanks.
    pub(crate) file: String,
    /// `-s` for u and v.
    scale: [f32; 2],
    /// `-o` for u and v.
    offset: [f32; 2],
    /// `-clamp`: whether the texture ends at its border instead of repeating.
    is_clamped: bool,
    /// `-bm`: strength of a texture of normals.
    pub(crate) strength: f32,
}

impl Map {
    /// What lies outside 0..=1.
    pub(crate) fn wrap(&self) -> Wrap {
        if self.is_clamped { Wrap::Clamp } else { Wrap::Repeat }
    }

    /// The texture where this line puts it: looked up at `scale * uv + offset`.
    ///
    /// So do the importers of Blender and three.js, whatever a scale that "enlarges the pattern" may have meant.
    pub(crate) fn placed(&self, texture: TextureId) -> TextureRef {
        let ([scale_u, scale_v], [offset_u, offset_v]) = (self.scale, self.offset);
        let texture_from_mesh = UvTransform { rows: [[scale_u, 0.0, offset_u], [0.0, scale_v, offset_v]] };
        TextureRef { texture_from_mesh, ..TextureRef::new(texture) }
    }
}

/// What an option does to a texture.
#[derive(Clone, Copy)]
enum Effect {
    Scale,
    Offset,
    Clamp,
    Strength,
    /// None here, where its arguments are other than these, by which it does nothing anywhere.
    Missing(&'static [&'static str]),
    /// None on the textures that are read.
    Nothing,
}

/// The options, each with the most arguments that it takes. Of vectors the later numbers may be left out.
const OPTIONS: [(&str, usize, Effect); 13] = [
    ("-s", 3, Effect::Scale),
    ("-o", 3, Effect::Offset),
    ("-clamp", 1, Effect::Clamp),
    ("-bm", 1, Effect::Strength),
    ("-t", 3, Effect::Missing(&["0", "0", "0"])),
    ("-mm", 2, Effect::Missing(&["0", "1"])),
    ("-boost", 1, Effect::Missing(&["0"])),
    ("-blendu", 1, Effect::Missing(&["on"])),
    ("-blendv", 1, Effect::Missing(&["on"])),
    ("-cc", 1, Effect::Missing(&["off"])),
    ("-imfchan", 1, Effect::Missing(&["l"])),
    ("-texres", 1, Effect::Nothing),
    ("-type", 1, Effect::Nothing),
];

/// The texture that a line names, and the options in it that are not applied; the error says why there is none.
pub(super) fn read(line: &Line) -> Result<(Map, Vec<&'static str>), String> {
    let mut map = Map { file: String::new(), scale: [1.0; 2], offset: [0.0; 2], is_clamped: false, strength: 1.0 };
    let (mut rest, mut not_applied) = (line.rest, Vec::new());
    while let Some(&(name, n_arguments_most, effect)) =
        OPTIONS.iter().find(|(name, ..)| first_word(rest) == name.as_bytes())
    {
        rest = behind(rest, name.as_bytes());
        let mut arguments = Vec::new();
        while arguments.len() < n_arguments_most {
            let word = first_word(rest);
            if word.is_empty() || !arguments.is_empty() && text::float(word).is_none() {
                break;
            }
            arguments.push(word);
            rest = behind(rest, word);
        }
        if map.apply(effect, &arguments).is_none() && !not_applied.contains(&name) {
            not_applied.push(name);
        }
    }
    if rest.is_empty() {
        return Err(format!("{} names no file", String::from_utf8_lossy(line.keyword)));
    }
    map.file = String::from_utf8_lossy(rest).into_owned();
    Ok((map, not_applied))
}

impl Map {
    /// Takes an option into the map; `None` where that cannot be done.
    fn apply(&mut self, effect: Effect, arguments: &[&[u8]]) -> Option<()> {
        match effect {
            Effect::Scale => self.scale = vector(arguments, 1.0)?,
            Effect::Offset => self.offset = vector(arguments, 0.0)?,
            Effect::Clamp => {
                self.is_clamped = match arguments {
                    [b"on"] => true,
                    [b"off"] => false,
                    _ => return None,
                }
            }
            Effect::Strength => [self.strength, _] = vector(arguments, 0.0)?,
            Effect::Missing(neutral) => {
                return arguments.iter().zip(neutral).all(|(word, neutral)| is_same(word, neutral)).then_some(());
            }
            Effect::Nothing => {}
        }
        Some(())
    }
}

/// The first two of up to three finite numbers, `default` for what is left out; a third is depth, which no picture has.
fn vector(arguments: &[&[u8]], default: f32) -> Option<[f32; 2]> {
    let number = |word: &&[u8]| text::float(word).filter(|number| number.is_finite());
    let numbers: Vec<f32> = arguments.iter().map(number).collect::<Option<_>>()?;
    let first = *numbers.first()?;
    Some([first, numbers.get(1).copied().unwrap_or(default)])
}

/// Whether two words are one, or numbers of one value.
fn is_same(word: &[u8], neutral: &str) -> bool {
    word == neutral.as_bytes()
        || text::float(word).is_some_and(|number| Some(number) == text::float(neutral.as_bytes()))
}

fn first_word(text: &[u8]) -> &[u8] {
    &text[..text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len())]
}

/// What follows the first word.
fn behind<'a>(text: &'a [u8], word: &[u8]) -> &'a [u8] {
    text[word.len()..].trim_ascii_start()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(options: &str) -> (Map, Vec<&'static str>) {
        let rest = format!("{options} two words.png");
        let line = Line { number: 1, keyword: b"map_Kd", rest: rest.trim_ascii().as_bytes() };
        let (map, not_applied) = read(&line).unwrap();
        assert_eq!(map.file, "two words.png", "{options}");
        (map, not_applied)
    }

    #[test]
    fn textures_are_scaled_then_moved() {
        let looked_up = |options: &str| {
            let (map, not_applied) = of(options);
            assert_eq!(not_applied, [""; 0], "{options}");
            map.placed(TextureId(0)).texture_from_mesh.point([0.25, 0.5])
        };
        for (options, want) in [
            ("", [0.25, 0.5]),
            ("-s 2", [0.5, 0.5]),
            ("-s 2 4", [0.5, 2.0]),
            ("-s 2 4 8 -o 1 -2 3", [1.5, 0.0]),
            ("-o 0.5", [0.75, 0.5]),
            ("-o 0 0.125 -s -1 1 1", [-0.25, 0.625]),
            ("-s 3 -s 2 -texres 512 -type sphere", [0.5, 0.5]),
        ] {
            assert_eq!(looked_up(options), want, "{options}");
        }
    }

    #[test]
    fn textures_end_where_they_are_clamped() {
        for (options, wrap) in [("", Wrap::Repeat), ("-clamp off", Wrap::Repeat), ("-clamp on", Wrap::Clamp)] {
            assert_eq!(of(options).0.wrap(), wrap);
        }
        assert_eq!((of("-bm 0.25").0.strength, of("").0.strength), (0.25, 1.0));
    }

    #[test]
    fn what_is_not_applied_is_named() {
        for neutral in ["-t 0", "-t 0 0 0.0", "-mm 0 1", "-mm 0.0", "-cc off", "-blendu on -blendv on", "-imfchan l"] {
            assert_eq!(of(neutral).1, [""; 0], "{neutral}");
        }
        for (options, names) in [
            ("-t 1", &["-t"][..]),
            ("-mm 0 2 -mm 1 1", &["-mm"]),
            ("-s nan 1", &["-s"]),
            ("-o 1 inf -clamp maybe", &["-o", "-clamp"]),
            ("-bm strong", &["-bm"]),
            ("-imfchan z -blendu off -boost 3 -cc on", &["-imfchan", "-blendu", "-boost", "-cc"]),
        ] {
            let (map, not_applied) = of(options);
            assert_eq!(not_applied, names);
            assert_eq!(map, of("").0, "{options} leaves what it does not change");
        }
    }
}
