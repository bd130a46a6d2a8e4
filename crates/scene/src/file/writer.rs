//! TOML text under construction: headings, keys with comments, values.

/// Column at which comments start after short values.
const COMMENT_COLUMN: usize = 44;

/// TOML text under construction.
#[derive(Default)]
pub(super) struct TomlWriter {
    pub(super) text: String,
}

impl TomlWriter {
    /// Writes comment lines.
    pub(super) fn comment(&mut self, text: &str) {
        for line in text.lines() {
            self.text.push_str(if line.is_empty() { "#" } else { "# " });
            // TOML forbids control characters in comments.
            self.text.extend(line.chars().filter(|c| !c.is_control()));
            self.text.push('\n');
        }
    }

    /// Writes a blank line and a table header.
    pub(super) fn heading(&mut self, name: &str) {
        self.blank();
        self.text.push_str(name);
        self.text.push('\n');
    }

    /// Writes a blank line unless the text is empty.
    pub(super) fn blank(&mut self) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
    }

    /// Writes a key, its value and an optional comment.
    pub(super) fn entry(&mut self, key: &str, value: &str, comment: &str) {
        let start = self.text.len();
        self.text.push_str(&format!("{key} = {value}"));
        if !comment.is_empty() {
            let width = self.text.len() - start;
            self.text.push_str(&" ".repeat(COMMENT_COLUMN.saturating_sub(width).max(1)));
            self.text.push_str(&format!("# {comment}"));
        }
        self.text.push('\n');
    }
}

/// The shortest digits that parse back to `x`.
pub(super) fn number(x: f32) -> String {
    format!("{x:?}")
}

/// An array of numbers.
pub(super) fn numbers(numbers: &[f32]) -> String {
    format!("[{}]", numbers.iter().map(|&x| number(x)).collect::<Vec<_>>().join(", "))
}

/// An array of arrays of numbers.
pub(super) fn vectors(list: &[[f32; 3]]) -> String {
    format!("[{}]", list.iter().map(|vector| numbers(vector)).collect::<Vec<_>>().join(", "))
}

/// A quoted and escaped string.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\U{:08x}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
