//! Files joined to kernels.
//!
//! Lines at the head of a file say what it needs:
//!
//! ```text
//! // use shared/hash         another file, once, whoever needs it
//! // use ?texture            a file that the caller chooses under the name `texture`
//! // const STACK             a number that the caller gives: `const STACK: u32 = …;`
//! ```
//!
//! WGSL lets declarations stand in any order. A part that is not chosen leaves neither code nor bindings behind, which an
//! `override` cannot do.

use crate::{FILES, ShaderError};

/// What a caller chooses of a kernel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Specialisation {
    parts: Vec<(String, String)>,
    numbers: Vec<(String, u32)>,
    overrides: Vec<(String, f64)>,
}

impl Specialisation {
    /// Nothing chosen.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Takes `file` for the open part `name`.
    #[must_use]
    pub fn part(mut self, name: &str, file: &str) -> Self {
        self.parts.push((name.to_owned(), file.to_owned()));
        self
    }

    /// Gives the number `name`, which may size arrays of any address space.
    #[must_use]
    pub fn number(mut self, name: &str, value: u32) -> Self {
        self.numbers.push((name.to_owned(), value));
        self
    }

    /// Gives the `override` `name`.
    #[must_use]
    pub fn value(mut self, name: &str, value: f64) -> Self {
        self.overrides.push((name.to_owned(), value));
        self
    }

    /// What of it a kernel leaves open, where all that the kernel leaves open is chosen: kernels that share a choice need not leave
    /// the same open.
    ///
    /// # Errors
    /// A name without a file, and what is left open.
    pub fn of_kernel(&self, name: &str) -> Result<Self, ShaderError> {
        let open = joined(name, self)?.open;
        let mut own = self.clone();
        own.parts.retain(|(name, _)| open.contains(name));
        own.numbers.retain(|(name, _)| open.contains(name));
        Ok(own)
    }

    /// The overrides, as a pipeline takes them.
    #[must_use]
    pub fn overrides(&self) -> &[(String, f64)] {
        &self.overrides
    }
}

/// The text of kernel `name` with all it uses.
///
/// # Errors
/// A name without a file, and what is left open, or chosen and not open.
pub fn assemble(name: &str, chosen: &Specialisation) -> Result<String, ShaderError> {
    let joined = joined(name, chosen)?;
    let given = chosen.parts.iter().map(|(name, _)| name).chain(chosen.numbers.iter().map(|(name, _)| name));
    for what in given {
        if !joined.open.contains(what) {
            return Err(ShaderError::NotOpen { kernel: name.to_owned(), what: what.clone() });
        }
    }
    Ok(joined.text)
}

fn joined<'a>(name: &'a str, chosen: &'a Specialisation) -> Result<Joined<'a>, ShaderError> {
    let mut joined = Joined { kernel: name, chosen, text: String::new(), files: vec![], open: vec![] };
    joined.add(name)?;
    Ok(joined)
}

struct Joined<'a> {
    kernel: &'a str,
    chosen: &'a Specialisation,
    text: String,
    files: Vec<String>,
    /// What the files left open so far.
    open: Vec<String>,
}

impl Joined<'_> {
    fn add(&mut self, file: &str) -> Result<(), ShaderError> {
        if self.files.iter().any(|known| known == file) {
            return Ok(());
        }
        self.files.push(file.to_owned());
        let found = FILES.iter().find(|(name, _)| *name == file);
        let (_, text) = found.ok_or_else(|| ShaderError::NoSuchFile { name: file.to_owned() })?;
        for line in text.lines() {
            if let Some(slot) = line.strip_prefix("// use ?") {
                let part = self.choice(slot.trim(), &self.chosen.parts)?.clone();
                self.add(&part)?;
            } else if let Some(part) = line.strip_prefix("// use ") {
                self.add(part.trim())?;
            } else if let Some(name) = line.strip_prefix("// const ") {
                let name = name.trim();
                let value = *self.choice(name, &self.chosen.numbers)?;
                if !self.open.iter().any(|known| known == name) {
                    self.text.push_str(&format!("const {name}: u32 = {value}u;\n"));
                }
                self.open.push(name.to_owned());
                continue;
            } else {
                continue;
            }
            if let Some(slot) = line.strip_prefix("// use ?") {
                self.open.push(slot.trim().to_owned());
            }
        }
        self.text.push_str(text);
        Ok(())
    }

    fn choice<'c, T>(&self, name: &str, from: &'c [(String, T)]) -> Result<&'c T, ShaderError> {
        let found = from.iter().find(|(known, _)| known == name).map(|(_, value)| value);
        found.ok_or_else(|| ShaderError::NotChosen { kernel: self.kernel.to_owned(), what: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_named() {
        let none = Specialisation::none();
        assert_eq!(assemble("no/such", &none).unwrap_err().to_string(), "there is no shader file 'no/such'");
        let error = assemble("check/loops", &none.number("STACK_SIZE", 3)).unwrap_err();
        assert_eq!(error.to_string(), "kernel 'check/loops' has no 'STACK_SIZE' to choose");
    }

    #[test]
    fn a_part_is_taken_once() {
        let text = assemble("check/loops", &Specialisation::none()).unwrap();
        assert_eq!(text.matches("fn invocation(").count(), 1);
    }
}
