//! The bytes of a file: its two container formats, JSON and GLB with a header, a JSON chunk and a binary chunk (glTF 2.0, section 4), and
//! URIs of buffers and images: base64 data or a file in the same folder.

use std::path::Path;

use crate::read::error::ReadError;
use crate::read::folder::Folder;
use crate::read::text;

/// Signature of GLB.
const MAGIC: &[u8; 4] = b"glTF";
/// Type of the first chunk.
const JSON: u32 = u32::from_le_bytes(*b"JSON");
/// Type of the optional second chunk.
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// The parts of a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Container<'a> {
    /// The JSON text.
    pub(super) json: &'a [u8],
    /// The binary chunk, with up to three bytes of padding.
    pub(super) bin: Option<&'a [u8]>,
}

/// Splits a file into its parts. A file without the GLB signature is JSON, unless its extension is `.glb` and it does not begin as JSON does.
pub(super) fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
    if bytes.starts_with(MAGIC) {
        return split_glb(path, bytes);
    }
    let json = text::after_mark(bytes);
    let is_json = json.trim_ascii_start().starts_with(b"{");
    if !is_json && path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb")) {
        return Err(ReadError::malformed(path, "header", "missing signature 'glTF'"));
    }
    Ok(Container { json, bin: None })
}

fn split_glb<'a>(path: &Path, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
    let ends_early = |location: &str| ReadError::malformed(path, location, "unexpected end of file");
    let ([_, version, length], _) = words(bytes).ok_or_else(|| ends_early("header"))?;
    if version != 2 {
        let what = if version == 1 { "glTF 1.0".to_owned() } else { format!("GLB version {version}") };
        return Err(ReadError::unsupported(path, what));
    }
    let glb = usize::try_from(length).ok().and_then(|length| bytes.get(..length)).ok_or_else(|| {
        ReadError::malformed(path, "header", format!("length of {length} bytes, but the file has {}", bytes.len()))
    })?;
    let rest = glb.get(12..).ok_or_else(|| ends_early("header"))?;
    let (kind, json, rest) = chunk(rest).ok_or_else(|| ends_early("JSON chunk"))?;
    if kind != JSON {
        return Err(ReadError::malformed(path, "first chunk", format!("expected type JSON, found {kind:#010x}")));
    }
    if rest.is_empty() {
        return Ok(Container { json, bin: None });
    }
    // Chunks of unknown type are ignored, as specified.
    let (kind, content, _) = chunk(rest).ok_or_else(|| ends_early("second chunk"))?;
    Ok(Container { json, bin: (kind == BIN).then_some(content) })
}

/// Type and content of the first chunk, and the rest.
fn chunk(bytes: &[u8]) -> Option<(u32, &[u8], &[u8])> {
    let ([length, kind], rest) = words(bytes)?;
    let (content, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    Some((kind, content, rest))
}

/// The first `N` little-endian words, and the rest.
fn words<const N: usize>(bytes: &[u8]) -> Option<([u32; N], &[u8])> {
    let (head, rest) = bytes.split_at_checked(4 * N)?;
    let (words, _) = head.as_chunks();
    Some((std::array::from_fn(|k| u32::from_le_bytes(words[k])), rest))
}

/// Loads the bytes of the URI of an image, which is searched for where a file of that path does not exist: see [`Folder::find`].
pub(super) fn load_image(uri: &str, folder: &Folder) -> Result<Vec<u8>, String> {
    let is_path = scheme(uri).is_none_or(|scheme| scheme.len() == 1);
    if let Some(path) = uri.strip_prefix("file://").or(Some(uri).filter(|_| is_path)) {
        let name = unescaped(path).ok_or("the uri is not UTF-8")?;
        return folder.read_image(&name).map_err(|error| format!("'{name}': {error}"));
    }
    load_uri(uri, folder)
}

/// Loads the bytes of a URI. Never accesses the network.
pub(super) fn load_uri(uri: &str, folder: &Folder) -> Result<Vec<u8>, String> {
    if let Some(scheme) = scheme(uri) {
        if scheme.eq_ignore_ascii_case("data") {
            return load_data(&uri[scheme.len() + 1..]);
        }
        return Err(format!("unsupported uri scheme '{scheme}'; use a relative path or a data uri"));
    }
    let name = unescaped(uri).ok_or("the uri is not UTF-8")?;
    folder.read(&name).map_err(|error| format!("'{name}': {error}"))
}

/// The scheme of a URI (RFC 3986, section 3.1); `None` for a relative path.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let legal = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    (scheme.starts_with(|c: char| c.is_ascii_alphabetic()) && scheme.chars().all(legal)).then_some(scheme)
}

/// The text of a URI; `None` if it is not UTF-8.
fn unescaped(text: &str) -> Option<String> {
    String::from_utf8(text::unescaped(text)).ok()
}

/// The content of a URI of the scheme `data` (RFC 2397): base64, in which white space and the alphabet of URLs are accepted, or percent
/// escapes.
fn load_data(data: &str) -> Result<Vec<u8>, String> {
    let (media_type, content) = data.split_once(',').ok_or("a data uri without ',', neither base64 nor text")?;
    let mut bytes = text::unescaped(content);
    let is_base64 = media_type.rsplit(';').next().is_some_and(|last| last.trim().eq_ignore_ascii_case("base64"));
    if !is_base64 {
        return Ok(bytes);
    }
    bytes.retain(|byte| !byte.is_ascii_whitespace());
    base64(&bytes).ok_or("invalid base64 in data uri".to_owned())
}

/// Decodes base64 (RFC 4648, sections 4 and 5) with optional padding.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let n_padding = text.iter().rev().take(2).take_while(|&&byte| byte == b'=').count();
    let text = &text[..text.len() - n_padding];
    // A last group of one digit has only six bits.
    if text.len() % 4 == 1 {
        return None;
    }
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for group in text.chunks(4) {
        let mut word = 0_u32;
        for &digit in group {
            word = word << 6 | u32::from(base64_value(digit)?);
        }
        let [_, decoded @ ..] = (word << (6 * (4 - group.len()))).to_be_bytes();
        bytes.extend_from_slice(&decoded[..group.len() - 1]);
    }
    Some(bytes)
}

/// Value of a base64 digit.
fn base64_value(digit: u8) -> Option<u8> {
    match digit {
        b'A'..=b'Z' => Some(digit - b'A'),
        b'a'..=b'z' => Some(digit - b'a' + 26),
        b'0'..=b'9' => Some(digit - b'0' + 52),
        b'+' | b'-' => Some(62),
        b'/' | b'_' => Some(63),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use crate::read::input::ReadOptions;

    /// A length as a little-endian word.
    fn word(length: usize) -> [u8; 4] {
        u32::try_from(length).unwrap().to_le_bytes()
    }

    /// A GLB with these chunks.
    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let body: Vec<u8> =
            chunks.iter().flat_map(|(kind, content)| [&word(content.len()), &kind[..], content].concat()).collect();
        [&MAGIC[..], &2_u32.to_le_bytes(), &word(12 + body.len()), &body].concat()
    }

    fn split_named<'a>(name: &str, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
        split(Path::new(name), bytes)
    }

    #[test]
    fn splits_json_and_glb() {
        let both = glb(&[(b"JSON", b"{}  "), (b"BIN\0", &[1, 2, 3, 4])]);
        assert_eq!(split_named("a.glb", &both).unwrap(), Container { json: b"{}  ", bin: Some(&[1, 2, 3, 4]) });
        let unknown = glb(&[(b"JSON", b"{}"), (b"ABCD", b"x")]);
        assert_eq!(split_named("a.glb", &unknown).unwrap().bin, None);
        for (name, bytes) in [("a.gltf", &b"{}"[..]), ("a.glb", b"{}"), ("a.glb", b"\xef\xbb\xbf{}")] {
            assert_eq!(split_named(name, bytes).unwrap(), Container { json: b"{}", bin: None });
        }
    }

    #[test]
    fn ignores_bytes_after_the_declared_length() {
        let mut file = glb(&[(b"JSON", b"{}")]);
        file.extend(b"trailing");
        assert_eq!(split_named("a.glb", &file).unwrap(), Container { json: b"{}", bin: None });
    }

    #[test]
    fn rejects_every_truncation() {
        let full = glb(&[(b"JSON", b"{}  "), (b"BIN\0", &[1, 2, 3, 4])]);
        for length in 0..full.len() {
            assert!(split_named("a.glb", &full[..length]).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn rejects_invalid_headers() {
        assert!(split_named("a.glb", b"glTX").is_err());
        assert!(split_named("a.glb", &glb(&[(b"BIN\0", b"")])).is_err());
        let mut old = glb(&[(b"JSON", b"{}")]);
        old[4] = 1;
        assert!(matches!(split_named("a.glb", &old), Err(ReadError::Unsupported { .. })));
        let mut short = glb(&[(b"JSON", b"{}")]);
        short[8..12].copy_from_slice(&8_u32.to_le_bytes());
        assert!(split_named("a.glb", &short).is_err());
    }

    /// Encodes base64 from a string of bits, as an oracle for decoding.
    fn to_base64(bytes: &[u8]) -> String {
        let digits: Vec<char> = ('A'..='Z').chain('a'..='z').chain('0'..='9').chain(['+', '/']).collect();
        let bits: String = bytes.iter().map(|byte| format!("{byte:08b}")).collect();
        let mut text: String = bits
            .as_bytes()
            .chunks(6)
            .map(|six| {
                let six = format!("{:0<6}", std::str::from_utf8(six).unwrap());
                digits[usize::from_str_radix(&six, 2).unwrap()]
            })
            .collect();
        while !text.len().is_multiple_of(4) {
            text.push('=');
        }
        text
    }

    #[test]
    fn decodes_base64_examples_of_the_rfc() {
        // RFC 4648, section 10.
        for (plain, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(text.as_bytes()).unwrap(), plain.as_bytes());
            assert_eq!(to_base64(plain.as_bytes()), text);
        }
        for flawed in ["Z", "Zm9vY", "Z===", "Zm=v", "Zm9v\n", "@@@@"] {
            assert!(base64(flawed.as_bytes()).is_none(), "{flawed}");
        }
    }

    proptest! {
        #[test]
        fn base64_round_trip(bytes: Vec<u8>) {
            let text = to_base64(&bytes);
            prop_assert_eq!(base64(text.as_bytes()), Some(bytes.clone()));
            prop_assert_eq!(base64(text.trim_end_matches('=').as_bytes()), Some(bytes));
        }
    }

    #[test]
    fn rejects_paths_outside_the_folder_and_schemes() {
        let temp = tempfile::tempdir().unwrap();
        std::fs::create_dir(temp.path().join("scene")).unwrap();
        std::fs::write(temp.path().join("out.bin"), "out").unwrap();
        std::fs::write(temp.path().join("scene/a b.bin"), "in").unwrap();
        let folder = Folder::of(&temp.path().join("scene/x.gltf"), &ReadOptions::default()).unwrap();
        assert_eq!(load_uri("a%20b.bin", &folder).unwrap(), b"in");
        assert_eq!(load_uri("./a b.bin", &folder).unwrap(), b"in");
        assert_eq!(load_uri("A%20B.BIN", &folder).unwrap(), b"in", "a name in another case");
        for uri in [
            "../out.bin",
            "../OUT.bin",
            "scene/../../OUT.BIN",
            "%2e%2e/out.bin",
            "%2E%2E%2Fout.bin",
            "..%5Cout.bin",
            "/out.bin",
        ] {
            assert!(load_uri(uri, &folder).unwrap_err().contains("outside the folder"), "{uri}");
        }
        for uri in ["http://example.invalid/a.bin", "file:///out.bin", "C:\\out.bin"] {
            assert!(load_uri(uri, &folder).unwrap_err().contains("uri scheme"), "{uri}");
        }
        for uri in ["A%20B.bin", "C:\\maps\\a b.bin", "file:///home/someone/a%20b.bin", "../other/a b.bin"] {
            assert_eq!(load_image(uri, &folder).unwrap(), b"in", "{uri}");
        }
        assert!(load_image("http://example.invalid/a b.bin", &folder).unwrap_err().contains("uri scheme"));
    }

    /// RFC 2397 has both forms; programs break lines and use the alphabet of URLs.
    #[test]
    fn reads_data_uris() {
        let folder = Folder::of(Path::new("x.gltf"), &ReadOptions::default()).unwrap();
        assert_eq!(load_uri("data:application/octet-stream;base64,Zm9v", &folder).unwrap(), b"foo");
        for (uri, content) in [
            ("DATA:;Base64,Zm9v", &b"foo"[..]),
            ("data:image/png;charset=utf-8;base64,Zm\n 9v", b"foo"),
            ("data:;base64,-_%2b%2F", b"\xfb\xff\xbf"),
            ("data:text/plain,f%6fo", b"foo"),
            ("data:,", b""),
            ("data:application/octet-stream,%00%ff", b"\x00\xff"),
        ] {
            assert_eq!(load_uri(uri, &folder).as_deref(), Ok(content), "{uri}");
        }
        for uri in ["data:;base64", "data:;base64,@@@"] {
            assert!(load_uri(uri, &folder).unwrap_err().contains("base64"), "{uri}");
        }
    }
}
