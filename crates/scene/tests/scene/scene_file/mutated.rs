//! Mutated files never panic, and accepted files round-trip.

use proptest::prelude::*;

use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn mutated_files_are_read_or_rejected(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..4), 1..8)) {
        let mut bytes = FULL.as_bytes().to_vec();
        for (at, byte, kind) in edits {
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => bytes.insert(at, b"[]{}=.\"\n#'-0eE_"[usize::from(byte) % 15]),
                2 => drop(bytes.drain(at..bytes.len().min(at + usize::from(byte)))),
                _ => bytes.truncate(at.max(1)),
            }
            if bytes.is_empty() {
                bytes.push(b'\n');
            }
        }
        match SceneFile::parse(&bytes, Path::new("scene.toml")) {
            Ok(file) => {
                let text = file.to_toml();
                let back = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
                prop_assert_eq!(format!("{:?}", without_lines(back)), format!("{:?}", without_lines(file)));
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n'), "{}", error),
        }
    }
}
