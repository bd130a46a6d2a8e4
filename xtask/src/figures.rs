//! Figures in prose: numbers that nobody can trace to a measurement.
//!
//! A figure is a decimal fraction, or a whole number before `%`, `percent`, `times` or `fold`. Measured figures stand in
//! measured tables, defined ones (settings, bounds) in code. Figures in words and whole numbers that count something
//! are not seen.

use crate::tables::without_tables;

/// Words before a version number.
const VERSIONED: [&str; 3] = ["Rust", "Embree", "CC-BY"];

/// Words after a number that make it a ratio.
const UNITS: [&str; 5] = ["%", "per cent", "percent", "times", "fold"];

/// The same without a space between.
const SUFFIXES: [&str; 5] = ["%", "x", "×", "-fold", "fold"];

/// A word of the text, a toggle of inline code, or the end of a paragraph.
enum Token {
    Word(String),
    Code,
    Paragraph,
}

/// Figures outside of measured tables and of code, versions aside, with their lines.
pub(crate) fn figures(text: &str) -> Vec<(usize, String)> {
    let mut found = vec![];
    let mut is_code = false;
    let mut before = String::new();
    let tokens = tokens(&without_tables(text));
    for (i, (line, token)) in tokens.iter().enumerate() {
        let word = match token {
            Token::Code => {
                is_code = !is_code;
                before.clear();
                continue;
            }
            // Unclosed code ends with its paragraph.
            Token::Paragraph => {
                is_code = false;
                before.clear();
                continue;
            }
            Token::Word(_) if is_code => continue,
            Token::Word(word) => word,
        };
        let is_version = VERSIONED.contains(&before.trim_start_matches('('));
        if is_fraction(word) && !is_version || is_ratio(word) {
            found.push((*line, message(word)));
        } else if is_number(&before) {
            let after = match tokens.get(i + 1) {
                Some((_, Token::Word(after))) => after,
                _ => "",
            };
            found.extend(unit(word, after).map(|unit| (*line, message(&format!("{before} {unit}")))));
        }
        before.clone_from(word);
    }
    found
}

/// Tokens of a text with their lines, without code blocks.
fn tokens(text: &str) -> Vec<(usize, Token)> {
    let mut tokens = vec![];
    let mut is_block = false;
    for (i, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            is_block = !is_block;
        } else if line.trim().is_empty() {
            tokens.push((i + 1, Token::Paragraph));
        } else if !is_block {
            let line = line.replace("``", "`").replace('`', " ` ");
            let token = |word: &str| if word == "`" { Token::Code } else { Token::Word(word.to_owned()) };
            tokens.extend(line.split_whitespace().map(|word| (i + 1, token(word))));
        }
    }
    tokens
}

fn message(figure: &str) -> String {
    format!(
        "'{figure}' is typed by hand: put it into a measured table, or write it as code if it is defined and not measured"
    )
}

/// A word without punctuation around it.
fn bare(word: &str) -> &str {
    word.trim_matches(|c: char| !c.is_alphanumeric() && !"%×".contains(c))
}

/// Whether a word has a decimal fraction, punctuation and a unit aside; links have none.
fn is_fraction(word: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.chars().all(|c| c.is_ascii_digit());
    let is_one = |part: &str| {
        let part = without_unit(bare(part)).unwrap_or(bare(part));
        part.split_once('.').is_some_and(|(whole, part)| digits(whole) && digits(part))
    };
    !word.contains("](") && word.split('/').any(is_one)
}

/// Whether a word is a number and a unit.
fn is_ratio(word: &str) -> bool {
    without_unit(bare(word)).is_some_and(is_number)
}

fn without_unit(word: &str) -> Option<&str> {
    SUFFIXES.iter().find_map(|suffix| word.strip_suffix(suffix))
}

/// The unit that follows a number: one word, or two.
fn unit(word: &str, after: &str) -> Option<&'static str> {
    let [one, two] = [bare(word).to_owned(), format!("{word} {}", bare(after))];
    UNITS.into_iter().find(|&unit| unit == one || unit == two)
}

/// Whether a word is one or more numbers: `12`, `1,000`, `2-3`, `7/5`, `1e6`, `2^20`.
fn is_number(word: &str) -> bool {
    let word = word.trim_start_matches(|c: char| !c.is_alphanumeric());
    word.starts_with(|c: char| c.is_ascii_digit())
        && word.ends_with(|c: char| c.is_ascii_digit())
        && word.chars().all(|c| c.is_ascii_digit() || ",-–/e^".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figures found, between the quotes of their messages.
    fn found(text: &str) -> Vec<String> {
        let figure = |(_, message): (usize, String)| message.split('\'').nth(1).map(str::to_owned);
        figures(text).into_iter().filter_map(figure).collect()
    }

    #[test]
    fn fractions_are_found() {
        assert_eq!(found("It is 1.5 times, or (2.25)."), ["1.5", "(2.25)."]);
        assert_eq!(found("It is 2.6x, 7.7/5.4, 1.5× and 28.5%."), ["2.6x,", "7.7/5.4,", "1.5×", "28.5%."]);
    }

    #[test]
    fn whole_numbers_with_a_unit_are_found() {
        let text = "It is 5 % more, (12 per cent), 3 times\nas fast, 2-3 times, 1,000 times, 4x, 2×, 7%; 10-fold, 10 fold, 6 percent";
        let apart = ["5 %", "(12 per cent", "3 times", "2-3 times", "1,000 times"];
        let together = ["4x,", "2×,", "7%;", "10-fold,", "10 fold", "6 percent"];
        assert_eq!(found(text), [&apart[..], &together].concat());
        assert_eq!(figures("of 30\ntimes as much"), [(2, message("30 times"))]);
    }

    #[test]
    fn code_and_measured_tables_are_skipped() {
        for text in [
            "`t = 1.5`, `5 %`, `0.01 and\n2 times` as set, `8` times\n```\n1.5 and 3 %\n```",
            "a\n<!-- measured\nx = y\n-->\n| 1.5 | 3 % |\n<!-- end -->\nb",
        ] {
            assert_eq!(found(text), [""; 0], "{text}");
        }
        // Unclosed code ends with its paragraph.
        assert_eq!(found("a ` b\n\n1.5"), ["1.5"]);
        assert_eq!(figures("<!-- measured\nx\n-->\n1.5\n<!-- end -->\n\n2.5")[0].0, 7);
    }

    #[test]
    fn counts_sizes_and_versions_are_not_figures() {
        for text in [
            "Rust 1.89, Embree 4.4's mode, (Embree 4.4), CC-BY 3.0, 3 or 1e7 or v1.2.3",
            "88,944 triangles, 8 x 8 pixels, 25 degrees, 2 of 3, times 5, fold 7, 16 percentiles, 5 per node",
            "In 2026, times changed; a hundred times; 12 periods; [5](x) times",
        ] {
            assert_eq!(found(text), [""; 0], "{text}");
        }
    }
}
