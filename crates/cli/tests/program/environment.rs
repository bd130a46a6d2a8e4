//! `--env` with environment maps, and `--time`.

use std::path::PathBuf;

use canted_fixtures::skip;

use crate::support::{Folder, Run, rows};

/// A map of 2 x 1 texels in flat RGBE: the left half of all directions is red, the right half green.
const TWO: [u8; 8] = [128, 0, 0, 129, 0, 128, 0, 129];

/// A folder with `two.hdr`, and a model behind the camera of [`render`].
fn folder() -> Folder {
    let folder = Folder::with_small();
    folder.write("two.hdr", [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".as_slice(), &TWO].concat());
    folder
}

/// Renders the directions around -z, the center of the map.
fn render(folder: &Folder, options: &str) -> Run {
    let camera = "--eye 0,0,-9 --target 0,0,-10 --size 8x4 --spp 4";
    folder.run(&format!("render small.obj -o out.png {camera} {options}"))
}

/// Red and green of the left and right half of the picture.
fn halves(folder: &Folder, options: &str) -> [[u8; 2]; 2] {
    render(folder, options).done();
    let image = image::load_from_memory(&folder.bytes("out.png")).unwrap().to_rgb8();
    [0, 7].map(|x| [image.get_pixel(x, 1).0[0], image.get_pixel(x, 1).0[1]])
}

#[test]
fn a_map_is_visible_behind_the_scene() {
    let folder = folder();
    let [left, right] = halves(&folder, "--env two.hdr");
    assert!(left[0] > left[1] && right[1] > right[0], "{left:?} {right:?}");
    let [left, right] = halves(&folder, "--env two.hdr --env-turn 180");
    assert!(left[1] > left[0] && right[0] > right[1], "turned: {left:?} {right:?}");
    let [dark, _] = halves(&folder, "--env two.hdr --env-scale 0.25");
    assert!(dark[0] > 0 && dark[0] < 200, "scaled: {dark:?}");
}

#[test]
fn env_scale_applies_to_constant_light() {
    let folder = folder();
    assert_eq!(halves(&folder, "--env 0.5,1,0 --env-scale 2"), halves(&folder, "--env 1,2,0"));
}

#[test]
fn invalid_environments_are_rejected() {
    let folder = folder();
    folder.write("text.exr", "text");
    folder.write("cut.hdr", &folder.bytes("two.hdr")[..40]);
    render(&folder, "--env absent.hdr").refused(&["absent.hdr", "cannot read file"]);
    render(&folder, "--env text.exr").refused(&["text.exr", "expected Radiance HDR or OpenEXR"]);
    render(&folder, "--env cut.hdr").refused(&["cut.hdr"]);
    render(&folder, "--env two.jpg").refused(&["--env", "use R,G,B or a .hdr or .exr file"]);
    render(&folder, "--env 1,1,1 --env-scale -1").refused(&["--env-scale"]);
    render(&folder, "--env 3e38,1,1 --env-scale 10").refused(&["--env", "--env-scale 10"]);
    render(&folder, "--env-turn 90").refused(&["--env"]);
    assert!(!folder.names().iter().any(|name| name == "out.png"));
}

#[test]
fn exr_and_hdr_maps_of_one_sky_give_the_same_picture() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let models = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let [exr, hdr] = ["exr", "hdr"].map(|ending| models.join(format!("env/sky_64x32.{ending}")));
    if !exr.is_file() {
        skip::<()>("exr_and_hdr_maps_of_one_sky_give_the_same_picture", format_args!("there is no {}", exr.display()));
        return;
    }
    let folder = Folder::with_small();
    let pictures = [exr, hdr].map(|sky| {
        folder.run(&format!("render small.obj -o out.png --size 32x16 --env {}", sky.display())).done();
        image::load_from_memory(&folder.bytes("out.png")).unwrap().to_rgb8().into_raw()
    });
    // RGBE has eight bits for the largest channel, a few of the 256 steps of the picture.
    let most = pictures[0].iter().zip(&pictures[1]).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most.is_some_and(|most| most <= 4), "{most:?}");
}

#[test]
fn a_time_without_an_animation_is_reported() {
    let folder = Folder::with_small();
    let run = folder.run("render small.obj -o out.png --size 8x8 --time 1.5").done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    folder.run("render -o out.png --time 1").refused(&["SCENE"]);
    folder.run("render small.obj -o out.png --time nan").refused(&["--time"]);
}

/// A triangle in z = 0 that moves by ten units along x in two seconds.
const ANIMATED: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"numbers.bin","byteLength":68}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
{"buffer":0,"byteOffset":44,"byteLength":24}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
{"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR"},
{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}],
"animations":[{"samplers":[{"input":1,"output":2}],
"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]}"#;

/// A folder with `animated.gltf`.
pub(crate) fn animated() -> Folder {
    let folder = Folder::new();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let numbers = corners.into_iter().chain([0.0, 2.0]).chain([0.0, 0.0, 0.0, 10.0, 0.0, 0.0]);
    folder.write("numbers.bin", numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    folder.write("animated.gltf", ANIMATED);
    folder
}

#[test]
fn rays_hit_the_posed_scene() {
    let folder = animated();
    folder.write("rays.csv", "ox,oy,oz,dx,dy,dz,tmax\n0.25,0.25,1,0,0,-1,inf\n5.25,0.25,1,0,0,-1,inf\n");
    let is_hit = |options: &str| -> Vec<bool> {
        folder.run(&format!("cast animated.gltf --rays rays.csv --hits hits.csv {options}")).done();
        let hits = rows::<f64>(&folder.text("hits.csv"), "t,prim,u,v,instance");
        hits.iter().map(|hit| hit[1] >= 0.0).collect()
    };
    assert_eq!(is_hit(""), [true, false]);
    assert_eq!(is_hit("--time 1"), [false, true]);
    folder.run("stats animated.gltf --time 1 --threads 1").done();
    folder.run("stats --time 1").refused(&["SCENE"]);
}
