//! Build speed: triangles per second compared with `obvhs`'s fastest preset, on one thread and on all.

use std::{fmt::Write, hint::black_box, time::Duration};

use anyhow::Result;
use canted_bvh2::{BuildConfig, Bvh2};
use canted_lbvh::{Bits, Strategy, VolumeConfig};
use canted_trace::Watertight;
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris, triangle::Triangle};

use crate::{
    interleave::{Contender, Timing, run},
    models,
};

const SCENES: [&str; 4] = ["bunny", "sponza", "dragon_871k", "country_kitchen"];

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## Build\n\nFrom indexed triangles to a BVH ready for rays (gather, codes, sort, nodes, volumes, layout, triangle \
         records). `obvhs` starts from ready triangles and does not reorder its primitives. Million triangles per second, median \
         (half spread); ratio to the first column of the same round.\n\n\
         | scene | triangles | obvhs fastest, 1 thread | aabb 63 bit, 1 thread | aabb 30 bit, 1 thread | aabb 63 bit, all threads |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut strategies = String::new();
    for name in SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available | | | | |");
            continue;
        };
        let mesh = &model.mesh;
        let n = mesh.triangles.len();
        let theirs: Vec<Triangle> = mesh
            .triangles
            .iter()
            .map(|t| {
                let [v0, v1, v2] = t.map(|i| glam::Vec3A::from_array(mesh.positions[i as usize]));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let build = |bits, strategy| {
            let config = BuildConfig { bits, volumes: VolumeConfig { strategy, fallback: true } };
            let _ = black_box(Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &config));
        };
        let timings = run(
            rounds,
            vec![
                Contender::new("obvhs", || {
                    let params = BvhBuildParams::fastest_build();
                    black_box(build_bvh2_from_tris(&theirs, params, &mut Duration::default()));
                }),
                Contender::new("63", || one.install(|| build(Bits::B63, Strategy::Aabb))),
                Contender::new("30", || one.install(|| build(Bits::B30, Strategy::Aabb))),
                Contender::new("63 all", || build(Bits::B63, Strategy::Aabb)),
            ],
        );
        let _ = write!(out, "| {name} | {n} |");
        for timing in &timings {
            out.push_str(&rate(timing, n));
        }
        out.push('\n');
        let contenders = Strategy::ALL
            .into_iter()
            .map(|strategy| {
                let one = &one;
                let build = &build;
                Contender::new(format!("{strategy:?}"), move || one.install(|| build(Bits::B63, strategy)))
            })
            .collect();
        let all_threads = Contender::new("PcaBounded, all", || build(Bits::B63, Strategy::PcaBounded));
        let mut contenders: Vec<Contender<'_>> = contenders;
        contenders.push(all_threads);
        let timings = run(rounds.min(5), contenders);
        let _ = write!(strategies, "| {name} |");
        for timing in &timings {
            let _ = write!(strategies, " {:.1} ms ({:.2}x) |", timing.median() * 1e3, 1.0 / timing.speed_ratio);
        }
        strategies.push('\n');
    }
    let _ = write!(
        out,
        "\nBy volume strategy, one thread unless stated: milliseconds, and ratio to the axis-aligned build.\n\n\
         | scene | aabb | pca-unbounded | pca-bounded | quaternion | combined | dop | pca-bounded, all threads |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n{strategies}"
    );
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
fn rate(timing: &Timing, n: usize) -> String {
    format!(
        " {:.1} (±{:.0} %){} |",
        n as f64 / timing.median() * 1e-6,
        100.0 * timing.spread(),
        if timing.name == "obvhs" { String::new() } else { format!(", {:.2}x", timing.speed_ratio) }
    )
}
