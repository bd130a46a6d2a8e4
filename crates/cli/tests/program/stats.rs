//! `canted stats`: numbers that are finite and consistent.

use std::fmt::Write;

use serde_json::Value;

use crate::support::{Folder, Random};

/// Thin diagonal bars in two objects, two triangles each.
fn lattice(n_bars: usize) -> String {
    bars(n_bars, 400, 30)
}

/// Bars that start within `spread` of the origin and extend by up to `reach` in x and y.
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

/// Asserts that every number is finite: JSON writes others as `null`.
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

/// Asserts the relations between the rows of one level, and returns the rows.
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
            // Equal except for decimal rounding.
            assert!((number(row, key) - ratio).abs() <= 1e-12 * ratio, "{key}");
        }
        let share = number(row, "oriented_share");
        assert!((0.0..=1.0).contains(&share), "a share of {share}");
        assert!(number(row, "sah") > 0.0 && number(row, "node_bytes") > 0.0);
        // Every node falls back to the axis-aligned box if that has less area.
        assert!(number(row, "area_ratio_to_aabb") <= 1.0 + 1e-12, "{row}");
    }
    assert_eq!(rows[0]["oriented_share"], 0.0);
    rows
}

/// Asserts the relations between the rows of one level of wide BVHs, and returns the rows.
#[track_caller]
fn assert_wide(level: &Value, n_bvhs: u64, n_triangles: f64) -> &Vec<Value> {
    assert_eq!(level["bvhs"], n_bvhs);
    let rows = level["presets"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["preset"].as_str().unwrap()).collect();
    assert_eq!(names, ["fast", "balanced", "quality"]);
    for row in rows {
        let [aligned, chosen] = ["predicted_aligned_cost", "predicted_cost"].map(|key| number(row, key));
        assert!(chosen > 0.0 && chosen <= aligned * (1.0 + 1e-6), "the cheaper kind is chosen: {row}");
        let shares = ["aligned_share", "oriented_share"].map(|key| number(row, key));
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{row}");
        // Nodes take 256 and 512 bytes, blocks of four triangles 160.
        let n_nodes = number(row, "nodes");
        let node_bytes: f64 = shares.iter().zip([256.0, 512.0]).map(|(share, bytes)| share * n_nodes * bytes).sum();
        assert!((number(row, "node_bytes") - node_bytes).abs() < 1e-6 * node_bytes, "{row}");
        let block_bytes = number(row, "block_bytes");
        assert!(block_bytes % 160.0 == 0.0 && block_bytes >= 40.0 * n_triangles, "{row}");
        let bytes = number(row, "bytes_per_triangle") * n_triangles;
        assert!((bytes - number(row, "node_bytes") - block_bytes).abs() < 1e-6 * bytes, "{row}");
        assert!(number(row, "rotated") <= number(level, "bvhs") && number(row, "depth") >= 1.0, "{row}");
        // The largest rotation of a box that no permutation of axes makes smaller.
        assert!((0.0..=62.8).contains(&number(row, "max_angle_degrees")), "{row}");
        assert!(number(row, "build_ms") >= 0.0);
    }
    rows
}

#[test]
fn diagonal_bars_give_oriented_nodes() {
    let folder = Folder::new();
    // Dense, so that rays which enter the lattice pass many bars, and long, so that oriented boxes save most of them.
    folder.write("lattice.obj", bars(400, 50, 300));
    let wide = &folder.run("stats lattice.obj --presets fast,balanced,quality --json").done().json()["wide"];
    assert!(["scalar", "avx2", "avx512", "neon"].contains(&wide["simd"].as_str().unwrap()), "{wide}");
    assert_wide(&wide["two_level"], 2, 800.0);
    for row in assert_wide(&wide["one_level"], 1, 800.0) {
        let ratio = number(row, "predicted_aligned_cost") / number(row, "predicted_cost");
        assert!(ratio > 1.05 && number(row, "aligned_share") < 0.9, "bars are diagonal: {row}");
        let reason = row["reason"].as_str().unwrap();
        assert!(reason.starts_with(&format!("aligned nodes alone would cost {ratio:.1} times as much: ")), "{reason}");
    }
}

#[test]
fn the_number_of_levels_is_reported_with_its_reason() {
    let folder = Folder::new();
    folder.write("lattice.obj", lattice(200));
    let levels = &folder.run("stats lattice.obj --presets fast --json").done().json()["levels"];
    assert_eq!((&levels["number"], &levels["reason"]), (&1.into(), &"predicted cost".into()), "{levels}");
    assert!(number(&levels["predicted"], "one") < number(&levels["predicted"], "two"), "{levels}");
    let text = folder.run("stats lattice.obj --presets fast").done().stdout;
    assert!(text.contains("Levels of BVHs to render the scene: one level: predicted cost "), "{text}");
}

#[test]
fn a_grid_gives_aligned_nodes() {
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
        assert_eq!((&row["oriented_share"], &row["rotated"]), (&0.0.into(), &0.into()), "{row}");
        assert_eq!(row["reason"], "aligned nodes are cheapest: no node is oriented");
    }
}

#[test]
fn a_diagonal_building_is_reported_as_rotated() {
    let folder = Folder::new();
    // Bricks in rows along (3, 4) and (-4, 3): axis-aligned boxes would overlap.
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
    assert_eq!(fast["rotated"], 0, "this preset does not rotate meshes");
    for row in [balanced, quality] {
        assert_eq!(row["rotated"], 1, "{row}");
        // tan = 4 / 3 is 53.13 degrees, 36.87 from the next axis; frames are measured from f32 vertices.
        assert!((number(row, "max_angle_degrees") - 36.87).abs() < 0.1, "{row}");
        assert!(row["reason"].as_str().unwrap().ends_with("; the mesh is rotated by 37 degrees"), "{row}");
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
    // Bars in space: planes where a split costs least divide them better than midpoints.
    for level in ["one_level", "bottom"] {
        let [bih, kd_tree] = [&json["planes"][level][0], &json["planes"][level][1]];
        assert_eq!((&bih["accel"], &kd_tree["accel"], bih.get("sah")), (&"bih".into(), &"kdtree".into(), None));
        assert!(1.0 < number(kd_tree, "sah") && number(kd_tree, "sah") < number(kd_tree, "sah_midpoint"), "{kd_tree}");
    }
    let dop = &one[5];
    assert!(
        number(dop, "oriented_share") > 0.5 && number(dop, "area_ratio_to_aabb") < 0.95,
        "bars are diagonal: {dop}"
    );
}

/// `stats` and `render` report the same parts.
#[test]
fn parts_that_are_not_needed_are_reported() {
    let folder = Folder::with_small();
    let stats = folder.run("stats small.obj --json").done().json();
    let render = folder.run("render small.obj --size 8x5 --spp 1 --device cpu --json -o out.png").done().json();
    assert_eq!(stats["not_needed"], render["not_needed"]);
    let text = folder.run("stats small.obj").done().stdout;
    for unused in stats["not_needed"].as_array().unwrap() {
        let expected = format!("{} ({})", unused["part"].as_str().unwrap(), unused["reason"].as_str().unwrap());
        assert!(text.contains(&expected), "{expected}: {text}");
    }
    let map = folder.run("render small.obj --size 8x5 --heatmap boxes --json -o map.png").done().json();
    let counts =
        |facts: &Value| facts["not_needed"].as_array().unwrap().iter().all(|unused| unused["part"] != "counters");
    assert!(counts(&map) && !counts(&render), "{map}");
}

#[test]
fn tables_contain_every_strategy() {
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
        "Wide BVH",
        "balanced",
        "split at midpoints",
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
        assert_eq!((&row["nodes"], &row["reason"]), (&0.into(), &"the root is a leaf".into()));
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
    assert!(json["placed_triangles"].as_u64() > json["unique_triangles"].as_u64(), "it has instances");
    assert!(json["unique_triangles"].as_u64().unwrap() > 0);
}
