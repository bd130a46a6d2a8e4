//! Traversal as a module that a user's own kernel includes.

use std::collections::HashSet;

use crate::{ShaderError, Variant, assemble};

/// Names that a user's kernel calls. All other names get a prefix.
const PUBLIC: [&str; 6] = ["Ray", "Hit", "closest_hit", "occluded", "NONE", "is_incomplete"];

/// Words before a declared name.
const DECLARES: [&str; 6] = ["fn", "struct", "const", "var", "override", "alias"];

/// Before all other names of the module, so that they do not collide with those of the kernel.
const PREFIX: &str = "canted_";

/// WGSL with `closest_hit(ray: Ray) -> Hit` and `occluded(ray: Ray) -> bool`, whose buffers are in bind group `group`.
///
/// `chosen` selects the structure. A kernel joins the text to its own; declarations come in any order.
///
/// # Errors
/// A slot or constant without a choice.
pub fn traversal_module(chosen: &Variant, group: u32) -> Result<String, ShaderError> {
    let text = assemble("shared/traverse", chosen)?;
    Ok(prefixed(&code(&text)).replace("@group(0)", &format!("@group({group})")))
}

/// The text without comments.
fn code(text: &str) -> String {
    let line = |line: &str| line.split_once("//").map_or(line, |(code, _)| code).trim_end().to_owned();
    text.lines().map(line).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n") + "\n"
}

/// The text with a prefix at every name that it declares outside of functions and structures, except the public ones.
fn prefixed(text: &str) -> String {
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
            result.push_str(PREFIX);
        }
        result.push_str(token);
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
            name if depth == 0 && DECLARES.contains(&previous) && !PUBLIC.contains(&name) => {
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
                    struct Ray { near: f32 }\nfn closest_hit(ray: Ray) -> f32 { let far = FAR; return near[0] * ray.near + far; }";
        let expected = "@group(0) @binding(1) var<storage, read> canted_near: array<f32>;\nconst canted_FAR: f32 = 1.0;\n\
                        struct Ray { near: f32 }\n\
                        fn closest_hit(ray: Ray) -> f32 { let far = canted_FAR; return canted_near[0] * ray.near + far; }";
        assert_eq!(prefixed(text), expected);
    }

    #[test]
    fn comments_are_removed() {
        assert_eq!(code("// a\nlet b = 1; // c\n\nd"), "let b = 1;\nd\n");
    }
}
