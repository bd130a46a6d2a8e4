//! `canted stats`: numbers that are finite and fit together.

use std::fmt::Write;

use serde_json::Value;

use crate::{random::Random, support::Folder};

/// A lattice of thin bars that lean: two triangles a bar, two groups with the same bars.
fn lattice(n_bars: usize) -> String {
    let mut random = Random(9);
    let mut obj = String::new();
    for bar in 0..n_bars {
        let ([x, y, z], [dx, dy, dz]) = (random.point(400), random.point(30));
        for [u, v] in [[0, 0], [1, 0], [1, 1], [0, 1]] {
            writeln!(obj, "v {} {} {}", x + u * dx, y + u * dy + v, z + u * (dz + 40)).unwrap();
        }
        let first = 4 * bar + 1;
        if bar % (n_bars / 2) == 0 {
            writeln!(obj, "o part{bar}").unwrap();
        }
        writeln!(obj, "f {} {} {} {}", first, first + 1, first + 2, first + 3).unwrap();
    }
    obj
}

/// Asserts that every number is finite: JSON knows no other, what is not finite becomes `null`.
#[track_caller]
fn assert_no_null(value: &Value) {
    match value {
        Value::Null => panic!("a number is not finite"),
        Value::Array(items) => items.iter().for_each(assert_no_null),
        Value::Object(members) => members.values().for_each(assert_no_null),
        _ => {}
    }
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key} is {}", row[key]))
}

/// Asserts what holds between the rows of one level; returns its rows.
#[track_caller]
fn assert_level(level: &Value, n_nodes: u64) -> &Vec<Value> {
    let rows = level["strategies"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["volumes"].as_str().unwrap()).collect();
    assert_eq!(names, ["aabb", "pca-unbounded", "pca-bounded", "quaternion", "combined", "dop"]);
    for pass in ["gather_ms", "codes_ms", "sort_ms", "tree_ms"] {
        assert!(number(level, pass) >= 0.0);
    }
    for row in rows {
        assert_eq!(row["nodes"], n_nodes, "{}", row["volumes"]);
        for (key, sum) in [("volume_ratio_to_aabb", "volume_sum"), ("area_ratio_to_aabb", "area_sum")] {
            let ratio = number(row, sum) / number(&rows[0], sum);
            // Equal but for the rounding of a number's decimal form.
            assert!((number(row, key) - ratio).abs() <= 1e-12 * ratio, "{key}");
        }
        let share = number(row, "leaning_share");
        assert!((0.0..=1.0).contains(&share), "a share of {share}");
        assert!(number(row, "sah") > 0.0 && number(row, "node_bytes") > 0.0);
        // Every node falls back to the box along the axes where that has less area.
        assert!(number(row, "area_ratio_to_aabb") <= 1.0 + 1e-12, "{row}");
    }
    assert_eq!(rows[0]["leaning_share"], 0.0);
    rows
}

#[test]
fn numbers_are_finite_and_consistent() {
    let folder = Folder::new();
    folder.write("lattice.obj", lattice(400));
    let run = folder.run("stats lattice.obj --json").done();
    let json = run.json();
    assert_no_null(&json);
    assert_eq!(json["scene"], "lattice.obj");
    assert_eq!((&json["meshes"], &json["instances"]), (&2.into(), &2.into()));
    assert_eq!((&json["placed_triangles"], &json["unique_triangles"]), (&800.into(), &800.into()));
    let one = assert_level(&json["one_level"], 799);
    assert_level(&json["two_level"]["bottom"], 2 * 399);
    assert_level(&json["two_level"]["top"], 1);
    let dop = &one[5];
    assert!(number(dop, "leaning_share") > 0.5 && number(dop, "area_ratio_to_aabb") < 0.95, "bars lean: {dop}");
}

#[test]
fn tables_name_every_strategy() {
    let folder = Folder::with_small();
    let text = folder.run("stats small.obj").done().stdout;
    for word in ["aabb", "pca-unbounded", "pca-bounded", "quaternion", "combined", "dop", "one level", "two levels"] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
    assert!(text.lines().next().unwrap().contains("3 triangles"), "{text}");
    assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
}

#[test]
fn a_scene_without_inner_nodes_has_statistics() {
    let folder = Folder::new();
    folder.write("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let json = folder.run("stats one.obj --json").done().json();
    for level in [&json["one_level"], &json["two_level"]["bottom"], &json["two_level"]["top"]] {
        assert!(level["strategies"].as_array().unwrap().iter().all(|row| row["nodes"] == 0), "{level}");
    }
    folder.run("stats one.obj").done();
}

#[test]
fn the_built_in_scene_has_statistics() {
    let json = Folder::new().run("stats --json").done().json();
    assert_no_null(&json);
    assert_eq!(json["scene"], "built-in scene");
    assert!(json["placed_triangles"].as_u64() > json["unique_triangles"].as_u64(), "it is instanced");
    assert!(json["unique_triangles"].as_u64().unwrap() > 0);
}
