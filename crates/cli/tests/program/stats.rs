//! `canted stats`: numbers that are finite and fit together.

use std::fmt::Write;

use serde_json::Value;

use crate::{random::Random, support::Folder};

/// A lattice of thin bars that lean: two triangles a bar, two groups with the same bars.
fn lattice(n_bars: usize) -> String {
    bars(n_bars, 400, 30)
}

/// Bars that begin within `spread` of the origin and lean by up to `reach`.
fn bars(n_bars: usize, spread: u32, reach: u32) -> String {
    let mut random = Random(9);
    let mut obj = String::new();
    for bar in 0..n_bars {
        let ([x, y, z], [dx, dy, dz]) = (random.point(spread), random.point(reach));
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

/// Asserts what holds between the rows of one level of wide trees; returns its rows.
#[track_caller]
fn assert_wide(level: &Value, n_trees: u64, n_triangles: f64) -> &Vec<Value> {
    assert_eq!(level["trees"], n_trees);
    let rows = level["presets"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["preset"].as_str().unwrap()).collect();
    assert_eq!(names, ["fast", "balanced", "quality"]);
    for row in rows {
        let [boxes_only, as_built] = ["predicted_boxes_only", "predicted_as_built"].map(|key| number(row, key));
        assert!(as_built > 0.0 && as_built <= boxes_only * (1.0 + 1e-6), "no dearer kind is chosen: {row}");
        let shares = ["box_share", "lean_share"].map(|key| number(row, key));
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{row}");
        // Nodes take 256, 320 and 512 bytes; blocks of four triangles 160.
        let n_nodes = number(row, "nodes");
        let node_bytes: f64 =
            shares.iter().zip([256.0, 320.0, 512.0]).map(|(share, bytes)| share * n_nodes * bytes).sum();
        assert!((number(row, "node_bytes") - node_bytes).abs() < 1e-6 * node_bytes, "{row}");
        let block_bytes = number(row, "block_bytes");
        assert!(block_bytes % 160.0 == 0.0 && block_bytes >= 40.0 * n_triangles, "{row}");
        let bytes = number(row, "bytes_per_triangle") * n_triangles;
        assert!((bytes - number(row, "node_bytes") - block_bytes).abs() < 1e-6 * bytes, "{row}");
        assert!(number(row, "turned") <= number(level, "trees") && number(row, "depth") >= 1.0, "{row}");
        // Boxes can be turned by no more than from a diagonal of the cube to an axis.
        assert!((0.0..=62.8).contains(&number(row, "greatest_angle_degrees")), "{row}");
        assert!(number(row, "build_ms") >= 0.0);
    }
    rows
}

#[test]
fn wide_trees_say_why_they_lean() {
    let folder = Folder::new();
    // Dense enough that rays which enter the lattice meet many bars.
    folder.write("lattice.obj", bars(400, 100, 100));
    let wide = &folder.run("stats lattice.obj --presets fast,balanced,quality --json").done().json()["wide"];
    assert!(["scalar", "avx2", "avx512", "neon"].contains(&wide["simd"].as_str().unwrap()), "{wide}");
    assert_wide(&wide["two_level"], 2, 800.0);
    for row in assert_wide(&wide["one_level"], 1, 800.0) {
        let times = number(row, "predicted_boxes_only") / number(row, "predicted_as_built");
        assert!(times > 1.05 && number(row, "box_share") < 0.9, "bars lean: {row}");
        let because = row["because"].as_str().unwrap();
        assert!(because.starts_with(&format!("leaning boxes predicted {times:.1} times cheaper: ")), "{because}");
    }
}

#[test]
fn wide_trees_of_squares_say_that_boxes_do() {
    let folder = Folder::new();
    let mut obj = String::new();
    for (x, y) in (0..=20).flat_map(|x| (0..=20).map(move |y| (x, y))) {
        writeln!(obj, "v {x} {y} 0").unwrap();
    }
    for (x, y) in (0..20).flat_map(|x| (0..20).map(move |y| (x, y))) {
        let first = 21 * x + y + 1;
        writeln!(obj, "f {} {} {} {}", first, first + 21, first + 22, first + 1).unwrap();
    }
    folder.write("squares.obj", obj);
    for row in assert_wide(
        &folder.run("stats squares.obj --presets fast,balanced,quality --json").done().json()["wide"]["one_level"],
        1,
        800.0,
    ) {
        assert_eq!((&row["lean_share"], &row["turned"]), (&0.0.into(), &0.into()), "{row}");
        assert_eq!(row["because"], "box nodes predicted as cheap as any: no node leans");
    }
}

#[test]
fn a_mesh_turned_on_its_plot_is_said_to_be_turned() {
    let folder = Folder::new();
    // Bricks in rows along (3, 4) and (-4, 3): boxes along x and y would overlap.
    let mut random = Random(3);
    let mut obj = String::new();
    for brick in 0..600 {
        let ([x, y, z], [a, b, c]) = (random.point(200), random.point(20));
        for [u, v, w] in [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]] {
            let [along, across] = [x + u * (a.abs() + 10), y + v * (b.abs() + 1)];
            writeln!(obj, "v {} {} {}", 3 * along - 4 * across, 4 * along + 3 * across, z + w * (c.abs() + 1)).unwrap();
        }
        for face in [[1, 4, 3, 2], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]] {
            let [a, b, c, d] = face.map(|corner| 8 * brick + corner);
            writeln!(obj, "f {a} {b} {c} {d}").unwrap();
        }
    }
    folder.write("bricks.obj", obj);
    let wide =
        &folder.run("stats bricks.obj --presets fast,balanced,quality --json").done().json()["wide"]["one_level"];
    let [fast, balanced, quality] = &assert_wide(wide, 1, 7200.0)[..] else { panic!("three presets") };
    assert_eq!(fast["turned"], 0, "it looks for no frame");
    for row in [balanced, quality] {
        assert_eq!(row["turned"], 1, "{row}");
        // tan = 4 / 3 is 53.13 degrees, 36.87 from the next axis; frames are measured from f32 vertices.
        assert!((number(row, "greatest_angle_degrees") - 36.87).abs() < 0.1, "{row}");
        assert!(row["because"].as_str().unwrap().ends_with("; the mesh is turned, by 37 degrees at most"), "{row}");
    }
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

/// What `render` says of the same scene, `stats` says too.
#[test]
fn what_pictures_do_without_is_told() {
    let folder = Folder::with_small();
    let stats = folder.run("stats small.obj --json").done().json();
    let render = folder.run("render small.obj --size 8x5 --spp 1 --device cpu --json -o out.png").done().json();
    assert_eq!(stats["left_out"], render["left_out"]);
    let text = folder.run("stats small.obj").done().stdout;
    for left in stats["left_out"].as_array().unwrap() {
        let said = format!("{} ({})", left["part"].as_str().unwrap(), left["because"].as_str().unwrap());
        assert!(text.contains(&said), "{said}: {text}");
    }
    let map = folder.run("render small.obj --size 8x5 --heatmap boxes --json -o map.png").done().json();
    let counts = |facts: &Value| facts["left_out"].as_array().unwrap().iter().all(|left| left["part"] != "counters");
    assert!(counts(&map) && !counts(&render), "{map}");
}

#[test]
fn tables_name_every_strategy() {
    let folder = Folder::with_small();
    let text = folder.run("stats small.obj").done().stdout;
    for word in [
        "aabb",
        "pca-unbounded",
        "pca-bounded",
        "quaternion",
        "combined",
        "dop",
        "one level",
        "two levels",
        "Wide trees",
        "balanced",
    ] {
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
    assert_no_null(&json);
    for row in json["wide"]["one_level"]["presets"].as_array().unwrap() {
        assert_eq!((&row["nodes"], &row["because"]), (&0.into(), &"no node: the root is a leaf".into()));
    }
    folder.run("stats one.obj").done();
}

#[test]
fn the_built_in_scene_has_statistics() {
    let json = Folder::new().run("stats --json").done().json();
    assert_no_null(&json);
    let presets = json["wide"]["one_level"]["presets"].as_array().unwrap();
    assert_eq!((presets.len(), &presets[0]["preset"]), (1, &"balanced".into()));
    assert_eq!(json["scene"], "built-in scene");
    assert!(json["placed_triangles"].as_u64() > json["unique_triangles"].as_u64(), "it is instanced");
    assert!(json["unique_triangles"].as_u64().unwrap() > 0);
}
