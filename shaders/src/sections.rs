// Sections of WGSL files: for this crate and for its build script.

/// Directives, before the name of what they use.
pub(crate) const USE: &str = "// use ";
pub(crate) const SLOT: &str = "// use ?";
pub(crate) const CONST: &str = "// const ";
pub(crate) const PART: &str = "// part ";
pub(crate) const CHOICE: &str = "// choice ";

/// The head of a file under an empty name, then its parts.
pub(crate) fn sections(text: &str) -> Vec<(&str, &str)> {
    let mut found = vec![];
    let (mut name, mut start, mut at) = ("", 0, 0);
    for line in text.split_inclusive('\n') {
        if let Some(next) = line.strip_prefix(PART).or_else(|| line.strip_prefix(CHOICE)) {
            found.push((name, &text[start..at]));
            (name, start) = (next.trim(), at + line.len());
        }
        at += line.len();
    }
    found.push((name, &text[start..]));
    found
}
