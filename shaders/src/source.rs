//! Joins files and parts of files into the text of a kernel.
//!
//! Directives are comment lines:
//!
//! ```text
//! // use shared/hash           adds a file, or a part of one, once
//! // use ?placed               adds the part that the caller chose for the slot `placed`
//! // const STACK_SIZE          adds a number that the caller gives: `const STACK_SIZE: u32 = …;`
//! // part placed/world         starts a part of this file, `shared/surface.wgsl`, with the name `shared/surface/placed/world`
//! // choice placed/flat        starts a part that fills the slot `placed`, with the name `shared/surface/placed/flat`
//! ```
//!
//! A part belongs to the file with the longest name that its own starts with. The slot of a choice is the next to last word of its name.
//! The text before the first part is the head of the file. It comes with each of its parts, as a part `a` comes with `a/b`. WGSL accepts
//! declarations in any order. A part that is not chosen adds neither code nor bindings, which an `override` cannot achieve.

use crate::{FILES, ShaderError};

/// Choices for the slots, numbers and overrides of a kernel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variant {
    parts: Vec<(String, String)>,
    numbers: Vec<(String, u32)>,
    overrides: Vec<(String, f64)>,
}

impl Variant {
    /// No choices.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Fills the slot `name` with `file`, a file or a part of one.
    #[must_use]
    pub fn part(mut self, name: &str, file: &str) -> Self {
        self.parts.push((name.to_owned(), file.to_owned()));
        self
    }

    /// Sets the constant `name`, which may be the size of an array in any address space.
    #[must_use]
    pub fn number(mut self, name: &str, value: u32) -> Self {
        self.numbers.push((name.to_owned(), value));
        self
    }

    /// Sets the `override` `name`.
    #[must_use]
    pub fn value(mut self, name: &str, value: f64) -> Self {
        self.overrides.push((name.to_owned(), value));
        self
    }

    /// The choices and overrides that kernel `name` uses. Lets kernels with different slots share one set of choices.
    ///
    /// # Errors
    /// A name without a file, or a slot or constant without a choice.
    pub fn of_kernel(&self, name: &str) -> Result<Self, ShaderError> {
        let Joined { open, text, .. } = joined(name, self)?;
        let mut own = self.clone();
        own.parts.retain(|(name, _)| open.contains(name));
        own.numbers.retain(|(name, _)| open.contains(name));
        own.overrides.retain(|(name, _)| text.contains(&format!("\noverride {name}:")));
        Ok(own)
    }

    /// The slots with a choice, and the file or part that fills each, in the order of the calls.
    pub fn parts(&self) -> impl Iterator<Item = (&str, &str)> {
        self.parts.iter().map(|(slot, part)| (&**slot, &**part))
    }

    /// The overrides, in the form that a pipeline takes.
    #[must_use]
    pub fn overrides(&self) -> &[(String, f64)] {
        &self.overrides
    }
}

/// The text of kernel `name` with everything it uses.
///
/// # Errors
/// A name without a file, a slot or constant without a choice, or a choice that the kernel has no slot for.
pub fn assemble(name: &str, chosen: &Variant) -> Result<String, ShaderError> {
    let joined = joined(name, chosen)?;
    let given = chosen.parts.iter().map(|(name, _)| name).chain(chosen.numbers.iter().map(|(name, _)| name));
    for what in given {
        if !joined.open.contains(what) {
            return Err(ShaderError::UnknownChoice { kernel: name.to_owned(), what: what.clone() });
        }
    }
    Ok(joined.text)
}

/// The text of file `name`, all parts included.
fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The names that `name` is below, the longest first.
fn above(name: &str) -> impl Iterator<Item = &str> {
    name.rmatch_indices('/').map(move |(at, _)| &name[..at])
}

/// The head of file `name`, or a part of a file.
fn find(name: &str) -> Option<&'static str> {
    if let Some(text) = file(name) {
        return sections(text).first().map(|(_, head)| *head);
    }
    let (file, text) = above(name).find_map(|above| Some((above, file(above)?)))?;
    let part = &name[file.len() + 1..];
    sections(text).into_iter().skip(1).find(|(known, _)| *known == part).map(|(_, text)| text)
}

/// The head of a file under an empty name, then its parts.
fn sections(text: &'static str) -> Vec<(&'static str, &'static str)> {
    let mut found = vec![];
    let (mut name, mut start, mut at) = ("", 0, 0);
    for line in text.split_inclusive('\n') {
        if let Some(next) = line.strip_prefix("// part ").or_else(|| line.strip_prefix("// choice ")) {
            found.push((name, &text[start..at]));
            (name, start) = (next.trim(), at + line.len());
        }
        at += line.len();
    }
    found.push((name, &text[start..]));
    found
}

fn joined<'a>(name: &'a str, chosen: &'a Variant) -> Result<Joined<'a>, ShaderError> {
    let mut joined = Joined { kernel: name, chosen, text: String::new(), added: vec![], open: vec![] };
    joined.add(name)?;
    Ok(joined)
}

struct Joined<'a> {
    kernel: &'a str,
    chosen: &'a Variant,
    text: String,
    /// Names of files and parts.
    added: Vec<String>,
    /// Slots and constants found so far.
    open: Vec<String>,
}

impl Joined<'_> {
    fn add(&mut self, name: &str) -> Result<(), ShaderError> {
        if self.added.iter().any(|known| known == name) {
            return Ok(());
        }
        self.added.push(name.to_owned());
        let text = find(name).ok_or_else(|| ShaderError::NoSuchFile { name: name.to_owned() })?;
        if file(name).is_none()
            && let Some(above) = above(name).find(|above| find(above).is_some())
        {
            self.add(above)?;
        }
        for line in text.lines() {
            if let Some(slot) = line.strip_prefix("// use ?") {
                let part = self.choice(slot.trim(), &self.chosen.parts)?.clone();
                self.add(&part)?;
                self.open.push(slot.trim().to_owned());
            } else if let Some(part) = line.strip_prefix("// use ") {
                self.add(part.trim())?;
            } else if let Some(name) = line.strip_prefix("// const ") {
                let name = name.trim();
                let value = *self.choice(name, &self.chosen.numbers)?;
                if !self.open.iter().any(|known| known == name) {
                    self.text.push_str(&format!("const {name}: u32 = {value}u;\n"));
                }
                self.open.push(name.to_owned());
            }
        }
        self.text.push_str(text);
        Ok(())
    }

    fn choice<'c, T>(&self, name: &str, from: &'c [(String, T)]) -> Result<&'c T, ShaderError> {
        let found = from.iter().find(|(known, _)| known == name).map(|(_, value)| value);
        found.ok_or_else(|| ShaderError::MissingChoice { kernel: self.kernel.to_owned(), what: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_are_reported() {
        let none = Variant::none();
        assert_eq!(assemble("no/such", &none).unwrap_err().to_string(), "no shader file 'no/such'");
        let error = assemble("check/loops", &none.number("STACK_SIZE", 3)).unwrap_err();
        assert_eq!(error.to_string(), "kernel 'check/loops' has no slot or constant 'STACK_SIZE'");
        let unknown = Variant::none().part("mask", "shared/mask/no_such").part("traverse", "shared/traverse/wide");
        assert_eq!(
            assemble("trace/closest", &unknown).unwrap_err().to_string(),
            "kernel 'trace/closest' needs a choice for 'node_kinds'"
        );
        assert_eq!(find("shared/mask/no_such"), None);
    }

    #[test]
    fn a_file_is_added_once() {
        let text = assemble("check/loops", &Variant::none()).unwrap();
        assert_eq!(text.matches("fn invocation(").count(), 1);
    }

    #[test]
    fn a_part_comes_with_the_head_of_its_file_and_without_other_parts() {
        let found = sections("head\n// part a\nof a\n// choice b\nof b");
        assert_eq!(found, [("", "head\n"), ("a", "of a\n"), ("b", "of b")]);
        let none = Variant::none().part("pattern", "shared/sampler/pattern/random");
        let text = assemble("check/sampler", &none).unwrap();
        assert_eq!((text.matches("fn pair(").count(), text.contains("fn permuted(")), (1, false));
    }
}
