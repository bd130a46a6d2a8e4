//! Peak memory of a render, as the report states it.

use crate::support::Folder;

/// Bytes that each further pixel adds to the peak.
fn bytes_per_pixel(folder: &Folder, options: &str) -> f64 {
    let peak = |side: u32| {
        let size = format!("--size {side}x{side}");
        let report = folder.run(&format!("render --device cpu --spp 1 {size} {options} -o a.png --json")).done().json();
        report["peak_memory_bytes"].as_f64().unwrap()
    };
    (peak(1536) - peak(256)) / f64::from(1536 * 1536 - 256 * 256)
}

/// Two pictures of means, 24 bytes, and the PNG: 3 bytes before and at most 3 after compression. Sums alone would take 64.
#[test]
fn a_plain_picture_keeps_means_and_not_sums() {
    let folder = Folder::new();
    let plain = bytes_per_pixel(&folder, "");
    assert!(plain < 45.0, "{plain} bytes per pixel");
    // The estimate of noise needs sums.
    let sums = bytes_per_pixel(&folder, "--noise 1");
    assert!(sums > 60.0, "{sums} bytes per pixel");
}
