//! Texture statements of MTL files: options, then a file name.

use crate::read::text::{self, Line};
use crate::{TextureId, TextureRef, UvTransform, Wrap};

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Map {
    /// File name; may contain spaces.
    pub(crate) file: String,
    /// `-s` for u and v.
    scale: [f32; 2],
    /// `-o` for u and v.
    offset: [f32; 2],
    /// `-clamp`.
    is_clamped: bool,
    /// `-bm`: strength of a normal map.
    pub(crate) strength: f32,
}

impl Map {
    /// Wrap mode.
    pub(crate) fn wrap(&self) -> Wrap {
        if self.is_clamped { Wrap::Clamp } else { Wrap::Repeat }
    }

    /// The texture reference, looked up at `scale * uv + offset`.
    ///
    /// The importers of Blender and three.js do the same; the specification is ambiguous.
    pub(crate) fn texture_ref(&self, texture: TextureId) -> TextureRef {
        let ([scale_u, scale_v], [offset_u, offset_v]) = (self.scale, self.offset);
        let texture_from_mesh = UvTransform { rows: [[scale_u, 0.0, offset_u], [0.0, scale_v, offset_v]] };
        TextureRef { texture_from_mesh, ..TextureRef::new(texture) }
    }
}

/// Effect of an option.
#[derive(Clone, Copy)]
enum Effect {
    Scale,
    Offset,
    Clamp,
    Strength,
    /// Not supported, unless the arguments are these defaults.
    Unsupported(&'static [&'static str]),
    /// No effect on the supported textures.
    Ignored,
}

/// The options with their largest number of arguments. Trailing vector components are optional.
const OPTIONS: [(&str, usize, Effect); 13] = [
    ("-s", 3, Effect::Scale),
    ("-o", 3, Effect::Offset),
    ("-clamp", 1, Effect::Clamp),
    ("-bm", 1, Effect::Strength),
    ("-t", 3, Effect::Unsupported(&["0", "0", "0"])),
    ("-mm", 2, Effect::Unsupported(&["0", "1"])),
    ("-boost", 1, Effect::Unsupported(&["0"])),
    ("-blendu", 1, Effect::Unsupported(&["on"])),
    ("-blendv", 1, Effect::Unsupported(&["on"])),
    ("-cc", 1, Effect::Unsupported(&["off"])),
    ("-imfchan", 1, Effect::Unsupported(&["l"])),
    ("-texres", 1, Effect::Ignored),
    ("-type", 1, Effect::Ignored),
];

/// The texture of a statement and its unsupported options.
pub(super) fn read(line: &Line) -> Result<(Map, Vec<&'static str>), String> {
    let mut map = Map { file: String::new(), scale: [1.0; 2], offset: [0.0; 2], is_clamped: false, strength: 1.0 };
    let (mut rest, mut unsupported) = (line.rest, Vec::new());
    while let Some(&(name, max_arguments, effect)) =
        OPTIONS.iter().find(|(name, ..)| first_word(rest) == name.as_bytes())
    {
        rest = after_word(rest, name.as_bytes());
        let mut arguments = Vec::new();
        while arguments.len() < max_arguments {
            let word = first_word(rest);
            if word.is_empty() || !arguments.is_empty() && text::float(word).is_none() {
                break;
            }
            arguments.push(word);
            rest = after_word(rest, word);
        }
        if map.apply(effect, &arguments).is_none() && !unsupported.contains(&name) {
            unsupported.push(name);
        }
    }
    if rest.is_empty() {
        return Err(format!("ignoring {}: no file name", String::from_utf8_lossy(line.keyword)));
    }
    map.file = String::from_utf8_lossy(rest).into_owned();
    Ok((map, unsupported))
}

impl Map {
    /// Applies an option; `None` if it is not supported.
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
            Effect::Unsupported(neutral) => {
                return arguments.iter().zip(neutral).all(|(word, neutral)| is_same(word, neutral)).then_some(());
            }
            Effect::Ignored => {}
        }
        Some(())
    }
}

/// The first two of up to three finite numbers; `default` if the second is absent. The third is for 3D textures.
fn vector(arguments: &[&[u8]], default: f32) -> Option<[f32; 2]> {
    let number = |word: &&[u8]| text::float(word).filter(|number| number.is_finite());
    let numbers: Vec<f32> = arguments.iter().map(number).collect::<Option<_>>()?;
    let first = *numbers.first()?;
    Some([first, numbers.get(1).copied().unwrap_or(default)])
}

/// Whether two words are equal, or numbers of equal value.
fn is_same(word: &[u8], neutral: &str) -> bool {
    word == neutral.as_bytes()
        || text::float(word).is_some_and(|number| Some(number) == text::float(neutral.as_bytes()))
}

fn first_word(text: &[u8]) -> &[u8] {
    &text[..text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len())]
}

/// The text after the first word.
fn after_word<'a>(text: &'a [u8], word: &[u8]) -> &'a [u8] {
    text[word.len()..].trim_ascii_start()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(options: &str) -> (Map, Vec<&'static str>) {
        let rest = format!("{options} two words.png");
        let line = Line { number: 1, keyword: b"map_Kd", rest: rest.trim_ascii().as_bytes() };
        let (map, unsupported) = read(&line).unwrap();
        assert_eq!(map.file, "two words.png", "{options}");
        (map, unsupported)
    }

    #[test]
    fn applies_scale_before_offset() {
        let looked_up = |options: &str| {
            let (map, unsupported) = of(options);
            assert_eq!(unsupported, [""; 0], "{options}");
            map.texture_ref(TextureId(0)).texture_from_mesh.point([0.25, 0.5])
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
    fn reads_clamp_and_strength() {
        for (options, wrap) in [("", Wrap::Repeat), ("-clamp off", Wrap::Repeat), ("-clamp on", Wrap::Clamp)] {
            assert_eq!(of(options).0.wrap(), wrap);
        }
        assert_eq!((of("-bm 0.25").0.strength, of("").0.strength), (0.25, 1.0));
    }

    #[test]
    fn reports_unsupported_options() {
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
            let (map, unsupported) = of(options);
            assert_eq!(unsupported, names);
            assert_eq!(map, of("").0, "{options}");
        }
    }
}
