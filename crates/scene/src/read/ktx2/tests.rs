//! Files made here, and three of the reference encoder with the texels that its own decoder gives.

use std::fs;
use std::path::Path;

use proptest::prelude::*;

use super::*;

/// Words of the header of Vulkan formats.
const R8_UNORM: u32 = 9;
const RG8_UNORM: u32 = 16;
const RGBA8_SRGB: u32 = 43;
const BGR8_UNORM: u32 = 30;
const BC7: u32 = 145;

/// A file under construction.
#[derive(Clone)]
pub(crate) struct File {
    format: u32,
    /// Width, height, depth, layers, faces.
    counts: [u32; 5],
    scheme: u32,
    pairs: &'static [(&'static str, &'static str)],
    data: Vec<u8>,
}

impl File {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut pairs = Vec::new();
        for (key, value) in self.pairs {
            let pair = [key.as_bytes(), b"\0", value.as_bytes(), b"\0"].concat();
            pairs.extend(u32::try_from(pair.len()).unwrap().to_le_bytes());
            pairs.extend(&pair);
            pairs.resize(pairs.len().next_multiple_of(4), 0);
        }
        // A basic descriptor without samples: 4 bytes of length, then 24.
        let descriptor: Vec<u8> = [28_u32, 0, 2 | 24 << 16, 1 | 1 << 8 | 2 << 16, 0, 4, 0]
            .iter()
            .flat_map(|word| word.to_le_bytes())
            .collect();
        let [descriptor_at, pairs_at] = [104, 104 + descriptor.len()];
        let data_at = (pairs_at + pairs.len()).next_multiple_of(8);
        let [width, height, depth, layers, faces] = self.counts;
        let words = [self.format, 1, width, height, depth, layers, faces, 1, self.scheme];
        let index = [descriptor_at, descriptor.len(), pairs_at, pairs.len()].map(|x| u32::try_from(x).unwrap());
        let longs = [0, 0, data_at, self.data.len(), self.data.len()].map(|x| x as u64);
        let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
        bytes.extend(words.iter().chain(&index).flat_map(|word| word.to_le_bytes()));
        bytes.extend(longs.iter().flat_map(|long| long.to_le_bytes()));
        bytes.extend(descriptor);
        bytes.extend(pairs);
        bytes.resize(data_at, 0);
        bytes.extend(&self.data);
        bytes
    }
}

/// Two texels in a column.
pub(crate) fn column() -> File {
    let data = vec![10, 20, 30, 40, 50, 60, 70, 80];
    File { format: RGBA8_SRGB, counts: [1, 2, 0, 0, 1], scheme: 0, pairs: &[], data }
}

/// A frame of Zstandard: one block, stored or a repeated byte.
fn frame(content: &[u8], repeats: Option<u32>) -> Vec<u8> {
    let n = repeats.unwrap_or_else(|| u32::try_from(content.len()).unwrap());
    let header = 1 | u32::from(repeats.is_some()) << 1 | n << 3;
    [&[0x28, 0xb5, 0x2f, 0xfd, 0xa0][..], &n.to_le_bytes(), &header.to_le_bytes()[..3], content].concat()
}

fn texels(file: &File) -> Vec<[u8; 4]> {
    decode("a", &file.bytes()).unwrap().texels
}

#[test]
fn reads_plain_formats() {
    let decoded = decode("a", &column().bytes()).unwrap();
    assert_eq!((decoded.width, decoded.height, decoded.encoding), (1, 2, Encoding::Srgb));
    assert_eq!(decoded.texels, [[10, 20, 30, 40], [50, 60, 70, 80]]);
    let gray = File { format: R8_UNORM, data: vec![1, 2], ..column() };
    assert_eq!(decode("a", &gray.bytes()).unwrap().encoding, Encoding::Linear);
    assert_eq!(texels(&gray), [[1, 0, 0, 255], [2, 0, 0, 255]]);
    assert_eq!(
        texels(&File { format: RG8_UNORM, data: vec![1, 2, 3, 4], ..column() }),
        [[1, 2, 0, 255], [3, 4, 0, 255]]
    );
    let bgr = File { format: BGR8_UNORM, data: vec![1, 2, 3, 4, 5, 6], ..column() };
    assert_eq!(texels(&bgr), [[3, 2, 1, 255], [6, 5, 4, 255]]);
}

#[test]
fn channels_and_orientation_of_the_file_are_applied() {
    let gray = File { format: R8_UNORM, data: vec![1, 2], pairs: &[("KTXswizzle", "rrr1")], ..column() };
    assert_eq!(texels(&gray), [[1, 1, 1, 255], [2, 2, 2, 255]]);
    let upward = File { pairs: &[("KTXorientation", "ru")], ..column() };
    assert_eq!(texels(&upward), [[50, 60, 70, 80], [10, 20, 30, 40]]);
    let mirrored = File { counts: [2, 1, 0, 0, 1], pairs: &[("KTXorientation", "ld")], ..column() };
    assert_eq!(texels(&mirrored), [[50, 60, 70, 80], [10, 20, 30, 40]]);
    let unknown = File { pairs: &[("KTXswizzle", "rgbx")], ..column() };
    assert_eq!(decode("a", &unknown.bytes()).unwrap_err(), "unknown KTXswizzle \"rgbx\"");
}

#[test]
fn decompresses_zstandard() {
    let packed = File { scheme: 2, data: frame(&column().data, None), ..column() };
    assert_eq!(texels(&packed), texels(&column()));
    let repeated = File { scheme: 2, data: frame(&[7], Some(8)), ..column() };
    assert_eq!(texels(&repeated), [[7; 4]; 2]);
    let short = File { scheme: 2, data: frame(&[7], Some(7)), ..column() };
    assert_eq!(decode("a", &short.bytes()).unwrap_err(), "unexpected end of image data");
    let broken = File { scheme: 2, ..column() };
    assert!(decode("a", &broken.bytes()).unwrap_err().starts_with("malformed Zstandard data: "));
}

#[test]
fn other_files_are_refused_by_name() {
    for (file, words) in [
        (File { format: BC7, ..column() }, "KTX2 format BC7_UNORM_BLOCK is not supported"),
        (File { scheme: 3, ..column() }, "KTX2 compressed by ZLIB is not supported; use Zstandard"),
        (File { counts: [1, 2, 0, 0, 6], ..column() }, "layers or faces are not supported"),
        (File { counts: [1, 2, 2, 0, 1], ..column() }, "layers or faces are not supported"),
        (File { counts: [1, 0, 0, 0, 1], ..column() }, "layers or faces are not supported"),
        (File { counts: [1 << 14, 1 << 14, 0, 0, 1], ..column() }, "invalid image size 16384 x 16384"),
        (File { counts: [1, 3, 0, 0, 1], ..column() }, "unexpected end of image data"),
        (File { format: 0, ..column() }, "is not supported; use ETC1S or UASTC"),
    ] {
        let error = decode("a", &file.bytes()).unwrap_err();
        assert!(error.contains(words), "{words}: {error}");
    }
}

/// The files of the reference encoder.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/ktx2");
    ["etc1s", "etc1s_alpha", "uastc"]
        .map(|name| (name, fs::read(folder.join(name).with_extension("ktx2")).unwrap()))
        .to_vec()
}

#[test]
fn texels_of_basis_universal_are_those_of_the_reference_decoder() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/ktx2");
    for (name, bytes) in samples() {
        let decoded = decode(name, &bytes).unwrap();
        let png = fs::read(folder.join(name).with_extension("png")).unwrap();
        let want = crate::read::image::decode(name, &png).unwrap();
        assert_eq!((decoded.width, decoded.height, decoded.encoding), (12, 8, Encoding::Srgb), "{name}");
        assert!(decoded.texels == want.texels, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn mutated_files_never_panic(which in 0..4_usize, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5), length: prop::sample::Index, cut: bool) {
        let mut bytes = samples().get(which).map_or_else(|| column().bytes(), |(_, bytes)| bytes.clone());
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if cut {
            bytes.truncate(length.index(bytes.len()));
        }
        if let Ok(texture) = decode("a", &bytes) {
            prop_assert_eq!(texture.texels.len() as u64, u64::from(texture.width) * u64::from(texture.height));
        }
    }
}
