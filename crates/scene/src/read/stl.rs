//! STL, ASCII and binary.
//!
//! ```text
//! bytes -> ascii or binary -> welded triangles -> mesh
//! ```
//!
//! Gives one mesh with one instance, in file order, also for several solids. Vertices with equal bits are welded. Normals are
//! those of the triangles, so the file's are ignored, and so are attributes such as colors.
//!
//! Source: 3D Systems, StereoLithography Interface Specification, 1989.

use std::hash::{BuildHasher, RandomState};
use std::path::Path;

use super::error::{ReadError, WarningGroups};
use super::mesh::{MeshChecks, single_mesh};
use super::text::{self, quoted};
use crate::{Material, Mesh, Scene};

/// Bytes examined for the format: more than the header of a binary file.
const HEAD_BYTES: usize = 1024;

/// Parses an STL file; `path` is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let mut triangles = Triangles::new();
    let mut scene = Scene::default();
    let text = without_padding(bytes);
    match ascii_start(text).filter(|_| !has_declared_size(bytes, bytes.len() as u64)) {
        Some(start) => read_ascii(path, Words { bytes: text, at: start }, &mut triangles, &mut scene.warnings)?,
        None => read_binary(path, bytes, &mut triangles, &mut scene.warnings)?,
    }
    let Triangles { weld, triangles, checks } = triangles;
    let mesh = Mesh { positions: weld.finish(), triangles, ..Mesh::default() };
    single_mesh(path, mesh, vec![Material::default()], checks, scene)
}

/// A file without the zeros and the DOS end of file (Ctrl-Z) after its text.
fn without_padding(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().rposition(|byte| !matches!(byte, 0 | 0x1a) && !byte.is_ascii_whitespace());
    &bytes[..end.map_or(0, |last| last + 1)]
}

/// Where the statements of an ASCII file begin: at a line with `solid` or `facet`. `None` for a binary file, which has a
/// zero byte.
///
/// Headers of binary files may begin with `solid` too, but their triangle count has a zero byte up to 2^24 triangles.
fn ascii_start(bytes: &[u8]) -> Option<usize> {
    if bytes[..bytes.len().min(HEAD_BYTES)].contains(&0) {
        return None;
    }
    let mut start = bytes.len() - text::after_mark(bytes).len();
    for line in text::physical_lines(&bytes[start..]) {
        if is_statement(line) {
            return Some(start);
        }
        start += line.len();
    }
    None
}

/// Whether a line begins as the first statement of a file does.
fn is_statement(line: &[u8]) -> bool {
    let (word, _) = text::split_word(line);
    [&b"solid"[..], b"facet"].iter().any(|known| word.eq_ignore_ascii_case(known))
}

/// Whether the first bytes of a file of `n_bytes` are STL: ASCII that begins with a solid and has a facet, or binary of the size that it
/// declares.
pub(super) fn is_stl(head: &[u8], n_bytes: u64) -> bool {
    let is_text = || text::after_mark(head).trim_ascii_start().to_ascii_lowercase().starts_with(b"solid");
    let has_facet = || head.to_ascii_lowercase().windows(5).any(|word| word == b"facet");
    has_declared_size(head, n_bytes) || is_text() && !head.contains(&0) && has_facet()
}

/// Triangles with welded vertices.
struct Triangles {
    weld: Weld,
    triangles: Vec<[u32; 3]>,
    checks: MeshChecks,
}

impl Triangles {
    fn new() -> Self {
        Self { weld: Weld::new(), triangles: Vec::new(), checks: MeshChecks::default() }
    }

    /// Adds a triangle unless a vertex is not finite; `None` for too many vertices.
    fn add(&mut self, corners: [[f32; 3]; 3]) -> Option<()> {
        if self.checks.keeps(corners) {
            self.push(corners)?;
        }
        Some(())
    }

    fn push(&mut self, [a, b, c]: [[f32; 3]; 3]) -> Option<()> {
        let triangle = [self.weld.index(a)?, self.weld.index(b)?, self.weld.index(c)?];
        self.triangles.push(triangle);
        Some(())
    }
}

/// The error for `None` of [`Triangles`].
fn too_many(path: &Path) -> ReadError {
    ReadError::unsupported(path, "more than 2^32 vertices")
}

/// The unread words of a file.
#[derive(Clone, Copy)]
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let (word, rest) = text::split_word(&self.bytes[self.at..]);
        if word.is_empty() {
            return None;
        }
        self.at = self.bytes.len() - rest.len();
        Some(word)
    }

    /// As [`Words::next`], unless a line ends before the word.
    fn next_on_line(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let first = rest.iter().find(|&&byte| matches!(byte, b'\n' | b'\r') || !byte.is_ascii_whitespace());
        if first.is_none_or(u8::is_ascii_whitespace) { None } else { self.next() }
    }

    /// Skips words of the line up to one that `ends_before`, given the words after it.
    fn skip_line_until(&mut self, ends_before: impl Fn(&[u8], Self) -> bool) {
        let mut ahead = *self;
        while let Some(word) = ahead.next_on_line() {
            if ends_before(word, ahead) {
                return;
            }
            *self = ahead;
        }
    }

    /// Skips the name of a solid: the rest of the line, or where all of a file is one line, the words before a facet.
    fn skip_name(&mut self) {
        self.skip_line_until(|word, mut after| {
            keyword(word) == Some(Keyword::Facet)
                && after.next().and_then(keyword) == Some(Keyword::Normal)
                && after.next().is_some_and(|word| text::float(word).is_some())
        });
    }

    /// The line of the last word, from 1.
    fn line(&self) -> String {
        format!("line {}", text::physical_lines(&self.bytes[..self.at]).count().max(1))
    }

    fn malformed(&self, path: &Path, message: impl Into<String>) -> ReadError {
        ReadError::malformed(path, self.line(), message)
    }
}

/// Keywords, the frequent ones first.
#[derive(Clone, Copy, PartialEq)]
enum Keyword {
    Vertex,
    Facet,
    Normal,
    Outer,
    Loop,
    EndLoop,
    EndFacet,
    Solid,
    EndSolid,
    /// The first of the two words that some programs write for one of the last four.
    End,
    Color,
}

const KEYWORDS: [(&[u8], Keyword); 12] = [
    (b"vertex", Keyword::Vertex),
    (b"facet", Keyword::Facet),
    (b"normal", Keyword::Normal),
    (b"outer", Keyword::Outer),
    (b"loop", Keyword::Loop),
    (b"endloop", Keyword::EndLoop),
    (b"endfacet", Keyword::EndFacet),
    (b"solid", Keyword::Solid),
    (b"endsolid", Keyword::EndSolid),
    (b"end", Keyword::End),
    (b"color", Keyword::Color),
    (b"colour", Keyword::Color),
];

/// The keyword that a word is, in any case.
fn keyword(word: &[u8]) -> Option<Keyword> {
    KEYWORDS.iter().find(|(name, _)| name.eq_ignore_ascii_case(word)).map(|&(_, keyword)| keyword)
}

/// Whether a word begins a comment, which lasts to the end of the line.
fn is_comment(word: &[u8]) -> bool {
    [&b"#"[..], b"//", b";", b"!"].iter().any(|mark| word.starts_with(mark))
}

/// Reads all facets of all solids: words separated by white space. Keywords are accepted in any case, facets with more than three
/// vertices are triangulated.
fn read_ascii(
    path: &Path,
    mut words: Words,
    triangles: &mut Triangles,
    warnings: &mut Vec<String>,
) -> Result<(), ReadError> {
    let (mut polygon, mut cuts, mut ignored) = (Vec::new(), Vec::new(), Ignored::default());
    let before = text::physical_lines(text::after_mark(&words.bytes[..words.at]));
    let is_text = |line: &&[u8]| !line.trim_ascii().is_empty() && !is_comment(line.trim_ascii_start());
    if before.filter(is_text).count() > 0 {
        ignored.add("ignoring text before the first solid", "line 1");
    }
    let (mut is_in_facet, mut has_solid) = (false, false);
    let mut last = Keyword::Solid;
    while let Some(word) = words.next() {
        if is_comment(word) {
            words.skip_line_until(|_, _| false);
            continue;
        }
        let mut known = keyword(word);
        if known == Some(Keyword::End) {
            known = match words.next().and_then(keyword) {
                Some(Keyword::Loop) => Some(Keyword::EndLoop),
                Some(Keyword::Facet) => Some(Keyword::EndFacet),
                Some(Keyword::Solid) => Some(Keyword::EndSolid),
                _ => None,
            };
        }
        let Some(keyword) = known else {
            if text::float(word).is_none() {
                return Err(words.malformed(path, format!("unknown statement {}", quoted(word))));
            }
            ignored.add_at("ignoring surplus numbers", &words);
            continue;
        };
        match keyword {
            Keyword::Vertex => polygon.push(vertex(path, &mut words)?),
            Keyword::Facet | Keyword::Outer => {
                if !polygon.is_empty() {
                    return Err(words.malformed(path, format!("expected 'endloop', found {}", quoted(word))));
                }
                is_in_facet = true;
            }
            // Ignored, so it may be any three words.
            Keyword::Normal => {
                for _ in 0..3 {
                    words.next();
                }
            }
            Keyword::EndLoop => {
                close(&polygon, &mut cuts, triangles).ok_or_else(|| too_many(path))?;
                polygon.clear();
            }
            Keyword::EndFacet if !polygon.is_empty() => {
                return Err(words.malformed(path, format!("expected 'endloop', found {}", quoted(word))));
            }
            Keyword::EndFacet => is_in_facet = false,
            Keyword::Solid | Keyword::EndSolid => {
                words.skip_name();
                has_solid = true;
            }
            Keyword::Color => {
                ignored.add_at("ignoring colors", &words);
                words.skip_line_until(|word, _| self::keyword(word).is_some());
            }
            Keyword::Loop | Keyword::End => {}
        }
        last = keyword;
    }
    if is_in_facet || !polygon.is_empty() {
        return Err(words.malformed(path, "unexpected end of file in a facet"));
    }
    if has_solid && last != Keyword::EndSolid {
        ignored.add_at("missing 'endsolid'", &words);
    }
    ignored.groups.finish(warnings);
    Ok(())
}

/// What is ignored, each kind once. A location is only found for the first of a kind, as it takes time.
#[derive(Default)]
struct Ignored {
    groups: WarningGroups,
    known: Vec<&'static str>,
}

impl Ignored {
    fn add_at(&mut self, what: &'static str, words: &Words) {
        if !self.known.contains(&what) {
            self.add(what, &words.line());
        }
    }

    fn add(&mut self, what: &'static str, location: &str) {
        self.known.push(what);
        self.groups.add(what, location);
    }
}

fn vertex(path: &Path, words: &mut Words) -> Result<[f32; 3], ReadError> {
    let mut position = [0.0; 3];
    for coordinate in &mut position {
        let word = words.next().ok_or_else(|| words.malformed(path, "unexpected end of file in a vertex"))?;
        *coordinate = text::float(word)
            .ok_or_else(|| words.malformed(path, format!("vertex: expected a number, found {}", quoted(word))))?;
    }
    Ok(position)
}

/// Adds the triangles of a facet; `None` for too many vertices.
fn close(polygon: &[[f32; 3]], cuts: &mut Vec<[[f32; 3]; 3]>, triangles: &mut Triangles) -> Option<()> {
    cuts.clear();
    triangles.checks.cut(polygon, |position| position, cuts);
    cuts.iter().try_for_each(|&corners| triangles.push(corners))
}

/// Header and count.
const START_BYTES: usize = 84;
/// Normal, three vertices and an attribute of two bytes.
const TRIANGLE_BYTES: usize = 50;

/// The declared number of triangles.
fn count(bytes: &[u8]) -> Option<u32> {
    bytes.get(80..START_BYTES)?.try_into().ok().map(u32::from_le_bytes)
}

/// Whether a file of `n_bytes` with this start has exactly the size that it declares.
fn has_declared_size(start: &[u8], n_bytes: u64) -> bool {
    let expected = |n: u32| u64::from(n) * TRIANGLE_BYTES as u64 + START_BYTES as u64;
    count(start).is_some_and(|n| n_bytes == expected(n))
}

/// Reads all triangles of a binary file: a header of 80 bytes, a count, and 50 bytes per triangle, little-endian.
///
/// Where the count does not agree with the data, which is so if a program does not know it when it begins to write, the data counts, unless
/// bytes after the declared triangles are no whole triangles. Either is reported, as attributes are.
fn read_binary(
    path: &Path,
    bytes: &[u8],
    triangles: &mut Triangles,
    warnings: &mut Vec<String>,
) -> Result<(), ReadError> {
    let n_declared = count(bytes).ok_or_else(|| {
        let message = format!("{} bytes, but a binary STL file has at least {START_BYTES}", bytes.len());
        ReadError::malformed(path, "header", message)
    })?;
    let (records, rest) = bytes[START_BYTES..].as_chunks::<TRIANGLE_BYTES>();
    let n_held = records.len() as u64;
    let differ = format!("{n_declared} triangles declared, but the remaining data holds {n_held}");
    if n_held == 0 && n_declared > 0 {
        return Err(ReadError::malformed(path, "header", differ));
    }
    let mut n = records.len();
    if u64::from(n_declared) < n_held && n_declared > 0 && !rest.is_empty() {
        n = n_declared as usize;
    }
    if u64::from(n_declared) != n as u64 {
        warnings.push(format!("reading all whole triangles: {differ}"));
    } else if n < records.len() || !rest.is_empty() {
        warnings.push("ignoring bytes after the last declared triangle".to_owned());
    }
    triangles.triangles.reserve_exact(n);
    let mut n_attributes = 0_usize;
    for record in &records[..n] {
        let (numbers, attribute) = record.as_chunks::<4>();
        // The first three numbers are the normal.
        let number = |k: usize| f32::from_le_bytes(numbers[k]);
        let corner = |k: usize| [number(3 * k + 3), number(3 * k + 4), number(3 * k + 5)];
        triangles.add([corner(0), corner(1), corner(2)]).ok_or_else(|| too_many(path))?;
        n_attributes += usize::from(attribute != [0, 0]);
    }
    if n_attributes > 0 {
        warnings.push(format!("ignoring attributes of triangles (colors): {n_attributes}"));
    }
    Ok(())
}

/// An unused slot.
const EMPTY: u32 = u32::MAX;

/// Distinct positions in order of first occurrence, with a hash table of their indices (open addressing, linear probing).
///
/// Positions are equal if all their bits are, so 0.0 and -0.0 differ. The hash has random seeds, so that no file can be made
/// to collide; the indices do not depend on them.
struct Weld {
    positions: Vec<[f32; 3]>,
    /// Indices into `positions`; a power of two, at least half of them unused.
    slots: Vec<u32>,
    seeds: [u64; 2],
}

impl Weld {
    fn new() -> Self {
        let random = RandomState::new();
        Self { positions: Vec::new(), slots: vec![EMPTY; 16], seeds: [0, 1].map(|k| random.hash_one(k)) }
    }

    /// The index of a position; `None` for more than 2^32 - 1 positions.
    fn index(&mut self, position: [f32; 3]) -> Option<u32> {
        let bits = position.map(f32::to_bits);
        let mut slot = self.hash(bits);
        loop {
            slot &= self.slots.len() - 1;
            match self.slots[slot] {
                EMPTY => break,
                index if self.positions[index as usize].map(f32::to_bits) == bits => return Some(index),
                _ => slot += 1,
            }
        }
        let index = u32::try_from(self.positions.len()).ok().filter(|&index| index != EMPTY)?;
        self.slots[slot] = index;
        self.positions.push(position);
        if self.positions.len() > self.slots.len() / 2 {
            self.grow();
        }
        Some(index)
    }

    /// All positions by index.
    fn finish(self) -> Vec<[f32; 3]> {
        self.positions
    }

    /// Doubles the table.
    fn grow(&mut self) {
        let mask = 2 * self.slots.len() - 1;
        self.slots = vec![EMPTY; mask + 1];
        for (&position, index) in self.positions.iter().zip(0..) {
            let mut slot = self.hash(position.map(f32::to_bits)) & mask;
            while self.slots[slot] != EMPTY {
                slot = (slot + 1) & mask;
            }
            self.slots[slot] = index;
        }
    }

    /// Both halves of a product of seeded words, combined.
    fn hash(&self, [x, y, z]: [u32; 3]) -> usize {
        let low = (u64::from(x) | u64::from(y) << 32) ^ self.seeds[0];
        let product = u128::from(low) * u128::from(u64::from(z) ^ self.seeds[1]);
        (product as u64 ^ (product >> 64) as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use proptest::prelude::*;

    use super::*;
    use crate::read::testing::{QUADS, corner, rejects_truncations};

    /// Few distinct values, both zeros and numbers that are not finite, so that equal positions are frequent.
    fn repeated() -> impl Strategy<Value = f32> {
        prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, 1e7, 1e7 + 1.0, 1e-30, f32::NAN, f32::INFINITY])
    }

    proptest! {
        #[test]
        fn matches_a_hash_map(positions in prop::collection::vec([repeated(), repeated(), repeated()], 0..600)) {
            let (mut weld, mut first, mut distinct) = (Weld::new(), HashMap::new(), Vec::new());
            for &position in &positions {
                let bits = position.map(f32::to_bits);
                let want = *first.entry(bits).or_insert_with(|| {
                    distinct.push(bits);
                    distinct.len() - 1
                });
                prop_assert_eq!(weld.index(position).map(|index| index as usize), Some(want));
            }
            let got: Vec<_> = weld.finish().into_iter().map(|position| position.map(f32::to_bits)).collect();
            prop_assert_eq!(got, distinct);
        }
    }

    #[test]
    fn zeros_of_both_signs_stay_apart() {
        let mut weld = Weld::new();
        assert_ne!(weld.index([0.0; 3]), weld.index([-0.0, 0.0, 0.0]));
    }

    /// Corners of the triangles of a unit cube.
    fn cube() -> Vec<[[f32; 3]; 3]> {
        QUADS.iter().flat_map(|&[a, b, c, d]| [[a, b, c].map(corner), [a, c, d].map(corner)]).collect()
    }

    fn binary(header: &[u8], triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, 0);
        bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii(triangles: &[[[f32; 3]; 3]]) -> String {
        let facet = |triangle: &[[f32; 3]; 3]| {
            let vertices: String =
                triangle.iter().map(|[x, y, z]| format!("      vertex {x:e} {y:e} {z:e}\n")).collect();
            format!("  facet normal 0 0 0\n    outer loop\n{vertices}    endloop\n  endfacet\n")
        };
        format!("solid a facet\n{}endsolid a\n", triangles.iter().map(facet).collect::<String>())
    }

    fn stl(bytes: impl AsRef<[u8]>) -> Result<Scene, ReadError> {
        parse(Path::new("model.stl"), bytes.as_ref())
    }

    /// Bits of the corners of all triangles of the mesh.
    fn corners(scene: &Scene) -> Vec<[[u32; 3]; 3]> {
        let mesh = &scene.meshes[0];
        mesh.triangles.iter().map(|t| t.map(|k| mesh.positions[k as usize].map(f32::to_bits))).collect()
    }

    #[track_caller]
    fn is_cube(scene: Result<Scene, ReadError>, warnings: &[&str]) {
        let scene = scene.unwrap();
        assert_eq!(scene.warnings, warnings);
        assert_eq!(scene.meshes[0].positions.len(), 8, "vertices are welded");
        assert_eq!(corners(&scene), cube().iter().map(|t| t.map(|p| p.map(f32::to_bits))).collect::<Vec<_>>());
        assert_eq!(scene.meshes[0].name, "model");
    }

    #[test]
    fn both_encodings_agree() {
        is_cube(stl(ascii(&cube())), &[]);
        is_cube(stl(binary(b"", &cube())), &[]);
        is_cube(stl(binary(b"solid but binary\nfacet", &cube())), &[]);
        is_cube(stl(ascii(&cube()).replace('\n', "\r\n")), &[]);
        is_cube(stl(ascii(&cube()).replace('\n', "\r")), &[]);
        is_cube(stl(ascii(&cube()).to_uppercase()), &[]);
        is_cube(stl(format!("\u{feff}\n{}", ascii(&cube()))), &[]);
        let text = ascii(&cube());
        let (name, rest) = text.split_once('\n').unwrap();
        is_cube(stl(format!("{name}\n{}", rest.split_whitespace().collect::<Vec<_>>().join("\t"))), &[]);
    }

    /// What programs write besides the specification: one cube for each.
    #[test]
    fn reads_what_programs_write() {
        let text = ascii(&cube());
        let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let facets = &text["solid a facet\n".len()..text.len() - "endsolid a\n".len()];
        for (what, bytes, warnings) in [
            ("end solid", text.replace("endsolid", "end solid"), &[][..]),
            ("END LOOP", text.replace("endloop", "END LOOP").replace("endfacet", "End Facet"), &[]),
            (
                "color after a loop",
                text.replacen("  endfacet", "  color 1 0 0\n  endfacet", 2),
                &["ignoring colors: line 8"],
            ),
            ("color of a solid", text.replacen('\n', "\ncolour red\n", 1), &["ignoring colors: line 2"]),
            ("comments first", format!("# a mesh\n\n// in mm\n{text}"), &[]),
            ("comments between", text.replace("  endloop", "# c\n  endloop"), &[]),
            ("text first", format!("made by hand\n{text}"), &["ignoring text before the first solid: line 1"]),
            ("no solid", facets.to_owned(), &[]),
            ("one line", one_line(&text), &[]),
            ("one line without a name", one_line(&format!("solid\n{facets}endsolid")), &[]),
            ("one line without a solid", one_line(facets), &[]),
            ("one line after a comment", format!("# c\r{}", one_line(&text)), &[]),
            ("two solids on a line", one_line(&format!("solid facet 1\nendsolid\n{text}")), &[]),
        ] {
            let scene = stl(&bytes).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(scene.warnings, warnings, "{what}");
            is_cube(Ok(scene), warnings);
        }
        let beyond_the_head = format!("{}{text}", "# a comment of many lines\n".repeat(100));
        is_cube(stl(beyond_the_head), &[]);
    }

    #[test]
    fn the_data_counts_where_the_number_of_triangles_does_not_agree() {
        let declared = |n: u32, more: &[u8]| {
            let mut bytes = [binary(b"", &cube()), more.to_vec()].concat();
            bytes[80..84].copy_from_slice(&n.to_le_bytes());
            stl(bytes)
        };
        let reads_all =
            |n: u32| format!("reading all whole triangles: {n} triangles declared, but the remaining data holds 12");
        for n in [0, 5, 13, u32::MAX] {
            is_cube(declared(n, &[]), &[&reads_all(n)]);
        }
        is_cube(declared(0, &[1; 7]), &[&reads_all(0)]);
        is_cube(declared(13, &[1; 7]), &[&reads_all(13)]);
        let five = declared(5, &[1; 7]).unwrap();
        assert_eq!(
            (five.warnings, five.meshes[0].triangles.len()),
            (vec!["ignoring bytes after the last declared triangle".to_owned()], 5)
        );
    }

    #[test]
    fn repairs_are_reported() {
        let text = ascii(&cube());
        is_cube(stl(text.trim_end().trim_end_matches("endsolid a")), &["missing 'endsolid': line 85"]);
        is_cube(
            stl(text.replace("vertex 0e0 0e0 1e0\n", "vertex 0e0 0e0 1e0 7\n")),
            &["ignoring surplus numbers: line 18"],
        );
        is_cube(stl([binary(b"", &cube()), vec![1]].concat()), &["ignoring bytes after the last declared triangle"]);
        let mut colored = binary(b"COLOR=", &cube());
        colored[84 + 48] = 1;
        is_cube(stl(colored), &["ignoring attributes of triangles (colors): 1"]);

        let mut bad = cube();
        bad[3][1][2] = f32::NAN;
        bad[5][0] = bad[5][1];
        for bytes in [ascii(&bad).replace("NaN", "nan").into_bytes(), binary(b"", &bad)] {
            let scene = stl(bytes).unwrap();
            assert_eq!(
                scene.warnings,
                ["skipping triangles with a non-finite vertex: 1", "degenerate triangles (zero area): 1"]
            );
            assert_eq!(scene.n_placed_triangles(), 11);
        }
    }

    #[test]
    fn several_solids_and_polygons_form_one_mesh() {
        let square = "solid b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 5\nvertex 1 0 5\nvertex 1 1 5\nvertex 0 1 5\n\
                      endloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 5\nendloop\nendfacet\nendsolid\n";
        let scene = stl(ascii(&cube()) + square).unwrap();
        assert_eq!(scene.warnings, ["skipping faces with fewer than 3 vertices: 1"]);
        assert_eq!((scene.n_placed_triangles(), scene.meshes[0].positions.len()), (14, 12));
    }

    #[test]
    fn errors_contain_location_and_value() {
        let text = |from: &str, to: &str| ascii(&cube()).replacen(from, to, 1).into_bytes();
        let mut none = binary(b"", &[]);
        none[80] = 13;
        for (bytes, message) in [
            (b"".to_vec(), "header: 0 bytes, but a binary STL file has at least 84"),
            (b"cube".to_vec(), "header: 4 bytes, but a binary STL file has at least 84"),
            (none, "header: 13 triangles declared, but the remaining data holds 0"),
            (b"solid a\nendsolid a\n".to_vec(), "nothing to draw: no triangles"),
            (binary(b"", &[]), "nothing to draw: no triangles"),
            (text("vertex 0e0", "vertex 0,5"), "line 4: vertex: expected a number, found '0,5'"),
            (text("vertex", "vertx"), "line 4: unknown statement 'vertx'"),
            (text("    endloop\n", ""), "line 7: expected 'endloop', found 'endfacet'"),
            (text("    endloop\n  endfacet\n", ""), "line 7: expected 'endloop', found 'facet'"),
            (
                b"solid\nfacet normal 0 0 1\nouter loop\nvertex 1 2".to_vec(),
                "line 4: unexpected end of file in a vertex",
            ),
            (b"solid\nfacet normal 0 0 1\nouter loop\n".to_vec(), "line 3: unexpected end of file in a facet"),
        ] {
            assert_eq!(stl(bytes).unwrap_err().to_string(), format!("model.stl: {message}"));
        }
    }

    #[test]
    fn no_truncation_of_a_binary_file_is_silent() {
        let full = binary(b"", &cube());
        rejects_truncations(&full, START_BYTES + TRIANGLE_BYTES, stl);
        for length in START_BYTES + TRIANGLE_BYTES..full.len() {
            let warning =
                format!("12 triangles declared, but the remaining data holds {}", (length - START_BYTES) / 50);
            // The first side alone has two triangles, so there is always something to draw.
            assert_eq!(stl(&full[..length]).unwrap().warnings, [format!("reading all whole triangles: {warning}")]);
        }
    }

    #[test]
    fn no_truncation_of_an_ascii_file_is_silent() {
        let full = ascii(&cube());
        let end = full.trim_end().len() - "endsolid a".len();
        for length in 0..end {
            assert!(stl(&full[..length]).map_or(true, |scene| !scene.warnings.is_empty()), "{length} bytes");
        }
    }

    /// Bit patterns of all kinds, and few enough values for vertices to repeat.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<u32>().prop_map(f32::from_bits),
            prop::sample::select(vec![0.0, -0.0, 1.0, 1e7, -1e7, 1e-30, 3e38, f32::NAN, f32::INFINITY]),
        ]
    }

    fn triangle() -> impl Strategy<Value = [[f32; 3]; 3]> {
        prop::array::uniform3(prop::array::uniform3(coordinate()))
    }

    proptest! {
        /// Welding changes no corner, and no two vertices have equal bits.
        #[test]
        fn corners_are_those_of_the_file(triangles in prop::collection::vec(triangle(), 1..40), text: bool) {
            let bytes = if text { ascii(&triangles).into_bytes() } else { binary(b"", &triangles) };
            let is_finite = |t: &&[[f32; 3]; 3]| t.iter().flatten().all(|x| x.is_finite());
            let want: Vec<_> = triangles.iter().filter(is_finite).map(|t| t.map(|p| p.map(f32::to_bits))).collect();
            match stl(bytes) {
                Ok(scene) => {
                    prop_assert_eq!(corners(&scene), want);
                    let mut positions: Vec<_> = scene.meshes[0].positions.iter().map(|p| p.map(f32::to_bits)).collect();
                    let n = positions.len();
                    positions.sort_unstable();
                    positions.dedup();
                    prop_assert_eq!(positions.len(), n);
                }
                Err(error) => prop_assert!(matches!(error, ReadError::Empty { .. }), "{}", error),
            }
        }
    }
}
