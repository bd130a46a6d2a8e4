//! `canted render --noise`: pixels stop when they are good enough, and what is claimed is so.

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
fn the_most_samples_are_an_end_too() {
    let folder = Folder::with_small();
    let one = folder.run(&format!("{RENDER} --spp 1 --noise 0.1 -o a.exr")).done().stdout;
    assert!(one.lines().any(|line| line.starts_with("noise reached") && line.ends_with("unknown")), "{one}");
    let facts = folder.run(&format!("{RENDER} --spp 24 --noise 1e-6 --json -o a.exr")).done().json();
    assert!(number(&facts, "noise_reached") > 1e-6, "{facts}");
    // Cells that see the sky alone have no noise and stop at 16.
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

/// Independent samples, whose error the estimate is of; the error of a long run of other samples is far below.
#[test]
fn the_error_is_what_is_claimed() {
    let folder = Folder::with_small();
    folder.run(&format!("{RENDER} --spp 16384 --seed 1 --sampler sobol -o long.exr")).done();
    for noise in [0.02, 0.004] {
        let line = format!("{RENDER} --spp 8192 --noise {noise} --sampler random --json -o a.exr");
        let claimed = number(&folder.run(&line).done().json(), "noise_reached");
        let found = folder.run("compare a.exr long.exr --json").done().json();
        // In a grey picture the relative error of each channel is that of luminance.
        let ratio = number(&found, "relmse").sqrt() / claimed;
        assert!((0.85..1.15).contains(&ratio), "{noise}: {claimed} claimed, {ratio} times that found");
    }
}
