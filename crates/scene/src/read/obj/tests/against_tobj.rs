//! The reader compared with `tobj`, the most used OBJ reader of the ecosystem, over every OBJ and MTL file at hand and over
//! mutations of one. Where the two differ, a rule of [`differences`] says who is right and why.
//!
//! Not covered: how polygons are cut into triangles (`tobj` makes fans, which leave concave polygons), smoothing groups.

mod differences;
mod libraries;
mod readings;

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;

use differences::{RULES, Rule};
use readings::{Outcome, compare};

/// Files with this extension below a folder, sorted.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|its| its == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Folders of files at hand; that of real models is optional.
fn folders(test: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("../../tests/files"), root.join("../../examples/models")];
    let models = std::env::var_os("CANTED_SCENES").map_or_else(|| root.join("../../../shared/scenes"), PathBuf::from);
    if models.is_dir() {
        folders.push(models);
    } else {
        canted_fixtures::skip::<()>(test, format_args!("missing folder {}", models.display()));
    }
    folders
}

/// Rules that apply to a file.
fn applicable(bytes: &[u8]) -> Vec<&'static str> {
    RULES.iter().filter(|rule| (rule.applies)(bytes)).map(|rule| rule.what).collect()
}

#[test]
fn files_at_hand_agree() {
    let paths: Vec<PathBuf> = folders("files_at_hand_agree").iter().flat_map(|folder| files(folder, "obj")).collect();
    assert!(paths.len() >= 40, "{} files", paths.len());
    let mut n_same = 0;
    for path in &paths {
        let bytes = fs::read(path).unwrap();
        match compare(path, &bytes) {
            Outcome::Same => n_same += 1,
            // Libraries with malformed colors.
            Outcome::Panicked => {}
            Outcome::Differ(how) => assert!(!applicable(&bytes).is_empty(), "{}: {how}", path.display()),
        }
    }
    assert!(2 * n_same > paths.len(), "{n_same} of {} files agree", paths.len());
}

#[test]
fn generated_files_agree() {
    let mesh = canted_fixtures::grid(5, [20, 20]);
    let mut text = String::new();
    for (k, [x, y, z]) in mesh.positions.iter().enumerate() {
        text += &format!("v {x} {y} {z}\nvt {} {}\nvn {z} {x} {y}\n", 0.25 * k as f32, x + y);
    }
    for (k, triangle) in mesh.triangles.iter().enumerate() {
        if k % 50 == 0 {
            text += &format!("g part {k}\n");
        }
        let [a, b, c] = triangle.map(|index| index + 1);
        text += &format!("f {a}/{b}/{c} {b}/{c}/{a} {c}/{a}/{b}\n");
    }
    assert_eq!(compare(Path::new("model.obj"), text.as_bytes()), Outcome::Same);
}

/// A file to which no rule applies.
const SEED: &str = "# seed\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 2 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\n\
                    f 1/1/1 2/2/1 3/3/2\nf -5/1/2 -3/-1/-1 -2/2/1\ng two\nusemtl red\nf 1/1/1 2/2/2 3/3/1 4/1/2\ns off\n\
                    usemtl blue\nf 3/1/1 4/2/1 5/3/1\ng three four\nf 1/1/1 3/2/1 4/3/1 5/1/2 2/2/2\n";

/// Words that replace others.
const WORDS: [&str; 22] = [
    "0", "1", "2", "-1", "5", "6", "99", "-9", "1.5", "nan", "1e39", "x", "#", "1/1", "1/1/1", "2//1", "3/9/1",
    "1/0/1", "-1/-1/-1", "1/1/1/1", "f", "v",
];

/// A change: the line, the word in it, its replacement, and the kind of change.
type Change = (prop::sample::Index, prop::sample::Index, prop::sample::Index, u8);

fn changed(seed: &str, changes: &[Change]) -> String {
    let mut lines: Vec<Vec<&str>> = seed.lines().map(|line| line.split(' ').collect()).collect();
    for (line, word, with, kind) in changes {
        let at = line.index(lines.len());
        let (k, new) = (word.index(lines[at].len()), WORDS[with.index(WORDS.len())]);
        match kind {
            0 => lines[at][k] = new,
            1 => lines[at].insert(k + 1, new),
            2 if lines[at].len() > 1 => drop(lines[at].remove(k)),
            3 if lines.len() > 1 => drop(lines.remove(at)),
            4 => lines.insert(at, lines[at].clone()),
            _ => {
                let other = with.index(lines.len());
                lines.swap(at, other);
            }
        }
    }
    lines.iter().map(|words| words.join(" ") + "\n").collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn mutated_files_agree(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0..6_u8), 1..4)) {
        let text = changed(SEED, &changes);
        if let Outcome::Differ(how) = compare(Path::new("model.obj"), text.as_bytes()) {
            prop_assert!(!applicable(text.as_bytes()).is_empty(), "{}:\n{}", how, text);
        }
    }
}

#[test]
fn the_seed_agrees_without_a_rule() {
    assert_eq!(compare(Path::new("model.obj"), SEED.as_bytes()), Outcome::Same);
    assert_eq!(applicable(SEED.as_bytes()), [""; 0]);
}

/// Each rule has an example, to which it applies and on which the readers differ, so that no rule outlives its difference.
#[test]
fn every_rule_is_needed() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/obj/model.obj");
    for Rule { what, why, applies, example } in &RULES {
        assert!(applies(example) && (why.starts_with("ours: ") || why.starts_with("either: ")), "{what}");
        assert_ne!(compare(&path, example), Outcome::Same, "{what}");
    }
}

/// The comparison sees a change of each thing that it compares.
#[test]
fn the_comparison_sees_differences() {
    let ours = readings::ours(Path::new("model.obj"), SEED.as_bytes()).unwrap();
    for (from, to) in [
        ("v 1 1 0", "v 1 1 0.5"),
        ("vt 1 1", "vt 1 0.75"),
        ("vn 0 1 0", "vn 0 1 0.5"),
        ("g two", "g 2"),
        ("f 3/1/1 4/2/1 5/3/1", "f 3/1/1 5/3/1 4/2/1"),
        ("f 3/1/1 4/2/1 5/3/1\n", ""),
    ] {
        let other = readings::ours(Path::new("model.obj"), SEED.replace(from, to).as_bytes()).unwrap();
        assert!(readings::first_difference(&ours, &other).is_some(), "{from}");
    }
    assert_eq!(readings::first_difference(&ours, &ours), None);
}
