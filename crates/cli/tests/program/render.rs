//! `canted render`: files, reports, and options that must not change a picture.

use crate::support::Folder;

const QUICK: &str = "render small.obj --size 48x27 --spp 2";

/// Width and height in the header of a PNG file.
fn png_size(bytes: &[u8]) -> [u32; 2] {
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}

#[test]
fn pictures_have_the_requested_size_and_format() {
    let folder = Folder::with_small();
    let run = folder.run(&format!("{QUICK} -o out.png")).done();
    assert!(run.stdout.contains("48 x 27"), "{}", run.stdout);
    assert_eq!(png_size(&folder.bytes("out.png")), [48, 27]);
    folder.run(&format!("{QUICK} -o out.EXR")).done();
    assert_eq!(folder.bytes("out.EXR")[..4], [0x76, 0x2f, 0x31, 0x01]);
    folder.run("render small.obj --size 1x1 --spp 1").done();
    assert_eq!(png_size(&folder.bytes("canted.png")), [1, 1]);
}

#[test]
fn the_report_is_available_as_json() {
    let folder = Folder::with_small();
    let facts = folder.run(&format!("{QUICK} --bounces 1 --threads 2 --json -o out.png")).done().json();
    assert_eq!(facts["size"], serde_json::json!([48, 27]));
    assert_eq!(facts["scene"], "small.obj");
    assert_eq!(facts["picture"], "out.png");
    assert_eq!((&facts["samples_per_pixel"], &facts["bounces"]), (&2.into(), &1.into()));
    assert_eq!((&facts["placed_triangles"], &facts["threads"]), (&3.into(), &2.into()));
    assert!(facts["rays"].as_u64().unwrap() >= 48 * 27 * 2, "one camera ray per sample: {}", facts["rays"]);
    assert!(facts["not_needed"].as_array().unwrap().iter().all(|unused| unused["part"].is_string()));
    for key in ["load_seconds", "build_seconds", "trace_seconds", "seconds"] {
        assert!(facts[key].as_f64().unwrap() >= 0.0, "{key}");
    }
}

#[test]
fn the_report_describes_the_volumes() {
    let folder = Folder::with_small();
    let fact = |line: &str, key: &str| {
        let facts = folder.run(&format!("render {line} --size 8x5 --spp 1 --json -o out.png")).done().json();
        facts[key].as_str().unwrap_or_else(|| panic!("{line}: {facts}")).to_owned()
    };
    assert_eq!(fact("small.obj", "volumes"), "wide, leaves only");
    assert_eq!(fact("small.obj --levels two --preset quality", "volumes"), "wide, leaves only");
    assert_eq!(fact("small.obj --volumes aabb", "volumes"), "aabb");
    assert_eq!(fact("small.obj --volumes dop --builder sah", "volumes"), "dop");
    assert_eq!(fact("small.obj --accel bvh2", "volumes"), "aabb");
    assert_eq!(fact("small.obj --accel bih", "volumes"), "bounding intervals");
    assert_eq!(fact("small.obj --accel kdtree", "volumes"), "kd-tree cells");
    assert!(["scalar", "avx2", "avx512", "neon"].contains(&fact("small.obj", "simd").as_str()));
    // The built-in scene has diagonal beams.
    for options in ["", "--preset fast", "--levels two", "--builder sah"] {
        let words = fact(options, "volumes");
        let numbers: Vec<u64> = words.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
        assert!(words.starts_with("wide, ") && words.contains(" nodes oriented"), "{options}: {words}");
        assert!(0 < numbers[0] && numbers[0] <= numbers[1], "{options}: {words}");
    }
}

#[test]
fn the_report_says_why_oriented_nodes_are_not_needed() {
    let folder = Folder::with_small();
    let reason = |line: &str| {
        let facts = folder.run(&format!("render {line} --size 8x5 --spp 1 --json -o out.png")).done().json();
        let parts = facts["not_needed"].as_array().unwrap();
        let oriented = parts.iter().find(|unused| unused["part"] == "oriented nodes");
        oriented.map(|unused| unused["reason"].as_str().unwrap().to_owned())
    };
    assert_eq!(reason("small.obj").as_deref(), Some("no gain in predicted cost"));
    assert_eq!(reason("small.obj --volumes aabb").as_deref(), Some("axis-aligned boxes were requested"));
    assert_eq!(reason("--volumes aabb").as_deref(), Some("axis-aligned boxes were requested"));
    assert_eq!(reason(""), None, "the built-in scene has diagonal beams");
}

/// The reasons are those of the run, and nothing that an integrator uses is reported as not needed.
#[test]
fn reported_parts_are_not_needed() {
    let folder = Folder::with_small();
    let parts = |options: &str| -> Vec<(String, String)> {
        let facts =
            folder.run(&format!("render small.obj --size 8x5 --spp 1 --json -o out.png {options}")).done().json();
        let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
        facts["not_needed"].as_array().unwrap().iter().map(|u| (text(&u["part"]), text(&u["reason"]))).collect()
    };
    let has = |parts: &[(String, String)], part: &str, reason: &str| parts.contains(&(part.into(), reason.into()));
    assert!(has(&parts(""), "top-level BVH", "few meshes have several instances"));
    assert!(has(&parts("--levels one"), "top-level BVH", "one level was requested"));
    // Shadow rays sample the sky although the scene has no lights.
    let sky = parts("--integrator path --env 1,1,1");
    assert!(has(&sky, "listed lights", "the scene lists none"), "{sky:?}");
    assert!(!sky.iter().any(|(part, _)| part.contains("shadow")), "{sky:?}");
}

#[test]
fn threads_do_not_change_a_byte() {
    let folder = Folder::with_small();
    for options in ["--spp 4", "--spp 4 --env 1,1,1", "--spp 1 --heatmap boxes"] {
        for format in ["png", "exr"] {
            let picture = |n: u32| {
                let name = format!("out{n}.{format}");
                folder.run(&format!("render small.obj --size 70x50 {options} --threads {n} -o {name}")).done();
                folder.bytes(&name)
            };
            let one = picture(1);
            assert!((2..=4).all(|n| picture(n) == one), "{options}, {format}");
        }
    }
}

#[test]
fn structures_do_not_change_a_byte() {
    let folder = Folder::with_small();
    let picture = |options: &str| {
        folder.run(&format!("{QUICK} {options} -o out.exr")).done();
        folder.bytes("out.exr")
    };
    let first = picture("");
    for options in [
        "--levels two",
        "--volumes dop",
        "--levels two --volumes combined",
        #[cfg(feature = "baseline")]
        "--builder obvhs",
        "--builder auto",
        "--builder sah",
        "--builder sah --volumes aabb",
        "--builder sbvh",
        "--builder sbvh --accel bvh2",
        "--preset fast",
        "--preset dynamic",
        "--preset quality --levels two",
        "--accel wide",
        "--accel bvh2",
        "--accel bvh2 --volumes dop --levels two",
        "--accel bih",
        "--accel bih --levels two",
        "--accel kdtree",
        "--accel kdtree --levels two",
    ] {
        assert!(picture(options) == first, "{options}");
    }
    assert!(picture("--seed 1") != first, "another seed gives other noise");
    assert!(picture("--fov 20") != first);
    assert!(picture("--eye 0.5,0.5,9 --target 0.5,0.5,0") != first);
}

#[test]
fn heat_maps_count_tests() {
    let folder = Folder::with_small();
    let camera = "--eye 0.5,0.5,9 --target 0.5,0.5,0 --fov 10 --volumes aabb";
    for what in ["boxes", "triangles"] {
        let facts = folder.run(&format!("{QUICK} --heatmap {what} {camera} --json -o {what}.png")).done().json();
        assert_eq!(png_size(&folder.bytes(&format!("{what}.png"))), [48, 27]);
        assert!(facts["box_tests_per_ray"].as_f64().unwrap() > 0.0);
        let triangles = facts["triangle_tests_per_ray"].as_f64().unwrap();
        assert!(triangles > 0.0 && triangles <= 3.0, "{triangles} tests in a scene of 3 triangles");
    }
    assert_ne!(folder.bytes("boxes.png"), folder.bytes("triangles.png"));
}

#[test]
fn a_wide_node_counts_as_eight_boxes() {
    let folder = Folder::with_small();
    let facts = folder.run(&format!("{QUICK} --heatmap boxes --json")).done().json();
    assert_eq!(facts["box_tests_per_ray"], 0.0, "three triangles are one leaf");
    // One ray through a stack of 64 squares; a leaf holds at most 32 triangles.
    let corners = (0..64).map(|z| format!("v 0 0 {z}\nv 2 0 {z}\nv 2 2 {z}\nv 0 2 {z}\n"));
    let faces = (0..64).map(|i| 4 * i + 1).map(|i| format!("f {i} {} {} {}\n", i + 1, i + 2, i + 3));
    folder.write("stack.obj", corners.chain(faces).collect::<String>());
    let camera = "--eye 1.2,1,99 --target 1.2,1,0 --up 0,1,0 --size 1x1";
    for preset in ["dynamic", "fast", "balanced", "quality"] {
        let line = format!("render stack.obj {camera} --heatmap boxes --preset {preset} --json");
        let facts = folder.run(&line).done().json();
        let [boxes, triangles] =
            ["box_tests_per_ray", "triangle_tests_per_ray"].map(|key| facts[key].as_f64().unwrap());
        assert!(boxes >= 8.0 && boxes % 8.0 == 0.0, "{preset}: {boxes} boxes");
        assert!((1.0..128.0).contains(&triangles), "{preset}: {triangles} triangles of 128");
    }
    let binary = folder.run(&format!("render stack.obj {camera} --heatmap boxes --volumes aabb --json")).done().json();
    assert!(binary["box_tests_per_ray"].as_f64().unwrap() >= 2.0, "{binary}");
}

#[test]
fn pictures_show_the_requested_light() {
    let folder = Folder::with_small();
    // Every pixel shows the environment.
    let away = "--eye 0,0,9 --target 0,0,99 --up 0,1,0";
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --env 0.25,0.5,1 -o sky.exr")).done();
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --env 0.5,1,2 -o bright.exr")).done();
    let found = folder.run("compare bright.exr sky.exr --json").done().json();
    assert_eq!(found["mean_ratio"].as_f64().unwrap(), 2.0);
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --env 0,0,0 -o black.exr")).done();
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --sun 0,0,-1,1,1,1 -o sun.exr")).done();
    folder.run("compare black.exr sun.exr --max 0").done();
    // A sun straight above gray ground reflects albedo times irradiance over pi, proportional to the irradiance.
    let down = "--eye 0.9,0.9,9 --target 0.9,0.9,0 --up 0,1,0 --fov 0.5 --bounces 0";
    for irradiance in [1, 2] {
        let sun = format!("--sun 0,0,-1,{irradiance},{irradiance},{irradiance}");
        folder.run(&format!("render small.obj --size 8x8 --spp 1 {down} {sun} -o sun{irradiance}.exr")).done();
    }
    let found = folder.run("compare sun2.exr sun1.exr --json").done().json();
    assert_eq!(found["mean_ratio"].as_f64().unwrap(), 2.0);
    assert!(found["rmse"].as_f64().unwrap() > 0.0, "the ground is lit");
}

/// From options and from scene files, the picture has the same bits as that of a pinhole camera.
#[test]
fn an_aperture_of_zero_is_a_pinhole() {
    const CAMERA: &str = "--eye 0.5,2,4 --target 0.5,0.5,0 --size 48x27 --spp 2";
    let folder = Folder::with_small();
    let picture = |scene: &str| {
        folder.run(&format!("render {scene} -o out.exr")).done();
        folder.bytes("out.exr")
    };
    for integrator in ["hybrid", "path"] {
        let plain = format!("small.obj {CAMERA} --integrator {integrator}");
        folder.run(&format!("scene {plain} --aperture 0.25 -o lens.toml")).done();
        let file = folder.text("lens.toml");
        assert!(file.contains("aperture_radius = 0.25"), "{file}");
        folder.write("none.toml", file.replace("aperture_radius = 0.25", "aperture_radius = 0.0"));
        let pinhole = picture(&plain);
        for scene in [&format!("{plain} --aperture 0"), "lens.toml --aperture 0", "none.toml"] {
            assert!(picture(scene) == pinhole, "{scene}, {integrator}");
        }
        assert!(picture("lens.toml") != pinhole, "{integrator}: no blur");
    }
}

/// The sum of emitted and reflected light overflows.
#[test]
fn samples_that_overflow_are_counted_and_the_first_is_reported() {
    let folder = Folder::with_small();
    folder.write("bright.mtl", "newmtl bright\nKd 0.8 0.8 0.8\nKe 3e38 0 0\n");
    folder.write("bright.obj", "mtllib bright.mtl\nusemtl bright\nv 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3 4\n");
    // A square in the upper right quarter of the picture, in front of a constant sky. The other quarters are finite.
    let camera = "--eye 0,0,1 --target 0,0,0 --up 0,1,0 --fov 90 --size 8x4 --spp 3 --device cpu --bounces 0";
    let run = folder.run(&format!("render bright.obj {camera} --env 3e38,0,0 --json -o out.exr")).done();
    assert_eq!(run.json()["dropped_samples"], 4 * 2 * 3);
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    let warning = "warning: dropped 24 samples that were not finite, the first in pixel (4, 0)";
    assert!(run.stderr.contains(warning), "{}", run.stderr);
    let finite = folder.run(&format!("render bright.obj {camera} --env 3e37,0,0 --json -o out.exr")).done();
    assert_eq!((&finite.json()["dropped_samples"], finite.n_warnings()), (&0.into(), 0), "{}", finite.stderr);
    let of_parts = camera.replace("--spp 3", "");
    for samples in ["0..1", "1..3"] {
        folder.run(&format!("render bright.obj {of_parts} --env 3e38,0,0 --samples {samples} -o {samples}.exr")).done();
    }
    let merged = folder.run("merge 0..1.exr 1..3.exr -o whole.exr").done();
    assert!(merged.stdout.contains("dropped 24 samples that were not finite"), "{}", merged.stdout);
}
