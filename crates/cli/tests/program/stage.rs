//! What surrounds a scene: the light that needs no file, the background, the ground, the view, and the up axis.

use image::RgbaImage;

use crate::support::Folder;

const SIZE: &str = "--size 64x48 --device cpu --denoise off";

const LINE: &str = "--size 64x48 --spp 8 --device cpu --denoise off";

/// A cube of side 2 around the origin, of a material without specular reflection, in a file with vertices moved by `shift`.
fn cube(shift: [f32; 3]) -> String {
    let corner = |i: u32| {
        let [x, y, z] = [0, 1, 2].map(|k: u32| if i >> k & 1 == 1 { 1.0 } else { -1.0 } + shift[k as usize]);
        format!("v {x} {y} {z}\n")
    };
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    (0..8).map(corner).collect::<String>() + faces
}

/// A folder with `cube.obj`, and `red.obj`, the same in red.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("cube.obj", cube([0.0; 3]));
    folder.write("red.mtl", "newmtl red\nKd 0.8 0.02 0.02\n");
    folder.write("red.obj", format!("mtllib red.mtl\nusemtl red\n{}", cube([0.0; 3])));
    folder
}

fn image(folder: &Folder, name: &str) -> RgbaImage {
    image::load_from_memory(&folder.bytes(name)).unwrap().to_rgba8()
}

/// The color of a pixel, as parts of the width and height.
fn at(image: &RgbaImage, x: f32, y: f32) -> [u8; 4] {
    image.get_pixel((x * image.width() as f32) as u32, (y * image.height() as f32) as u32).0
}

#[test]
fn sides_of_an_object_have_shades_that_differ_from_the_background() {
    let folder = folder();
    let report = folder.run(&format!("render cube.obj {SIZE} --spp 128 --ground off -o a.png --json")).done().json();
    assert_eq!((&report["light"], &report["ground"]), (&"studio".into(), &"off".into()), "{report}");
    let image = image(&folder, "a.png");
    let background = at(&image, 0.02, 0.02)[0];
    let sides = [[0.5, 0.05], [0.4, 0.5], [0.74, 0.45]].map(|[x, y]| at(&image, x, y)[0]);
    let all = [background, sides[0], sides[1], sides[2]];
    for (i, a) in all.iter().enumerate() {
        for b in &all[..i] {
            assert!(a.abs_diff(*b) >= 12, "{all:?}");
        }
    }
    assert_eq!(at(&image, 0.98, 0.98), at(&image, 0.02, 0.02), "the background has one color");
}

/// A landscape is not an object on a table: beyond 40 m there is a sky, and the report says why.
#[test]
fn wide_scenes_have_a_sky_and_the_report_says_why() {
    let folder = folder();
    folder.write("wide.obj", "v -30 0 -30\nv 30 0 -30\nv 30 5 30\nv -30 0 30\nf 1 3 2\nf 1 4 3\n");
    folder.write("wide.toml", "[[assets]]\nname = \"wide\"\nfile = \"wide.obj\"\n");
    let line = |file: &str| format!("render {file} {SIZE} --spp 1 -o a.png --json");
    let report = folder.run(&line("wide.toml")).done().json();
    assert_eq!(report["light"], "sky", "{report}");
    assert_eq!(report["light_reason"], "wider than 40 m; --light studio shows it as an object");
    // The unit of an OBJ file is not known.
    for file in ["cube.obj", "wide.obj"] {
        let report = folder.run(&line(file)).done().json();
        assert_eq!((&report["light"], report["light_reason"].is_null()), (&"studio".into(), true), "{report}");
    }
    let report = folder.run(&format!("{} --light studio", line("wide.toml"))).done().json();
    assert_eq!((&report["light"], report["light_reason"].is_null()), (&"studio".into(), true), "{report}");
}

/// A file in millimeters: a board of 150 x 75 x 8 is no landscape, as it is closed below, also where parts stand on it.
#[test]
fn objects_in_millimeters_are_in_the_studio() {
    let folder = folder();
    let slab = |[x, y, z]: [f32; 3], [w, h, d]: [f32; 3]| {
        let corner = |i: u32| {
            let half = |k: u32| if i >> k & 1 == 1 { 0.5 } else { -0.5 };
            format!("v {} {} {}\n", x + w * half(0), y + h * half(1), z + d * half(2))
        };
        let faces = "f -8 -6 -5 -7\nf -4 -3 -1 -2\nf -8 -7 -3 -4\nf -6 -2 -1 -5\nf -8 -4 -2 -6\nf -7 -5 -1 -3\n";
        (0..8).map(corner).collect::<String>() + faces
    };
    let board = slab([0.0; 3], [150.0, 8.0, 75.0]);
    folder.write("board.obj", &board);
    folder.write("parts.obj", board + &slab([30.0, 6.0, 0.0], [10.0, 4.0, 10.0]));
    // The same seen from above without what closes it below.
    folder.write("sheet.obj", "v -75 0 -37\nv 75 0 -37\nv 75 8 37\nv -75 0 37\nf 1 3 2\nf 1 4 3\n");
    for (name, light, ground) in [("board", "studio", "on"), ("parts", "studio", "on"), ("sheet", "sky", "off")] {
        folder.write("a.toml", format!("[[assets]]\nname = \"a\"\nfile = \"{name}.obj\"\n"));
        let report = folder.run(&format!("render a.toml {SIZE} --spp 1 -o a.png --json")).done().json();
        assert_eq!((&report["light"], &report["ground"]), (&light.into(), &ground.into()), "{name}: {report}");
    }
}

#[test]
fn mirrors_show_the_studio() {
    let folder = folder();
    folder.write("cube.mtl", "newmtl mirror\nillum 3\nKs 0.95 0.95 0.95\nNs 10000\nKd 0 0 0\n");
    folder.write("mirror.obj", format!("mtllib cube.mtl\nusemtl mirror\n{}", cube([0.0; 3])));
    folder.run(&format!("render mirror.obj {LINE} -o a.png")).done();
    let image = image(&folder, "a.png");
    let inside: Vec<u8> = image.pixels().map(|pixel| pixel.0[0]).collect();
    let (least, most) = (inside.iter().min().unwrap(), inside.iter().max().unwrap());
    assert!(most - least > 80, "{least} {most}");
}

#[test]
fn lights_are_chosen_by_name() {
    let folder = folder();
    let light = |options: &str| {
        let report = folder.run(&format!("render cube.obj {LINE} -o a.png --json {options}")).done().json();
        (report["light"].clone(), report["background"].clone(), folder.bytes("a.png"))
    };
    let usual = light("");
    assert_eq!(usual.0, "studio");
    assert!(light("--light studio") == usual);
    let (sky, background, picture) = light("--light sky");
    assert!(sky == "sky" && background == "environment" && picture != usual.2);
    let (white, _, _) = light("--light white --background 0,0,0 --ground off");
    assert_eq!(white, "white");
    // A surface of reflectance 0.8 that nothing shades.
    let [r, g, b, _] = at(&image(&folder, "a.png"), 0.5, 0.25);
    assert!([r, g, b].iter().all(|&x| x.abs_diff(231) <= 2), "{r} {g} {b}");
    folder.run("render cube.obj --light lamp").refused(&["--light", "studio, sky, white"]);
    folder.run("render cube.obj --light sky --env 1,1,1").refused(&["--light", "--env"]);
}

/// Lights that are off are none.
#[test]
fn lights_that_are_off_leave_the_studio_on() {
    let folder = Folder::new();
    for (intensity, is_studio) in [("0", true), ("5", false)] {
        let gltf = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0},
            {"translation":[0,0,3],"extensions":{"KHR_lights_punctual":{"light":0}}}],"extensionsUsed":["KHR_lights_punctual"],
            "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":INTENSITY}]}},
            "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
            "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
            "bufferViews":[{"buffer":0,"byteLength":36}],
            "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,BYTES"}]}"#
            .replace("INTENSITY", intensity)
            .replace("BYTES", "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA");
        folder.write("a.gltf", gltf);
        let report = folder.run(&format!("render a.gltf {LINE} -o a.png --force --json")).done().json();
        assert_eq!(report["light"] == "studio", is_studio, "{report}");
    }
}

/// The ground is as bright as the background, and darker at the foot of the object.
#[test]
fn the_ground_shows_shadows_and_no_edge() {
    let folder = folder();
    let picture = |options: &str| {
        folder.run(&format!("render cube.obj {SIZE} --spp 256 -o a.png {options}")).done();
        image(&folder, "a.png")
    };
    let (with, without) = (picture(""), picture("--ground off"));
    let darkest = |image: &RgbaImage| (0..64).map(|x| image.get_pixel(x, 43).0[0]).min().unwrap();
    let plain = at(&without, 0.02, 0.02)[0];
    assert!(darkest(&with) + 15 < plain, "{} {plain}", darkest(&with));
    for (x, y) in [(0.02, 0.02), (0.98, 0.02), (0.5, 0.0)] {
        let found = at(&with, x, y)[0];
        assert!(found.abs_diff(plain) <= 6, "{x} {y}: {found} {plain}");
    }
    for background in ["white", "black", "#204060"] {
        let with = picture(&format!("--background {background}"));
        let without = picture(&format!("--background {background} --ground off"));
        let [a, b] = [at(&with, 0.02, 0.02), at(&without, 0.02, 0.02)];
        assert!((0..3).all(|k| a[k].abs_diff(b[k]) <= 8), "{background}: {a:?} {b:?}");
    }
    // Files that say nothing of a ground have none where channels are asked for.
    folder.run(&format!("render cube.obj {LINE} --aovs instance -o a.exr")).done();
    let facts = folder.run(&format!("render cube.obj {LINE} -o a.exr --aovs depth --json")).done().json();
    assert_eq!((&facts["ground"], &facts["placed_triangles"]), (&"off".into(), &12.into()));
    let facts = folder.run(&format!("render cube.obj {LINE} -o a.png --json")).done().json();
    assert_eq!((&facts["ground"], &facts["placed_triangles"]), (&"on".into(), &12.into()));
    let below =
        folder.run(&format!("render cube.obj {LINE} -o a.png --json --eye 0,-5,5 --target 0,0,0")).done().json();
    assert_eq!(below["ground"], "off");
}

/// Where the ground ends it is as bright as the background, after denoising as well.
#[test]
fn the_edge_of_the_ground_is_not_seen() {
    let folder = folder();
    folder.run("render cube.obj --size 160x120 --device cpu -o a.png").done();
    let image = image(&folder, "a.png");
    let background = at(&image, 0.5, 0.0)[0];
    // Beside the cube, and above its shadow; the edge is at row 29.
    let beside = (0..16).chain(144..160).flat_map(|x| (0..45).map(move |y| (x, y)));
    for (x, y) in beside {
        let found = image.get_pixel(x, y).0[0];
        assert!(found.abs_diff(background) <= 9, "{x} {y}: {found} {background}");
    }
}

/// A surface that faces the viewer is nearly as bright as one in white light, so that colors of textures look like they do elsewhere.
#[test]
fn the_studio_lights_what_faces_the_viewer() {
    let folder = folder();
    folder.run(&format!("render cube.obj {SIZE} --spp 128 --eye 0,0,6 --target 0,0,0 --ground off -o a.png")).done();
    let linear = canted_film::srgb::decode(at(&image(&folder, "a.png"), 0.5, 0.5)[0]);
    // The cube reflects 0.8.
    assert!((0.65..0.9).contains(&(linear / 0.8)), "{linear}");
}

/// Alpha is the covered part of each pixel, and colors are those of what covers it.
#[test]
fn transparent_backgrounds_have_alpha() {
    let folder = folder();
    folder.run(&format!("render red.obj {LINE} --background transparent -o a.png")).done();
    let image = image(&folder, "a.png");
    assert_eq!(at(&image, 0.02, 0.02)[3], 0);
    assert_eq!(at(&image, 0.5, 0.5)[3], 255);
    let edges: Vec<[u8; 4]> = image.pixels().map(|p| p.0).filter(|p| (30..220).contains(&p[3])).collect();
    assert!(edges.len() > 20 && edges.iter().all(|[r, g, _, _]| *r > 60 && *r > 2 * *g), "{edges:?}");
    folder.run(&format!("render red.obj {LINE} --background transparent -o a.exr")).done();
    // Colors of EXR files are multiplied by alpha.
    let exr = canted_film::read_picture(&folder.path("a.exr")).unwrap();
    for (pixel, color) in image.pixels().zip(&exr.pixels) {
        let [red, _, _, alpha] = pixel.0;
        let straight = canted_film::srgb::decode(red).min(1.0) * f32::from(alpha) / 255.0;
        assert!(red == 255 || (straight - color[0]).abs() < 0.01, "{pixel:?} {color:?}");
    }
    for (options, word) in
        [("-o a.jpg", ".png, .webp or .exr"), ("-o a.hdr", ".exr"), ("-o a.exr --samples 0..4", "--samples cannot")]
    {
        let line = format!("render red.obj --size 8x8 --background transparent {options}");
        folder.run(&line).refused(&["--background transparent", word]);
    }
    folder.run("render red.obj --background clear").refused(&["--background", "clear", "transparent"]);
}

#[test]
fn a_background_is_seen_by_the_camera_alone() {
    let folder = folder();
    let picture = |background: &str| {
        folder.run(&format!("render red.obj {LINE} --ground off --background {background} -o a.png")).done();
        image(&folder, "a.png")
    };
    let (blue, environment) = (picture("#0000ff"), picture("environment"));
    assert_eq!(at(&blue, 0.02, 0.02), [0, 0, 255, 255]);
    assert_ne!(at(&environment, 0.02, 0.02), [0, 0, 255, 255]);
    assert_eq!(at(&blue, 0.5, 0.5), at(&environment, 0.5, 0.5));
}

/// What a scene file says, with the options that were decided, is the same picture.
#[test]
fn scene_files_keep_light_background_and_ground() {
    let folder = folder();
    for options in ["", "--light sky", "--background 1,0.5,0 --ground off"] {
        folder.run(&format!("render cube.obj {LINE} -o a.png {options}")).done();
        folder.run(&format!("scene cube.obj --size 64x48 --spp 8 -o a.toml {options}")).done();
        folder.run("render a.toml --device cpu --denoise off -o b.png").done();
        assert!(folder.bytes("a.png") == folder.bytes("b.png"), "{options}");
    }
    let text = folder.text("a.toml");
    for line in ["light = \"studio\"", "background = \"1,0.5,0\"", "ground = \"off\""] {
        assert!(text.contains(line), "{line}: {text}");
    }
    folder.run("render a.toml --device cpu --denoise off -o b.png --env 1,1,1").done();
    assert!(folder.bytes("a.png") != folder.bytes("b.png"), "a light of the command line replaces it");
}

// The view.

#[test]
fn lights_of_a_scene_file_that_its_light_replaces_are_named() {
    let folder = folder();
    folder.run("scene cube.obj --size 64x48 --spp 1 -o cube.toml").done();
    let unused = |text: &str| {
        folder.write("edited.toml", text);
        folder
            .run("render edited.toml --device cpu -o a.png")
            .done()
            .stderr
            .contains("the light 'studio' replaces the lights")
    };
    let text = folder.text("cube.toml");
    assert!(!unused(&text), "what the program wrote is used");
    assert!(unused(&text.replace("constant = [0.0, 0.0, 0.0]", "constant = [1.0, 0.0, 0.0]")), "{text}");
    let light = "[[lights]]\ntype = \"sun\"\ndirection = [0.0, -1.0, 0.0]\nirradiance = [1.0, 1.0, 1.0]\n";
    let lit = format!("{}{light}", text.replace("lights = []", ""));
    assert!(unused(&lit));
    assert!(!unused(&lit.replace("\nlight = \"studio\"", "")), "without it the lights are used");
}

#[test]
fn the_report_names_camera_and_light() {
    let folder = folder();
    let facts = folder.run(&format!("render cube.obj {LINE} -o a.png --json")).done().json();
    assert_eq!(facts["camera"], "frames the scene");
    assert!(facts["eye"].as_array().unwrap().len() == 3 && facts["target"].as_array().unwrap().len() == 3);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files/gltf/camera.gltf");
    let facts = folder.run(&format!("render {file} {LINE} -o a.png --json")).done().json();
    assert_eq!(facts["camera"], "camera 0 of the file, front");
    let facts = folder.run(&format!("render cube.obj {LINE} -o a.png --json --sun 0,-1,0,1,1,1 --eye 0,0,9")).done();
    let facts = facts.json();
    assert_eq!(
        (&facts["camera"], &facts["light"]),
        (&"given by options".into(), &"1 light, a constant environment".into())
    );
}

/// The camera of `CAMERA` looks along -z from z = 5.
const CAMERA: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
"nodes":[{"mesh":0,"translation":[0,0,OFFSET]},{"camera":0,"translation":[0,0,5]}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"numbers.bin","byteLength":36}],
"bufferViews":[{"buffer":0,"byteLength":36}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]}"#;

#[test]
fn a_camera_that_does_not_show_the_subject_is_not_used() {
    let folder = Folder::new();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    folder.write("numbers.bin", corners.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    // In front of it, behind the camera, far away, and a hundredth in front of it.
    for (offset, shows) in [("0", true), ("9", false), ("-500", false), ("4.99", false)] {
        folder.write("a.gltf", CAMERA.replace("OFFSET", offset));
        let run = folder.run(&format!("render a.gltf {LINE} -o a.png --json")).done();
        let camera = if shows { "camera 0 of the file" } else { "frames the scene" };
        assert_eq!(run.json()["camera"], camera, "{offset}");
        assert_eq!(run.stderr.contains("note: the view frames the scene"), !shows, "{offset}: {}", run.stderr);
        let run = folder.run(&format!("render a.gltf {LINE} -o a.png --json --camera 0")).done();
        assert_eq!(run.json()["camera"], "camera 0 of the file", "{offset}");
    }
}

/// A pyramid with its base across z, in an ASCII STL.
#[test]
fn a_base_across_z_shows_that_z_is_up() {
    let folder = Folder::new();
    let base = [[-1.0_f32, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let stl = |turned: bool| {
        let top = [0.0, 0.0, 2.0];
        let faces = [[base[0], base[2], base[1]], [base[0], base[3], base[2]]];
        let sides = (0..4).map(|i| [base[i], base[(i + 1) % 4], top]);
        let vertex = |[x, y, z]: [f32; 3]| {
            // A rotation that makes z point along y.
            let [x, y, z] = if turned { [x, z, -y] } else { [x, y, z] };
            format!("vertex {x} {y} {z}\n")
        };
        let facet = |corners: [[f32; 3]; 3]| {
            format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.map(vertex).concat())
        };
        format!("solid a\n{}endsolid a\n", faces.into_iter().chain(sides).map(facet).collect::<String>())
    };
    // Enough samples that noise makes no difference of a tenth.
    let line = LINE.replace("--spp 8", "--spp 32");
    let [z_up, y_up] = [false, true].map(|turned| {
        folder.write("a.stl", stl(turned));
        let run = folder.run(&format!("render a.stl {line} -o a.png --json")).done();
        (run.stderr.contains("note: z is up"), run.json()["eye"].clone(), image(&folder, "a.png"))
    });
    assert!(z_up.0 && !y_up.0);
    // The same view of the same object, but for rounding and the random numbers of pixels.
    let far = z_up.2.pixels().zip(y_up.2.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 25).count();
    assert!(far < 64 * 48 / 20, "{far}");
    folder.write("a.stl", stl(false));
    let run = folder.run(&format!("render a.stl {LINE} -o a.png --json --up-axis y")).done();
    assert!(!run.stderr.contains("z is up") && run.json()["eye"] != z_up.1);
}

/// A pyramid as OBJ and PLY, closed below or cut off there, and things that only look as if z were up.
#[test]
fn z_is_up_where_the_geometry_clearly_shows_it() {
    let folder = Folder::new();
    let base = [[-1.0_f32, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let sides = "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
    let corners = |[x, y, z]: [f32; 3], [i, j, k]: [usize; 3]| {
        let all = base.iter().copied().chain([[x, y, z]]);
        all.map(|p| format!("v {} {} {}\n", p[i], p[j], p[k])).collect::<String>()
    };
    let (upright, cyclic) = ([0, 1, 2], [1, 2, 0]);
    let pyramid = |order| corners([0.0, 0.0, 2.0], order) + sides;
    let closed = |order| pyramid(order) + "f 4 3 2 1\n";
    // A roof of a house without a floor: its gables are flat and across z.
    let house = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 2 -1\nv 0 2 1\nf 1 5 2\nf 4 3 6\nf 1 4 6 5\nf 2 5 6 3\n";
    // A poster in the plane z = 0, and a sofa on feet with a flat back.
    let poster = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    for (name, text, is_z) in [
        ("closed.obj", closed(upright), true),
        ("open.obj", pyramid(upright), true),
        ("y up.obj", closed(cyclic), false),
        ("open, y up.obj", pyramid(cyclic), false),
        ("house.obj", house.to_owned(), false),
        ("cube.obj", cube([0.0; 3]), false),
        ("poster.obj", poster.to_owned(), false),
    ] {
        folder.write("a.obj", &text);
        let run = folder.run(&format!("render a.obj {LINE} -o a.png")).done();
        assert_eq!(run.stderr.contains("note: z is up"), is_z, "{name}: {}", run.stderr);
        let vertices: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("v ")).collect();
        let faces: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("f ")).collect();
        let mut ply = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n\
             property list uchar int vertex_indices\nend_header\n{}\n",
            vertices.len(),
            faces.len(),
            vertices.join("\n")
        );
        for face in faces {
            let indices: Vec<String> = face.split(' ').map(|i| (i.parse::<u32>().unwrap() - 1).to_string()).collect();
            ply += &format!("{} {}\n", indices.len(), indices.join(" "));
        }
        folder.write("a.ply", ply);
        let run = folder.run(&format!("render a.ply {LINE} -o a.png")).done();
        assert_eq!(run.stderr.contains("note: z is up"), is_z, "{name} as PLY: {}", run.stderr);
    }
}
