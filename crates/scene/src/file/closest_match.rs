/// The candidate with the smallest edit distance to `word`, the first one on ties, if the distance is at most a third of
/// the longer of the two words: more is another word, and no misspelling.
///
/// ```
/// use canted_scene::closest_match;
///
/// assert_eq!(closest_match("raduis", ["axis", "radius"]), Some("radius"));
/// assert_eq!(closest_match("diameter", ["axis", "radius"]), None);
/// ```
pub fn closest_match<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let n = |text: &str| text.chars().count();
    candidates
        .into_iter()
        .map(|candidate| (distance(word, candidate), candidate))
        .min_by_key(|&(distance, _)| distance)
        .filter(|&(distance, candidate)| 3 * distance <= n(word).max(n(candidate)))
        .map(|(_, candidate)| candidate)
}

/// The end of a message about an unknown word: `; did you mean 'radius'?`, or nothing.
///
/// ```
/// use canted_scene::suggestion;
///
/// assert_eq!(suggestion("raduis", ["axis", "radius"]), "; did you mean 'radius'?");
/// assert_eq!(suggestion("diameter", ["axis", "radius"]), "");
/// ```
pub fn suggestion<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    closest_match(word, candidates).map(|near| format!("; did you mean '{near}'?")).unwrap_or_default()
}

/// Levenshtein distance (Wagner and Fischer 1974).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    // Distances from the current prefix of `a` to all prefixes of `b`.
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The recursive definition, exponential time.
    fn slow(a: &[char], b: &[char]) -> usize {
        match (a, b) {
            ([], rest) | (rest, []) => rest.len(),
            ([x, a_rest @ ..], [y, b_rest @ ..]) => {
                let replaced = slow(a_rest, b_rest) + usize::from(x != y);
                replaced.min(slow(a_rest, b) + 1).min(slow(a, b_rest) + 1)
            }
        }
    }

    #[test]
    fn distances_match_the_recursive_definition() {
        let words = ["", "a", "eye", "eeye", "up", "fov", "fvo", "\u{e4}ye", "radius"];
        for a in words {
            for b in words {
                let [x, y] = [a, b].map(|word| word.chars().collect::<Vec<_>>());
                assert_eq!(distance(a, b), slow(&x, &y), "{a} {b}");
            }
        }
    }

    #[test]
    fn ties_return_the_first_candidate() {
        assert_eq!(closest_match("box", ["table", "bow", "fox"]), Some("bow"));
        assert_eq!(closest_match("x", []), None);
    }

    #[test]
    fn other_words_are_no_candidates() {
        assert_eq!(closest_match("sun", ["son"]), Some("son"));
        assert_eq!(closest_match("sun", ["fan"]), None);
        assert_eq!(closest_match("x", ["y"]), None);
    }
}
