//! `--resume`: which frames are kept, rendered again, or refused.

use serde_json::json;

use super::{QUICK, folder, moving};

#[test]
fn whole_frames_are_kept_and_others_rendered_again() {
    let folder = folder(3.0);
    let line = format!("render moving.gltf {QUICK} --frames 0..4 --fps 3 -o f%d.png");
    folder.run(&line).done();
    let all = || [0, 1, 2, 3].map(|n| folder.bytes(&format!("f{n}.png")));
    let expected = all();
    let half = &expected[2][..expected[2].len() / 2];
    folder.write("f2.png", half);
    std::fs::remove_file(folder.path("f3.png")).unwrap();
    let kept = std::fs::metadata(folder.path("f1.png")).unwrap().modified().unwrap();
    let run = folder.run(&format!("{line} --resume --json")).done();
    assert_eq!((&run.json()["rendered_frames"], &run.json()["kept_frames"]), (&2.into(), &2.into()));
    assert!(run.n_warnings() >= 1 && run.stderr.contains("f2.png"), "{}", run.stderr);
    assert_eq!(all(), expected);
    assert_eq!(std::fs::metadata(folder.path("f1.png")).unwrap().modified().unwrap(), kept);
    // Nothing is left to do.
    assert_eq!(folder.run(&format!("{line} --resume --json")).done().json()["rendered_frames"], 0);
    // Without --resume, frames are replaced.
    folder.write("f0.png", "old");
    folder.run(&line).done();
    assert_eq!(all(), expected);
    // A picture of another size is of another sequence; no frame is touched.
    folder.run(&line.replace("40x30", "30x40").replace("-o", "--resume -o")).refused(&["f0.png", "40 x 30", "30 x 40"]);
    assert_eq!(all(), expected);
}

/// A frame is kept only by the options, the pose and the file that it was rendered with.
#[test]
fn frames_of_other_options_or_scenes_are_not_kept() {
    let folder = folder(3.0);
    let line = format!("render moving.gltf {QUICK} --frames 0..3 --fps 3 -o f%d.png");
    folder.run(&line).done();
    let all = || [0, 1, 2].map(|n| folder.bytes(&format!("f{n}.png")));
    let expected = all();
    for (other, words) in [
        ("--seed 7", ["f0.png", "another seed: 0, not 7"]),
        ("--integrator hybrid", ["f0.png", "another choice of integrator: by the scene, not Hybrid"]),
        ("--spp 3", ["f0.png", "another range of samples: 0..2, not 0..3"]),
        ("--fps 4", ["f1.png", "another pose"]),
        ("--animation tear", ["f1.png", "another pose"]),
        ("--shutter 0..0.5", ["f0.png", "another pose"]),
        ("--turntable 90", ["f1.png", "another turn in degrees: 0, not 30"]),
        ("--eye 1,1,8 --target 1,0,0", ["f0.png", "another camera"]),
        ("--sun 0.2,-0.3,-1,3,3,3", ["f0.png", "another light"]),
        ("--env 0.5,0.6,0.7", ["f0.png", "another light"]),
        ("--levels two", ["f0.png", "another acceleration structure"]),
        ("--heatmap boxes", ["f0.png", "another heat map"]),
    ] {
        let mut line = line.clone();
        for replaced in ["--spp 2", "--fps 3"] {
            if other.starts_with(&replaced[..5]) {
                line = line.replace(replaced, "");
            }
        }
        folder.run(&format!("{line} --resume {other}")).refused(&words);
        assert_eq!(all(), expected, "{other}");
    }
    // What does not change a pixel may differ.
    let facts = folder.run(&format!("{line} --resume --update rebuild --threads 1 --json")).done().json();
    assert_eq!(facts["kept_frames"], 3);
    // More frames are added to those that exist, and the list then has them all.
    for (end, kept) in [(5, 3), (5, 5)] {
        let facts = folder.run(&format!("{} --resume --json", line.replace("0..3", &format!("0..{end}")))).done();
        assert_eq!(facts.json()["kept_frames"], kept);
    }
    // Another picture of the same size, a scene that changed, and a list that is gone or has no such line.
    folder.write("f0.png", &expected[1]);
    folder.run(&format!("{line} --resume")).refused(&["f0.png", "f%d.png.frames does not state"]);
    folder.write("f0.png", &expected[0]);
    let (mut file, _) = moving(3.0);
    // The animation does not move this node.
    file["nodes"][1]["translation"] = json!([0.0, 1.25, 0.0]);
    folder.write("moving.gltf", file.to_string());
    folder.run(&format!("{line} --resume")).refused(&["f0.png", "another pose"]);
    folder.write("moving.gltf", moving(3.0).0.to_string());
    folder.run(&format!("{line} --resume")).done();
    let list = folder.text("f%d.png.frames");
    folder.write("f%d.png.frames", &list[..list.len() / 8]);
    folder.run(&format!("{line} --resume")).refused(&["f%d.png.frames does not state"]);
    std::fs::remove_file(folder.path("f%d.png.frames")).unwrap();
    folder.run(&format!("{line} --resume")).refused(&["f0.png", "remove the picture, or render without --resume"]);
    folder.run(&line).done();
    assert_eq!(all(), expected);
    folder.run(&format!("{line} --resume")).done();
}
