//! `canted render --noise`: pixels stop at the requested error, and the reported error is true.

use serde_json::Value;

use crate::support::Folder;

const RENDER: &str = "render small.obj --size 40x24 --bounces 2 --env 0.6,0.6,0.6";

fn number(facts: &Value, key: &str) -> f64 {
    facts[key].as_f64().unwrap_or_else(|| panic!("{key}: {facts}"))
}

#[test]
fn less_noise_takes_more_samples() {
    let folder = Folder::with_small();
    let mut before = 0.0;
    for noise in [0.02, 0.006, 0.003] {
        let facts = folder.run(&format!("{RENDER} --spp 4096 --noise {noise} --json -o a.exr")).done().json();
        let (reached, spent) = (number(&facts, "noise_reached"), number(&facts, "mean_samples_per_pixel"));
        assert!(0.0 < reached && reached <= noise, "{facts}");
        assert!(before < spent && spent < 4096.0, "{before} {facts}");
        before = spent;
    }
    let text = folder.run(&format!("{RENDER} --spp 64 --noise 0.1 -o a.exr")).done().stdout;
    assert!(text.contains("noise reached") && text.contains("mean samples per pixel"), "{text}");
}

#[test]
fn spp_is_the_maximum() {
    let folder = Folder::with_small();
    let one = folder.run(&format!("{RENDER} --spp 1 --noise 0.1 -o a.exr")).done().stdout;
    assert!(one.lines().any(|line| line.starts_with("noise reached") && line.ends_with("unknown")), "{one}");
    let facts = folder.run(&format!("{RENDER} --spp 24 --noise 1e-6 --json -o a.exr")).done().json();
    assert!(number(&facts, "noise_reached") > 1e-6, "{facts}");
    // Cells that show only sky have no noise and stop at 16 samples.
    let spent = number(&facts, "mean_samples_per_pixel");
    assert!((16.0..=24.0).contains(&spent), "{facts}");
    folder.run(&format!("{RENDER} --spp 24 --sampler sobol -o b.exr")).done();
    folder.run("compare a.exr b.exr --max 1e-3").done();
}

#[test]
fn threads_do_not_change_a_byte() {
    let folder = Folder::with_small();
    let picture = |n: u32| {
        folder.run(&format!("{RENDER} --spp 256 --noise 0.005 --aovs all --threads {n} -o a.exr")).done();
        folder.bytes("a.exr")
    };
    let one = picture(1);
    assert!((2..=3).all(|n| picture(n) == one));
}

/// The estimate is for independent samples. The error of the reference is much smaller.
#[test]
fn the_reported_error_is_true() {
    let folder = Folder::with_small();
    folder.run(&format!("{RENDER} --spp 16384 --seed 1 --sampler sobol -o long.exr")).done();
    for noise in [0.02, 0.004] {
        let line = format!("{RENDER} --spp 8192 --noise {noise} --sampler random --json -o a.exr");
        let reported = number(&folder.run(&line).done().json(), "noise_reached");
        let found = folder.run("compare a.exr long.exr --json").done().json();
        // In a gray picture, the relative error of each channel equals that of luminance.
        let ratio = number(&found, "relmse").sqrt() / reported;
        assert!((0.85..1.15).contains(&ratio), "{noise}: {reported} reported, {ratio} times that measured");
    }
}
