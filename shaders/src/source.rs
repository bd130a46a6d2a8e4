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

use crate::ShaderError;
use crate::files::{Choice, FILES, Number, Override, ShaderName};
use crate::sections::{CONST, SLOT, USE, sections};

/// Choices for the slots, numbers and overrides of a kernel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variant {
    parts: Vec<(&'static str, &'static str)>,
    numbers: Vec<(&'static str, u32)>,
    overrides: Vec<(&'static str, f64)>,
}

impl Variant {
    /// No choices.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Fills the slot of `choice` with its part.
    #[must_use]
    pub fn with<C: Choice>(self, choice: C) -> Self {
        self.fill(C::SLOT, choice.part())
    }

    /// Sets a constant, which may be the size of an array in any address space.
    #[must_use]
    pub fn number(self, number: Number, value: u32) -> Self {
        self.set(name_of(Number::ALL, number), value)
    }

    /// Sets an `override`.
    #[must_use]
    pub fn value(mut self, name: Override, value: f64) -> Self {
        self.overrides.push((name_of(Override::ALL, name), value));
        self
    }

    /// Fills a slot by its name.
    pub(crate) fn fill(mut self, slot: &'static str, part: &'static str) -> Self {
        self.parts.push((slot, part));
        self
    }

    /// Sets a constant by its name.
    pub(crate) fn set(mut self, name: &'static str, value: u32) -> Self {
        self.numbers.push((name, value));
        self
    }

    /// Whether the slot of `choice` has its part.
    #[must_use]
    pub fn has<C: Choice>(&self, choice: C) -> bool {
        self.parts.contains(&(C::SLOT, choice.part()))
    }

    /// The same choices, but none for the slot `S`.
    #[must_use]
    pub fn without<S: Choice>(mut self) -> Self {
        self.parts.retain(|(slot, _)| *slot != S::SLOT);
        self
    }

    /// The choices and overrides that kernel `name` uses. Lets kernels with different slots share one set of choices.
    ///
    /// # Errors
    /// A slot or constant without a choice.
    pub fn of_kernel(&self, name: ShaderName) -> Result<Self, ShaderError> {
        let Joined { open, text, .. } = joined(name, self)?;
        let mut own = self.clone();
        own.parts.retain(|(name, _)| open.contains(name));
        own.numbers.retain(|(name, _)| open.contains(name));
        own.overrides.retain(|(name, _)| text.contains(&format!("\noverride {name}:")));
        Ok(own)
    }

    /// The slots with a choice, and the part that fills each, in the order of the calls.
    pub fn parts(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        self.parts.iter().copied()
    }

    /// The overrides, in the form that a pipeline takes.
    #[must_use]
    pub fn overrides(&self) -> &[(&'static str, f64)] {
        &self.overrides
    }
}

fn name_of<T: Copy + PartialEq>(all: &[(T, &'static str)], wanted: T) -> &'static str {
    all.iter().find(|(known, _)| *known == wanted).map_or("", |(_, name)| name)
}

/// The text of kernel `name` with everything it uses.
///
/// # Errors
/// A slot or constant without a choice, or a choice that the kernel has no slot for.
pub fn assemble(name: ShaderName, chosen: &Variant) -> Result<String, ShaderError> {
    let joined = joined(name, chosen)?;
    let given = chosen.parts.iter().map(|(name, _)| name).chain(chosen.numbers.iter().map(|(name, _)| name));
    for what in given {
        if !joined.open.contains(what) {
            return Err(ShaderError::UnknownChoice { kernel: name.to_string(), what: (*what).to_owned() });
        }
    }
    Ok(joined.text)
}

/// The text of file `name`, all parts included.
fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The names that `name` is below, the longest first.
fn above(name: &'static str) -> impl Iterator<Item = &'static str> {
    name.rmatch_indices('/').map(move |(at, _)| &name[..at])
}

/// The head of file `name`, or a part of a file.
fn find(name: &'static str) -> Option<&'static str> {
    if let Some(text) = file(name) {
        return sections(text).first().map(|(_, head)| *head);
    }
    let (file, text) = above(name).find_map(|above| Some((above, file(above)?)))?;
    let part = &name[file.len() + 1..];
    sections(text).into_iter().skip(1).find(|(known, _)| *known == part).map(|(_, text)| text)
}

fn joined(name: ShaderName, chosen: &Variant) -> Result<Joined<'_>, ShaderError> {
    let mut joined = Joined { kernel: name, chosen, text: String::new(), added: vec![], open: vec![] };
    joined.add(name.as_str())?;
    Ok(joined)
}

struct Joined<'a> {
    kernel: ShaderName,
    chosen: &'a Variant,
    text: String,
    /// Names of files and parts.
    added: Vec<&'static str>,
    /// Slots and constants found so far.
    open: Vec<&'static str>,
}

impl Joined<'_> {
    fn add(&mut self, name: &'static str) -> Result<(), ShaderError> {
        if self.added.contains(&name) {
            return Ok(());
        }
        self.added.push(name);
        let text = find(name).expect("the build script checks names");
        if file(name).is_none()
            && let Some(above) = above(name).find(|above| find(above).is_some())
        {
            self.add(above)?;
        }
        for line in text.lines() {
            if let Some(slot) = line.strip_prefix(SLOT) {
                let slot = slot.trim();
                self.add(self.choice(slot, &self.chosen.parts)?)?;
                self.open.push(slot);
            } else if let Some(part) = line.strip_prefix(USE) {
                self.add(part.trim())?;
            } else if let Some(name) = line.strip_prefix(CONST) {
                let name = name.trim();
                let value = self.choice(name, &self.chosen.numbers)?;
                if !self.open.contains(&name) {
                    self.text.push_str(&format!("const {name}: u32 = {value}u;\n"));
                }
                self.open.push(name);
            }
        }
        self.text.push_str(text);
        Ok(())
    }

    fn choice<T: Copy>(&self, name: &'static str, from: &[(&'static str, T)]) -> Result<T, ShaderError> {
        let found = from.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        found.ok_or(ShaderError::MissingChoice { kernel: self.kernel, what: name })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{choice, wgsl};

    #[test]
    fn wrong_choices_are_reported() {
        let error = assemble(wgsl::check::LOOPS, &Variant::none().number(Number::StackSize, 3)).unwrap_err();
        assert_eq!(error.to_string(), "kernel 'check/loops' has no slot or constant 'STACK_SIZE'");
        let few = Variant::none().with(choice::Mask::None).with(choice::Traverse::Wide);
        let error = assemble(wgsl::trace::CLOSEST, &few).unwrap_err();
        assert_eq!(error.to_string(), "kernel 'trace/closest' needs a choice for 'node_kinds'");
        assert_eq!(find("shared/mask/no_such"), None);
    }

    #[test]
    fn a_file_is_added_once() {
        let text = assemble(wgsl::check::LOOPS, &Variant::none()).unwrap();
        assert_eq!(text.matches("fn invocation(").count(), 1);
    }

    #[test]
    fn a_part_comes_with_the_head_of_its_file_and_without_other_parts() {
        let found = sections("head\n// part a\nof a\n// choice b\nof b");
        assert_eq!(found, [("", "head\n"), ("a", "of a\n"), ("b", "of b")]);
        let none = Variant::none().with(choice::Pattern::Random);
        let text = assemble(wgsl::check::SAMPLER, &none).unwrap();
        assert_eq!((text.matches("fn pair(").count(), text.contains("fn permuted(")), (1, false));
    }
}
