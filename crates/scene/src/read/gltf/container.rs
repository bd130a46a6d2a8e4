//! The two wrappings of glTF: plain JSON, and GLB, a header with a JSON and a binary chunk (glTF 2.0, section 4).

use std::path::Path;

use crate::read::ReadError;

/// First bytes of a GLB.
const MAGIC: &[u8; 4] = b"glTF";
/// Type of the chunk that must come first.
const JSON: u32 = u32::from_le_bytes(*b"JSON");
/// Type of the chunk that may come second.
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// The parts of a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Container<'a> {
    /// The JSON text.
    pub(super) json: &'a [u8],
    /// Content of the binary chunk, with up to three bytes of padding.
    pub(super) bin: Option<&'a [u8]>,
}

/// Finds the parts of a file. A file that does not start as a GLB is JSON, unless its name says `.glb`.
pub(super) fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
    if bytes.starts_with(MAGIC) {
        return split_glb(path, bytes);
    }
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb")) {
        return Err(ReadError::malformed(path, "header", "does not start with `glTF`"));
    }
    Ok(Container { json: bytes, bin: None })
}

fn split_glb<'a>(path: &Path, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
    let ends_early = |place: &str| ReadError::malformed(path, place, "the file ends inside it");
    let ([_, version, length], _) = words(bytes).ok_or_else(|| ends_early("header"))?;
    if version != 2 {
        return Err(ReadError::unsupported(path, format!("version {version} of GLB")));
    }
    let whole = usize::try_from(length).ok().and_then(|length| bytes.get(..length)).ok_or_else(|| {
        ReadError::malformed(path, "header", format!("promises {length} bytes, the file has {}", bytes.len()))
    })?;
    let rest = whole.get(12..).ok_or_else(|| ends_early("header"))?;
    let (kind, json, rest) = chunk(rest).ok_or_else(|| ends_early("JSON chunk"))?;
    if kind != JSON {
        return Err(ReadError::malformed(path, "first chunk", format!("has type {kind:#010x}, not JSON")));
    }
    if rest.is_empty() {
        return Ok(Container { json, bin: None });
    }
    // Chunks of unknown type are to be ignored.
    let (kind, content, _) = chunk(rest).ok_or_else(|| ends_early("second chunk"))?;
    Ok(Container { json, bin: (kind == BIN).then_some(content) })
}

/// Type and content of the first chunk, and what follows it.
fn chunk(bytes: &[u8]) -> Option<(u32, &[u8], &[u8])> {
    let ([length, kind], rest) = words(bytes)?;
    let (content, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    Some((kind, content, rest))
}

/// The first `N` little endian words, and what follows them.
fn words<const N: usize>(bytes: &[u8]) -> Option<([u32; N], &[u8])> {
    let (head, rest) = bytes.split_at_checked(4 * N)?;
    let (words, _) = head.as_chunks();
    Some((std::array::from_fn(|k| u32::from_le_bytes(words[k])), rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::gltf::tests::word;

    /// A GLB of these chunks.
    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let body: Vec<u8> =
            chunks.iter().flat_map(|(kind, content)| [&word(content.len()), &kind[..], content].concat()).collect();
        [&MAGIC[..], &2_u32.to_le_bytes(), &word(12 + body.len()), &body].concat()
    }

    fn split_named<'a>(name: &str, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
        split(Path::new(name), bytes)
    }

    #[test]
    fn parts_are_found() {
        let both = glb(&[(b"JSON", b"{}  "), (b"BIN\0", &[1, 2, 3, 4])]);
        assert_eq!(split_named("a.glb", &both).unwrap(), Container { json: b"{}  ", bin: Some(&[1, 2, 3, 4]) });
        let unknown = glb(&[(b"JSON", b"{}"), (b"ABCD", b"x")]);
        assert_eq!(split_named("a.glb", &unknown).unwrap().bin, None);
        assert_eq!(split_named("a.gltf", b"{}").unwrap(), Container { json: b"{}", bin: None });
    }

    #[test]
    fn bytes_behind_the_promised_length_are_ignored() {
        let mut file = glb(&[(b"JSON", b"{}")]);
        file.extend(b"trailing");
        assert_eq!(split_named("a.glb", &file).unwrap(), Container { json: b"{}", bin: None });
    }

    #[test]
    fn every_truncation_is_refused() {
        let whole = glb(&[(b"JSON", b"{}  "), (b"BIN\0", &[1, 2, 3, 4])]);
        for length in 0..whole.len() {
            assert!(split_named("a.glb", &whole[..length]).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn wrong_headers_are_refused() {
        assert!(split_named("a.glb", b"glTX").is_err());
        assert!(split_named("a.glb", &glb(&[(b"BIN\0", b"")])).is_err());
        let mut old = glb(&[(b"JSON", b"{}")]);
        old[4] = 1;
        assert!(matches!(split_named("a.glb", &old), Err(ReadError::Unsupported { .. })));
        let mut short = glb(&[(b"JSON", b"{}")]);
        short[8..12].copy_from_slice(&8_u32.to_le_bytes());
        assert!(split_named("a.glb", &short).is_err());
    }
}
