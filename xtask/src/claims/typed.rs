//! Figures that are typed by hand: nobody can say where these were measured.
//!
//! A figure is a decimal fraction, or a whole number that is a share or a ratio by the word behind it. What is measured stands in a
//! mark; what is defined, a setting or a bound, stands as code, as it does where it is defined. Not seen are figures in words, and
//! whole numbers that count or size something.

use super::{CLOSE, OPEN};

/// What a version follows.
const VERSIONED: [&str; 3] = ["Rust", "Embree", "CC-BY"];

/// What makes a whole number a share or a ratio.
const UNITS: [&str; 5] = ["%", "per cent", "percent", "times", "fold"];

/// The same without a space between.
const SUFFIXES: [&str; 5] = ["%", "x", "×", "-fold", "fold"];

/// What stands among the words of a text for the ends of marks, of code within a line, and of paragraphs.
const OPENS: &str = "\u{1}";
const CLOSES: &str = "\u{2}";
const CODE: &str = "\u{3}";
const PARAGRAPH: &str = "\u{4}";

/// Figures outside marks and code, versions aside, with their lines.
pub(crate) fn typed_by_hand(text: &str) -> Vec<(usize, String)> {
    let mut found = vec![];
    let (mut is_code, mut is_marked) = (false, false);
    // Nothing where a mark or code is: a number in it is none that was typed before a unit.
    let mut before = "";
    let words = words(text);
    for (i, (line, word)) in words.iter().enumerate() {
        let word = word.as_str();
        match word {
            OPENS => is_marked = true,
            CLOSES => is_marked = false,
            CODE => is_code = !is_code,
            // Code that nobody closed ends here.
            PARAGRAPH => is_code = false,
            _ if is_marked || is_code => {}
            _ => {
                let is_version = VERSIONED.contains(&before.trim_start_matches('('));
                if is_fraction(word) && !is_version || is_ratio(word) {
                    found.push((*line, by_hand(word)));
                } else if is_number(before) {
                    let after = words.get(i + 1).map_or("", |(_, word)| word);
                    found.extend(unit(word, after).map(|unit| (*line, by_hand(&format!("{before} {unit}")))));
                }
                before = word;
                continue;
            }
        }
        before = "";
    }
    found
}

/// The words of a text with their lines, blocks of code left out.
fn words(text: &str) -> Vec<(usize, String)> {
    let mut words = vec![];
    let mut is_block = false;
    for (i, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            is_block = !is_block;
        } else if line.trim().is_empty() {
            words.push((i + 1, PARAGRAPH.to_owned()));
        } else if !is_block {
            let mut parted = line.replace("``", "`");
            for (mark, word) in [(OPEN, OPENS), (CLOSE, CLOSES), ("`", CODE)] {
                parted = parted.replace(mark, &format!(" {word} "));
            }
            words.extend(parted.split_whitespace().map(|word| (i + 1, word.to_owned())));
        }
    }
    words
}

fn by_hand(figure: &str) -> String {
    format!("'{figure}' is typed by hand: mark where it was measured, or where it is defined write it as code")
}

/// A word without what stands around it.
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

/// What makes a ratio of the number before it: a word, or it and the one after.
fn unit(word: &str, after: &str) -> Option<&'static str> {
    let [one, two] = [bare(word).to_owned(), format!("{word} {}", bare(after))];
    UNITS.into_iter().find(|&unit| unit == one || unit == two)
}

/// Whether a word is a number, or some: `12`, `1,000`, `2-3`, `7/5`, `1e6`, `2^20`; one that a comma ends belongs to nothing behind it.
fn is_number(word: &str) -> bool {
    let word = word.trim_start_matches(|c: char| !c.is_alphanumeric());
    word.starts_with(|c: char| c.is_ascii_digit())
        && word.ends_with(|c: char| c.is_ascii_digit())
        && word.chars().all(|c| c.is_ascii_digit() || ",-–/e^".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figures that are seen, between the quotes of their messages.
    fn figures(text: &str) -> Vec<String> {
        let figure = |(_, message): (usize, String)| message.split('\'').nth(1).map(str::to_owned);
        typed_by_hand(text).into_iter().filter_map(figure).collect()
    }

    #[test]
    fn fractions_are_seen() {
        assert_eq!(figures("It is 1.5 times, or (2.25)."), ["1.5", "(2.25)."]);
        assert_eq!(figures("It is 2.6x, 7.7/5.4, 1.5× and 28.5%."), ["2.6x,", "7.7/5.4,", "1.5×", "28.5%."]);
    }

    #[test]
    fn whole_numbers_that_are_shares_or_ratios_are_seen() {
        let text = "It is 5 % more, (12 per cent), 3 times\nas fast, 2-3 times, 1,000 times, 4x, 2×, 7%; 10-fold, 10 fold, 6 percent";
        let apart = ["5 %", "(12 per cent", "3 times", "2-3 times", "1,000 times"];
        let together = ["4x,", "2×,", "7%;", "10-fold,", "10 fold", "6 percent"];
        assert_eq!(figures(text), [&apart[..], &together].concat());
        assert_eq!(typed_by_hand("of 30\ntimes as much"), [(2, by_hand("30 times"))]);
    }

    #[test]
    fn what_is_marked_or_written_as_code_is_not_typed_by_hand() {
        for text in [
            "It is <!-- measured: x | y | z -->1.5\nor 2.5<!-- / --> times.",
            "In 5 of <!-- measured: x | y | z -->3<!-- / --> times, <!-- measured: x | y | z -->2 %<!-- / -->",
            "`t = 1.5`, `5 %`, `0.01 and\n2 times` as set, `8` times\n```\n1.5 and 3 %\n```",
        ] {
            assert_eq!(figures(text), [""; 0], "{text}");
        }
        // Code ends with its paragraph, though nobody closed it.
        assert_eq!(figures("a ` b\n\n1.5"), ["1.5"]);
    }

    #[test]
    fn counts_sizes_and_versions_are_none() {
        for text in [
            "Rust 1.89, Embree 4.4's mode, (Embree 4.4), CC-BY 3.0, 3 or 1e7 or v1.2.3",
            "88,944 triangles, 8 x 8 pixels, 25 degrees, 2 of 3, times 5, fold 7, 16 percentiles, 5 per node",
            "In 2026, times changed; a hundred times; 12 periods; [5](x) times",
        ] {
            assert_eq!(figures(text), [""; 0], "{text}");
        }
    }
}
