//! Tokenizes text formats without copying.

use std::borrow::Cow;

/// A logical line: comments and blank lines are skipped, continued lines are joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line<'a> {
    /// Number of the first physical line, from 1.
    pub(crate) number: usize,
    /// First word.
    pub(crate) keyword: &'a [u8],
    /// The rest of the line, trimmed.
    pub(crate) rest: &'a [u8],
}

/// Number of bytes up to and including the next line end: `\n`, `\r\n`, the `\r` of old Macintosh programs, or `\r\r\n`, which writing
/// `\r\n` in text mode makes.
pub(crate) fn line_length(bytes: &[u8]) -> usize {
    let Some(end) = bytes.iter().position(|&byte| byte == b'\n' || byte == b'\r') else { return bytes.len() };
    match bytes[end..] {
        [b'\r', b'\n', ..] => end + 2,
        [b'\r', b'\r', b'\n', ..] => end + 3,
        _ => end + 1,
    }
}

/// The lines of a text file, with their line ends.
#[cfg(any(feature = "stl", feature = "off", test))]
pub(crate) fn physical_lines(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let (line, rest) = bytes.split_at(line_length(bytes));
        bytes = rest;
        (!line.is_empty()).then_some(line)
    })
}

/// The text with `\n` for line ends that TOML does not have.
pub(crate) fn with_line_feeds(text: &str) -> Cow<'_, str> {
    let is_lone = |at: usize| !text[at + 1..].starts_with('\n');
    if !text.match_indices('\r').any(|(at, _)| is_lone(at)) {
        return text.into();
    }
    text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace('\r', "\n").into()
}

/// The keyword of ZBrush's vertex colors in OBJ: a comment for other programs.
pub(crate) const MRGB: &[u8] = b"#MRGB";

/// Logical lines of an OBJ or MTL file: `#` starts a comment, except of [`MRGB`], a trailing backslash continues a line, a byte order mark
/// is skipped.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = Line<'_>> {
    let mut bytes = after_mark(bytes);
    let mut n_lines = 0;
    std::iter::from_fn(move || {
        while !bytes.is_empty() {
            let number = n_lines + 1;
            let mut end = line_length(bytes);
            n_lines += 1;
            // A trailing backslash does not continue a comment, which may end with a Windows path.
            let is_comment = bytes[..end].trim_ascii_start().starts_with(b"#");
            while !is_comment && end < bytes.len() && is_continued(&bytes[..end]) {
                end += line_length(&bytes[end..]);
                n_lines += 1;
            }
            let (line, rest) = bytes.split_at(end);
            bytes = rest;
            let text = line.trim_ascii();
            let (keyword, rest) = split_word(text);
            if !text.is_empty() && (!is_comment || keyword == MRGB) {
                return Some(Line { number, keyword, rest: rest.trim_ascii() });
            }
        }
        None
    })
}

/// Whether a line ends with a backslash, which may have white space after it.
fn is_continued(line: &[u8]) -> bool {
    line.trim_ascii_end().ends_with(b"\\")
}

/// The first word, and the text after it; both empty at the end.
pub(crate) fn split_word(text: &[u8]) -> (&[u8], &[u8]) {
    let text = text.trim_ascii_start();
    text.split_at(text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len()))
}

/// Words separated by white space, up to a comment; line continuation backslashes are removed.
pub(crate) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace)
        .map(|word| word.strip_suffix(b"\\").unwrap_or(word))
        .filter(|word| !word.is_empty())
        .take_while(|word| word[0] != b'#')
}

/// A text without its quotes, if it has any.
pub(crate) fn unquoted(text: &[u8]) -> &[u8] {
    match text {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => text,
    }
}

/// Bytes with percent escapes (RFC 3986) decoded; invalid ones are kept.
pub(crate) fn unescaped(text: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        let escaped = match tail {
            [high, low, ..] if *first == b'%' => hex(*high).zip(hex(*low)).map(|(high, low)| high << 4 | low),
            _ => None,
        };
        bytes.push(escaped.unwrap_or(*first));
        rest = if escaped.is_some() { &tail[2..] } else { tail };
    }
    bytes
}

/// Value of a hexadecimal digit.
fn hex(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

/// A text of UTF-16, as some Windows programs write, in UTF-8; other bytes as they are. It is known by its byte order mark, else by four
/// ASCII characters at its start.
pub(crate) fn from_utf16(bytes: Vec<u8>) -> Vec<u8> {
    let is_ascii = |byte: u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    let starts = |text: usize| {
        bytes.len() >= 8 && (0..8).all(|k| if k % 2 == text { is_ascii(bytes[k]) } else { bytes[k] == 0 })
    };
    let order: fn([u8; 2]) -> u16 = match bytes[..] {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ if starts(0) => u16::from_le_bytes,
        _ if starts(1) => u16::from_be_bytes,
        _ => return bytes,
    };
    let units = bytes.chunks_exact(2).map(|pair| order([pair[0], pair[1]]));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect::<String>().into_bytes()
}

/// Text after a byte order mark of UTF-8.
pub(crate) fn after_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Parses a number, including exporter variants such as `nan(ind)` and `1.#INF`.
///
/// Values beyond the range of `f32` become infinite, invalid numbers NaN; callers drop both.
pub(crate) fn float(word: &[u8]) -> Option<f32> {
    let text = std::str::from_utf8(word).ok()?;
    if let Ok(number) = text.parse() {
        return Some(number);
    }
    let magnitude = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
    (magnitude.starts_with("nan(") || magnitude.starts_with("1.#")).then_some(f32::NAN)
}

/// Parses an optionally signed 64-bit integer.
pub(crate) fn integer(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Escapes control characters, so that a message stays on one line and cannot control a terminal.
pub(crate) fn printable(message: &str) -> Cow<'_, str> {
    if !message.contains(char::is_control) {
        return message.into();
    }
    let escaped = |c: char| if c.is_control() { c.escape_debug().to_string() } else { c.to_string() };
    message.chars().map(escaped).collect()
}

/// Quotes bytes of a file for messages, shortened, with control characters escaped.
pub(crate) fn quoted(bytes: &[u8]) -> String {
    const MAX_CHARS: usize = 60;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * MAX_CHARS)]);
    let short: String = text.chars().take(MAX_CHARS).collect();
    let more = if short.len() < bytes.len() { "..." } else { "" };
    format!("'{}{more}'", printable(&short))
}

/// What a file that is neither a model nor an image is by its first bytes, with what to do: what people find in place of the file that they
/// wanted.
pub(super) fn other_content(head: &[u8]) -> Option<&'static str> {
    let text = after_mark(head).trim_ascii_start();
    let starts = |word: &str| text.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word.as_bytes()));
    match head {
        _ if starts("version https://git-lfs.github.com/") => {
            Some("a pointer of Git LFS in place of the file; run `git lfs pull` in its folder")
        }
        _ if starts("<!doctype html") || starts("<html") => {
            Some("a web page in place of the file; download the file itself")
        }
        [b'P', b'K', 3, 4, ..] => Some("a ZIP archive; unpack it first"),
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => Some("an image in place of a model"),
        [b'%', b'P', b'D', b'F', ..] => Some("a PDF document"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vec<(usize, String, String)> {
        let owned = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        lines(text.as_bytes()).map(|line| (line.number, owned(line.keyword), owned(line.rest))).collect()
    }

    #[track_caller]
    fn is_lines(text: &str, want: &[(usize, &str, &str)]) {
        let got = read(text);
        let got: Vec<_> = got.iter().map(|(number, keyword, rest)| (*number, &keyword[..], &rest[..])).collect();
        assert_eq!(got, want, "{text:?}");
    }

    #[test]
    fn decodes_percent_escapes() {
        assert_eq!(unescaped("a%20b%C3%a9"), "a b\u{e9}".as_bytes());
        assert_eq!(unescaped("100%"), b"100%");
        assert_eq!(unescaped("%zz%4%%41"), b"%zz%4%A");
        assert_eq!(unescaped("%ff"), [255]);
    }

    #[test]
    fn escapes_control_characters() {
        assert_eq!(printable("a \u{1b}[31m\nb, `é`"), "a \\u{1b}[31m\\nb, `é`");
        assert!(matches!(printable("plain"), Cow::Borrowed("plain")));
    }

    #[test]
    fn skips_but_counts_blank_lines_and_comments() {
        is_lines("\u{feff}# a\n\n  v 1 2\r\n\t# b\ng x", &[(3, "v", "1 2"), (5, "g", "x")]);
        is_lines("\n# a\nv 1", &[(3, "v", "1")]);
        is_lines("", &[]);
    }

    #[test]
    fn lines_end_in_four_ways() {
        for end in ["\n", "\r\n", "\r", "\r\r\n"] {
            let text = "# a\n\nv 1 2\nf 1 \\\n2\n# b\\\ng x".replace('\n', end);
            let continued = format!("1 \\{end}2");
            is_lines(&text, &[(3, "v", "1 2"), (4, "f", &continued), (7, "g", "x")]);
            assert_eq!(physical_lines(text.as_bytes()).count(), 7, "{end:?}");
            assert_eq!(with_line_feeds("a\nb\n".replace('\n', end).as_str()).replace('\r', ""), "a\nb\n", "{end:?}");
        }
        is_lines("v 1\rv 2\nv 3\r\n\rv 4", &[(1, "v", "1"), (2, "v", "2"), (3, "v", "3"), (5, "v", "4")]);
        assert!(matches!(with_line_feeds("a\r\nb\n"), Cow::Borrowed(_)), "nothing to change");
    }

    #[test]
    fn decodes_utf16() {
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            for text in ["v 1 2 3\n# \u{e9}\u{1f600}", "\u{feff}\u{e9}", "\u{feff}"] {
                let bytes: Vec<u8> = text.encode_utf16().flat_map(order).collect();
                assert_eq!(from_utf16(bytes), text.as_bytes());
            }
        }
        assert_eq!(from_utf16(vec![0xff, 0xfe, 0, 0xd8, b'a']), "\u{feff}\u{fffd}".as_bytes());
        for bytes in [&b"v 1 2 3\n"[..], b"", b"\xff", b"v\x001\x002\x003", b"\0\0\0\0\0\0\0\0", b"\xef\xbb\xbfv 1"] {
            assert_eq!(from_utf16(bytes.to_vec()), bytes);
        }
    }

    #[test]
    fn continues_lines_but_not_comments() {
        is_lines("#MRGB 00ff\n#MRGBA\n #MRGB 11", &[(1, "#MRGB", "00ff"), (3, "#MRGB", "11")]);
        is_lines("f 1 \\\n 2\\\r\n3\nv 0", &[(1, "f", "1 \\\n 2\\\r\n3"), (4, "v", "0")]);
        is_lines("# C:\\\nv 0", &[(2, "v", "0")]);
        is_lines("v 0 \\", &[(1, "v", "0 \\")]);
        assert_eq!(words(b"1 \\\n 2\\\r\n3 # 4").collect::<Vec<_>>(), [b"1", b"2", b"3"]);
    }

    #[test]
    fn parses_numbers_of_all_exporters() {
        for (text, want) in [("+0", 0.0), ("-.5", -0.5), ("5.", 5.0), ("0E+0", 0.0), ("1e39", f32::INFINITY)] {
            assert_eq!(float(text.as_bytes()), Some(want), "{text}");
        }
        for text in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND"] {
            assert!(float(text.as_bytes()).is_some_and(f32::is_nan), "{text}");
        }
        for text in ["", "1,5", "0x10", "--1", "1e", "\u{ff11}"] {
            assert_eq!(float(text.as_bytes()), None, "{text}");
        }
        assert_eq!(integer(b"-12"), Some(-12));
        assert_eq!(integer(b"99999999999999999999"), None);
    }

    #[test]
    fn quotes_are_short_and_escaped() {
        assert_eq!(quoted(b"a\x1b[31m\n"), "'a\\u{1b}[31m\\n'");
        assert_eq!(quoted(b"C:\\x\\\"a\".png"), "'C:\\x\\\"a\".png'");
        assert!(quoted(&[b'x'; 100_000]).len() < 100);
    }
}
