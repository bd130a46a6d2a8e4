//! Words that the field does not use for what we mean: `CONTRIBUTING.md` lists what to write instead.

use std::path::Path;

use super::Finding;

/// A retired word or phrase, in halves so that this file has none, and the word to use.
const RETIRED: [(&str, &str, &str); 24] = [
    ("is ", "told", "reported"),
    ("are ", "told", "reported"),
    ("be ", "told", "reported"),
    ("was ", "told", "reported"),
    ("were ", "told", "reported"),
    ("told by", " name", "reported"),
    ("along ", "the axes", "axis-aligned"),
    ("straight", " box", "axis-aligned box"),
    ("le", "ans", "is oriented"),
    ("lea", "ning", "oriented"),
    ("lean ", "node", "oriented node"),
    ("lean ", "box", "oriented box"),
    ("dea", "rer", "more expensive"),
    ("ball of", " light", "sphere light"),
    ("balls of", " light", "sphere lights"),
    ("disc of", " light", "disk light"),
    ("discs of", " light", "disk lights"),
    ("left ", "out", "skipped"),
    ("leaves", " out", "skips"),
    ("fore", "told", "predicted"),
    ("turned", " mesh", "rotated mesh"),
    ("beside", " peers", "compared with peers"),
    ("beside", " the peers", "compared with the peers"),
    ("without", " it:", "default:"),
];

/// Files that quote retired words: history, and the list of words.
const EXEMPT: [&str; 2] = ["CHANGELOG.md", "CONTRIBUTING.md"];

/// Source and documents use no retired word.
pub(super) fn retired(path: &Path, text: &str, findings: &mut Vec<Finding>) {
    let is_prose =
        path.extension().is_some_and(|extension| ["rs", "md", "wgsl", "toml"].iter().any(|&e| extension == e));
    if !is_prose || EXEMPT.iter().any(|file| path == Path::new(file)) {
        return;
    }
    for (i, line) in text.lines().enumerate() {
        let line = line.to_lowercase();
        for (first, second, instead) in RETIRED {
            let word = [first, second].concat();
            if has_word(&line, &word) {
                findings.push(Finding::error(path, format!("line {}: '{word}' is retired; write '{instead}'", i + 1)));
            }
        }
    }
}

/// Whether a line has a word or phrase that no letter continues on either side.
fn has_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + word.len()..].chars().next();
        !before.is_some_and(char::is_alphanumeric) && !after.is_some_and(char::is_alphanumeric)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(file: &str, text: &str) -> Vec<String> {
        let mut findings = vec![];
        retired(Path::new(file), text, &mut findings);
        findings.into_iter().map(|finding| finding.message).collect()
    }

    #[test]
    fn every_retired_word_is_found_in_sources_and_documents() {
        for (first, second, instead) in RETIRED {
            for file in ["a.rs", "docs/a.md", "a.wgsl", "Cargo.toml"] {
                let text = format!("fine\nA Thing {} there.", [first, second].concat().to_uppercase());
                let found = found(file, &text);
                let is_named =
                    |message: &String| message.starts_with("line 2:") && message.ends_with(&format!("'{instead}'"));
                assert!(found.iter().any(is_named), "{file}: {text}: {found:?}");
            }
        }
    }

    #[test]
    fn parts_of_words_and_exempt_files_are_not_checked() {
        assert_eq!(found("a.rs", concat!("clea", "ning; a cle", "ans; fore", "tolds")), [""; 0]);
        let retired = ["a ball of", " light"].concat();
        assert_eq!((found("CHANGELOG.md", &retired), found("data.csv", &retired)), (vec![], vec![]));
    }
}
