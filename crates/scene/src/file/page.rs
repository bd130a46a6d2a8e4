//! A scene file as it is written: lines of keys, values and what they mean.

/// Column at which comments begin where the value leaves room.
const COMMENT_COLUMN: usize = 44;

/// Text in the making.
#[derive(Default)]
pub(super) struct Page {
    pub(super) text: String,
}

impl Page {
    /// A line of prose.
    pub(super) fn note(&mut self, text: &str) {
        for line in text.lines() {
            self.text.push_str(if line.is_empty() { "#" } else { "# " });
            // What is no text in the eyes of the format has no place in a comment either.
            self.text.extend(line.chars().filter(|c| !c.is_control()));
            self.text.push('\n');
        }
    }

    /// A blank line, then the name of a table.
    pub(super) fn heading(&mut self, name: &str) {
        self.blank();
        self.text.push_str(name);
        self.text.push('\n');
    }

    pub(super) fn blank(&mut self) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
    }

    /// A key with its value, and a comment that may be empty.
    pub(super) fn line(&mut self, key: &str, value: &str, comment: &str) {
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

/// The shortest digits that read back as this number.
pub(super) fn number(x: f32) -> String {
    format!("{x:?}")
}

/// Numbers in brackets.
pub(super) fn numbers(numbers: &[f32]) -> String {
    format!("[{}]", numbers.iter().map(|&x| number(x)).collect::<Vec<_>>().join(", "))
}

/// A text in quotes.
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
