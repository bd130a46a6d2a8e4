//! The two container formats of glTF: JSON, and GLB with a header, a JSON chunk and a binary chunk (glTF 2.0, section 4).

use std::path::Path;

use crate::read::ReadError;

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

/// Splits a file into its parts. A file without the GLB signature is JSON, unless its extension is `.glb`.
pub(super) fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<Container<'a>, ReadError> {
    if bytes.starts_with(MAGIC) {
        return split_glb(path, bytes);
    }
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb")) {
        return Err(ReadError::malformed(path, "header", "missing signature 'glTF'"));
    }
    Ok(Container { json: bytes, bin: None })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::gltf::tests::word;

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
        assert_eq!(split_named("a.gltf", b"{}").unwrap(), Container { json: b"{}", bin: None });
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
}
