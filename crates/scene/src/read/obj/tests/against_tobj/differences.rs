//! Where the readers differ, who is right, and why. "The format" is Wavefront's, appendix B1 of the Advanced Visualizer manual.

/// A difference.
pub(super) struct Rule {
    /// What the file has.
    pub(super) what: &'static str,
    /// Who is right, and why.
    pub(super) why: &'static str,
    /// Whether a file has it.
    pub(super) applies: fn(&[u8]) -> bool,
    /// A file on which the readers differ.
    pub(super) example: &'static [u8],
}

/// All differences.
pub(super) static RULES: [Rule; 17] = [
    Rule {
        what: "bytes that are not UTF-8, or a byte order mark",
        why: "ours: exporters write names in the code page of the system, and editors the mark",
        applies: |bytes| std::str::from_utf8(bytes).is_err() || bytes.starts_with(b"\xef\xbb\xbf"),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\ng caf\xe9\nf 1 2 3\n",
    },
    Rule {
        what: "a continued line",
        why: "ours: the format joins a line that ends with a backslash to the next",
        applies: |bytes| lines(bytes).any(|line| line.trim_end().ends_with('\\')),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n 3\n",
    },
    Rule {
        what: "a comment after a statement",
        why: "ours: exporters write them",
        applies: |bytes| statements(bytes).any(|words| words[1..].iter().any(|word| word.starts_with('#'))),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 # first\n",
    },
    Rule {
        what: "objects and groups in one file",
        why: "ours: an object statement does not end a group, and a group without a name is part of its object",
        applies: |bytes| has(bytes, "o") && has(bytes, "g"),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\ng a\no b\nf 1 2 3\n",
    },
    Rule {
        what: "a name after a tab, or an indented name",
        why: "ours: any white space separates words; tobj makes the keyword part of the name",
        applies: |bytes| {
            let named =
                |line: &&str| ["o", "g", "usemtl", "mtllib"].contains(&line.split_whitespace().next().unwrap_or(""));
            lines(bytes).filter(named).any(|line| line.starts_with([' ', '\t']) || line.contains('\t'))
        },
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\n  g a\nf 1 2 3\n",
    },
    Rule {
        what: "a usemtl statement without a name",
        why: "either: ours takes the default material, tobj rejects the file",
        applies: |bytes| statements(bytes).any(|words| words == ["usemtl"]),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl\nf 1 2 3\n",
    },
    Rule {
        what: "a vertex of other than three or six numbers",
        why: "ours: the weight w is for rational curves and does not scale the vertices of polygons; surplus words do no harm",
        applies: |bytes| statements(bytes).any(|words| words[0] == "v" && ![4, 7].contains(&words.len())),
        example: b"v 0 0 0 2\nv 1 0 0 2\nv 0 1 0 2\nf 1 2 3\n",
    },
    Rule {
        what: "colors of some vertices only, or words in place of colors",
        why: "ours: the geometry is sound; the other vertices are white",
        applies: |bytes| {
            let colors = |words: &[&str]| words.iter().skip(4).filter(|word| word.parse::<f32>().is_ok()).count();
            let vertices: Vec<_> =
                statements(bytes).filter(|words| words[0] == "v").map(|words| colors(&words)).collect();
            vertices.iter().any(|&n| n != vertices[0]) || vertices.first().is_some_and(|n| ![0, 3].contains(n))
        },
        example: b"v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    },
    Rule {
        what: "a number in a form of C libraries, such as nan(ind)",
        why: "ours: the triangle is dropped, not the file",
        applies: |bytes| {
            let is_odd = |word: &&str| word.contains("nan(") || word.contains("1.#");
            statements(bytes).any(|words| words[1..].iter().any(is_odd))
        },
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan(ind) 0 0\nf 1 2 3\n",
    },
    Rule {
        what: "a texture coordinate of one number",
        why: "ours: the second is optional in the format, and 0",
        applies: |bytes| statements(bytes).any(|words| words[0] == "vt" && words.len() == 2),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nf 1/1 2/1 3/1\n",
    },
    Rule {
        what: "an index of a texture coordinate or normal that is out of range",
        why: "ours: the geometry is sound and drawn with a warning",
        applies: |bytes| {
            corners(bytes).any(|(index, kind, n)| kind > 0 && index.is_some_and(|k| k == 0 || k.abs() > n))
        },
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/2 2/2 3/2\n",
    },
    Rule {
        what: "corners without a texture coordinate or normal in a file that has some",
        why: "ours: tobj gives them the one of the corner before",
        applies: |bytes| corners(bytes).any(|(index, kind, _)| index.is_none() && has(bytes, ["v", "vt", "vn"][kind])),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2 3\n",
    },
    Rule {
        what: "a corner of more than three indices",
        why: "either: ours ignores the fourth with a warning, tobj rejects the file",
        applies: |bytes| statements(bytes).any(|words| words[1..].iter().any(|word| word.matches('/').count() > 2)),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1/1 2/2/2/2 3/3/3/3\n",
    },
    Rule {
        what: "a face of fewer than three corners",
        why: "either: ours rejects the file if an index is out of range, tobj does not look at it",
        applies: |bytes| statements(bytes).any(|words| words[0] == "f" && words.len() < 4),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 9\n",
    },
    Rule {
        what: "a line of three or more vertices",
        why: "ours: a polyline has no surface; tobj reads a polygon",
        applies: |bytes| statements(bytes).any(|words| words[0] == "l" && words.len() != 2 && words.len() != 3),
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\nf 1 2 3\n",
    },
    Rule {
        what: "a vertex that is defined after the group that uses it",
        why: "ours: the format numbers the vertices of the whole file",
        applies: |bytes| corners(bytes).any(|(index, _, n)| index.is_some_and(|index| index > n)),
        example: b"v 0 0 0\nv 1 0 0\ng a\nf 1 2 3\ng b\nv 0 1 0\nf 1 2 3\n",
    },
    Rule {
        what: "a material before its library",
        why: "ours: the order of the two statements is free",
        applies: |bytes| {
            statements(bytes).map(|words| words[0]).find(|word| ["usemtl", "mtllib"].contains(word)) == Some("usemtl")
                && has(bytes, "mtllib")
        },
        example: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Red\nmtllib case.mtl\nf 1 2 3\n",
    },
];

fn lines(bytes: &[u8]) -> impl Iterator<Item = &str> {
    bytes.split(|&byte| byte == b'\n').map(|line| std::str::from_utf8(line).unwrap_or_default())
}

/// The words of each statement.
fn statements(bytes: &[u8]) -> impl Iterator<Item = Vec<&str>> {
    lines(bytes)
        .map(|line| line.split_whitespace().collect())
        .filter(|words: &Vec<&str>| words.first().is_some_and(|first| !first.starts_with('#')))
}

fn has(bytes: &[u8], keyword: &str) -> bool {
    statements(bytes).any(|words| words[0] == keyword)
}

/// The indices of all corners: index or `None` where it is absent, kind, and how many of that kind are defined before.
fn corners(bytes: &[u8]) -> impl Iterator<Item = (Option<i64>, usize, i64)> {
    let mut n = [0_i64; 3];
    statements(bytes).flat_map(move |words| {
        match words[0] {
            "v" => n[0] += 1,
            "vt" => n[1] += 1,
            "vn" => n[2] += 1,
            "f" => {}
            _ => return Vec::new(),
        }
        let words = if words[0] == "f" { &words[1..] } else { &[] };
        let of_corner = |word: &&str| {
            let parts: Vec<&str> = word.split('/').collect();
            [0, 1, 2].map(|kind| (parts.get(kind).and_then(|part| part.parse().ok()), kind, n[kind]))
        };
        words.iter().flat_map(of_corner).collect()
    })
}
