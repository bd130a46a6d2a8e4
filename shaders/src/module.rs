//! Traversal as a module that a user's own kernel includes.

use std::collections::HashSet;

use crate::{ShaderError, Variant, assemble, wgsl};

/// Names that a user's kernel calls: those in `shared/module`, and what they become.
const PUBLIC: [(&str, &str); 13] = [
    ("Ray", "Ray"),
    ("ModuleHit", "Hit"),
    ("Surface", "Surface"),
    ("module_ray", "ray"),
    ("module_closest_hit", "closest_hit"),
    ("module_occluded", "occluded"),
    ("closest_hit_masked", "closest_hit_masked"),
    ("occluded_masked", "occluded_masked"),
    ("normal_of", "normal_of"),
    ("surface_of", "surface_of"),
    ("origin_beside", "origin_beside"),
    ("NONE", "NONE"),
    ("is_incomplete", "is_incomplete"),
];

/// Words before a declared name.
const DECLARES: [&str; 6] = ["fn", "struct", "const", "var", "override", "alias"];

/// Before all other names of the module, so that they do not collide with those of the kernel.
const PRIVATE: &str = "canted_";

/// How ray traversal is included in a kernel. A number converts into the options with this bind group.
///
/// ```
/// use canted_shaders::ModuleOptions;
///
/// // rt_Ray, rt_Hit, rt_closest_hit and so on, for a kernel that has a Ray of its own.
/// let options = ModuleOptions { group: 1, prefix: "rt_", accepts: None };
/// assert_eq!(ModuleOptions::from(1), ModuleOptions { prefix: "", ..options });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModuleOptions<'a> {
    /// Bind group of its buffers.
    pub group: u32,
    /// Comes before all its names: letters, digits and underscores, a letter first. With different prefixes and groups a kernel includes the modules of
    /// several scenes.
    pub prefix: &'a str,
    /// Name of a function of the kernel, `fn(hit: Hit) -> bool`: whether a hit counts, e.g. by the alpha of its texture. It is called in any order, for hits that
    /// may not be the closest, and must not trace rays.
    pub accepts: Option<&'a str>,
}

impl From<u32> for ModuleOptions<'_> {
    fn from(group: u32) -> Self {
        Self { group, ..Self::default() }
    }
}

/// Storage buffers of the module of any structure: nodes, triangles and tables, in the order of their bindings.
pub const MODULE_BUFFERS: u32 = 3;

/// Tables start at multiples of it in their common buffer.
pub const TABLE_BYTES: u32 = 256;

/// WGSL with `closest_hit(ray: Ray) -> Hit` and `occluded(ray: Ray) -> bool`, and what belongs to them: see `TracedScene::module` of `canted-gpu`.
///
/// `chosen` selects the structure, but no mask. `tables` are its storage buffers other than nodes and triangles, in the order in which they lie in one buffer, each with
/// its number of values, and each at the next multiple of [`TABLE_BYTES`]. A kernel joins the text to its own; declarations come in any order.
///
/// # Errors
/// A slot or constant without a choice; a table that the structure does not have; a prefix that is no start of a name.
pub fn traversal_module<'a>(
    chosen: &Variant,
    tables: &[(&str, u32)],
    options: impl Into<ModuleOptions<'a>>,
) -> Result<String, ShaderError> {
    let ModuleOptions { group, prefix, accepts } = options.into();
    check_name(prefix)?;
    let accepted = match accepts {
        None => "true".to_owned(),
        Some("") => return Err(ShaderError::BadName { name: String::new() }),
        Some(name) => check_name(name).map(|()| format!("{name}(hit)"))?,
    };
    let text = joined(
        &code(&assemble(wgsl::shared::MODULE, &chosen.clone().fill("mask", wgsl::shared::module::COUNTED.as_str()))?),
        tables,
    )?;
    let text = prefixed(&(text + CALLED), prefix).replace("@group(0)", &format!("@group({group})"));
    // The name of the program's function gets no prefix.
    Ok(text.replace(CALL, &accepted))
}

/// The same names but those of surfaces, for rays that the driver traces: see `TracedScene::module` of `canted-gpu`. The text starts with
/// an `enable` directive, so it comes first in a kernel.
///
/// # Errors
/// A prefix that is no start of a name.
pub fn driver_module(group: u32, prefix: &str) -> Result<String, ShaderError> {
    check_name(prefix)?;
    let text = code(&assemble(wgsl::shared::driver::MODULE, &Variant::none())?);
    Ok(prefixed(&text, prefix).replace("@group(0)", &format!("@group({group})")))
}

/// What `shared/module` calls, and the place of its answer.
const CALLED: &str = "fn is_accepted(hit: ModuleHit) -> bool {\n    return $;\n}\n";
const CALL: &str = "$";

/// The text with one buffer in place of several.
///
/// Kernels of this package bind each table. Tables as members of a structure have the same code, and arrays of fixed size cost nothing: a module is the text
/// of one scene anyway.
fn joined(text: &str, tables: &[(&str, u32)]) -> Result<String, ShaderError> {
    let mut text = text.to_owned();
    let mut members = String::new();
    for &(name, length) in tables {
        let declares = format!("var<storage, read> {name}: array<");
        let line = text.lines().find(|line| line.contains(&declares)).map(str::to_owned);
        let of = |line: &String| Some(line.split_once(&declares)?.1.strip_suffix(">;")?.to_owned());
        let Some((line, element)) = line.and_then(|line| of(&line).map(|element| (line, element))) else {
            return Err(ShaderError::UnknownChoice { kernel: wgsl::shared::MODULE.to_string(), what: name.to_owned() });
        };
        members.push_str(&format!("@align({TABLE_BYTES}) {name}: array<{element}, {length}u>,\n"));
        text = text.replace(&(line + "\n"), "").replace(&format!("arrayLength(&{name})"), &format!("{length}u"));
    }
    let mut result = String::with_capacity(2 * text.len());
    let mut previous = "";
    for token in tokens(&text) {
        if previous != "." && tables.iter().any(|(name, _)| *name == token) {
            result.push_str("tables.");
        }
        result.push_str(token);
        previous = token;
    }
    let binding = MODULE_BUFFERS - 1;
    result.push_str(&format!("struct Tables {{\n{members}}}\n"));
    result.push_str(&format!("@group(0) @binding({binding}) var<storage, read> tables: Tables;\n"));
    Ok(result)
}

/// Rejects what cannot start a name; nothing can.
fn check_name(name: &str) -> Result<(), ShaderError> {
    let is_part = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if is_part && name.chars().next().is_none_or(|first| first.is_ascii_alphabetic()) {
        return Ok(());
    }
    Err(ShaderError::BadName { name: name.to_owned() })
}

/// The text without comments.
fn code(text: &str) -> String {
    let line = |line: &str| line.split_once("//").map_or(line, |(code, _)| code).trim_end().to_owned();
    text.lines().map(line).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n") + "\n"
}

/// The text with a prefix at every name that it declares outside of functions and structures. Private names get one more.
fn prefixed(text: &str, prefix: &str) -> String {
    let names = declared(text);
    let tokens: Vec<&str> = tokens(text).collect();
    let mut result = String::with_capacity(2 * text.len());
    // Whether the current braces are those of a structure.
    let mut is_structure = false;
    for (i, &token) in tokens.iter().enumerate() {
        match token {
            "struct" => is_structure = true,
            "}" => is_structure = false,
            _ => {}
        }
        let is_member = i > 0 && tokens[i - 1] == "." || is_structure && tokens.get(i + 1) == Some(&":");
        if names.contains(token) && !is_member {
            result.push_str(prefix);
            match PUBLIC.iter().find(|(name, _)| *name == token) {
                Some((_, public)) => result.push_str(public),
                None => {
                    result.push_str(PRIVATE);
                    result.push_str(token);
                }
            }
        } else {
            result.push_str(token);
        }
    }
    result
}

/// Names declared outside of functions and structures.
fn declared(text: &str) -> HashSet<&str> {
    let mut names = HashSet::new();
    let mut depth = 0_i32;
    let mut previous = "";
    let mut is_type = false;
    for token in tokens(text).filter(|token| !token.trim().is_empty()) {
        match token {
            "{" => depth += 1,
            "}" => depth -= 1,
            // `var<storage, read> name`: the name follows the bracket.
            "<" if previous == "var" => is_type = true,
            ">" if is_type => {
                is_type = false;
                previous = "var";
                continue;
            }
            _ if is_type => continue,
            name if depth == 0 && DECLARES.contains(&previous) => {
                names.insert(name);
            }
            _ => {}
        }
        previous = token;
    }
    names
}

/// Words, and all other characters one by one.
fn tokens(text: &str) -> impl Iterator<Item = &str> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut rest = text;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let length = if is_word(first) { rest.find(|c| !is_word(c)).unwrap_or(rest.len()) } else { first.len_utf8() };
        let (token, after) = rest.split_at(length);
        rest = after;
        Some(token)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_prefixed_except_public_ones_and_members() {
        let text = "@group(0) @binding(1) var<storage, read> near: array<f32>;\nconst FAR: f32 = 1.0;\n\
                    struct Ray { near: f32 }\nfn module_closest_hit(ray: Ray) -> f32 { let far = FAR; return near[0] * ray.near + far; }";
        let expected = "@group(0) @binding(1) var<storage, read> canted_near: array<f32>;\nconst canted_FAR: f32 = 1.0;\n\
                        struct Ray { near: f32 }\n\
                        fn closest_hit(ray: Ray) -> f32 { let far = canted_FAR; return canted_near[0] * ray.near + far; }";
        assert_eq!(prefixed(text, ""), expected);
    }

    #[test]
    fn a_prefix_comes_before_public_names_too() {
        let text = "struct Ray { Hit: f32 }\nfn near(ray: Ray) -> f32 { return ray.Hit; }\n";
        let expected = "struct rt_Ray { Hit: f32 }\nfn rt_canted_near(ray: rt_Ray) -> f32 { return ray.Hit; }\n";
        assert_eq!(prefixed(text, "rt_"), expected);
    }

    #[test]
    fn prefixes_that_start_no_name_are_rejected() {
        for name in ["1", "_x", "a b", "é", "x-"] {
            assert_eq!(check_name(name), Err(ShaderError::BadName { name: name.to_owned() }));
        }
        for name in ["", "x", "Rt2_"] {
            assert_eq!(check_name(name), Ok(()));
        }
    }

    #[test]
    fn tables_become_members_of_one_buffer() {
        let text = "@group(0) @binding(2) var<storage, read> rows: array<Row>;\nfn f(x: X) -> u32 { return rows[arrayLength(&rows) - 1u].a + x.rows; }\n";
        let expected = "fn f(x: X) -> u32 { return tables.rows[7u - 1u].a + x.rows; }\n\
                        struct Tables {\n@align(256) rows: array<Row, 7u>,\n}\n\
                        @group(0) @binding(2) var<storage, read> tables: Tables;\n";
        assert_eq!(joined(text, &[("rows", 7)]).unwrap(), expected);
        assert!(joined(text, &[("columns", 7)]).is_err());
    }

    #[test]
    fn comments_are_removed() {
        assert_eq!(code("// a\nlet b = 1; // c\n\nd"), "let b = 1;\nd\n");
    }
}
