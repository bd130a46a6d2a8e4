//! Builds of a hundred thousand triangles, for a frame that keeps nothing of the last one.

use std::{fmt::Write, hint::black_box, time::Duration};

use anyhow::Result;
use canted_bih::Bih;
use canted_bvh2::{BuildConfig, Bvh2};
use canted_kdtree::KdTree;
use canted_trace::Watertight;
use canted_wide::{Config, Preset, TriangleBvh};
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris};

use super::{Updated, row, run};
use crate::{
    models::{self, Model},
    options::Options,
    wide::obvhs as theirs,
};

const SCENES: [&str; 3] = ["scaffold", "bunny", "grid"];

/// Measures and writes the table.
pub(super) fn table(out: &mut String, options: &Options) -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let _ = writeln!(
        out,
        "\n### Builds of structures for one frame\n\nOne thread, from indexed triangles; `obvhs` starts from ready triangles. Last column: wall and processor time \
         relative to the BIH.\n\n| scene | structure | ms | processor ms | relative |\n| --- | --- | --- | --- | --- |",
    );
    for name in SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available | | | |");
            continue;
        };
        let mut all = structures(&model);
        run(&mut all, options.rounds, &pool)?;
        let scene = format!("{name}, {} triangles", model.mesh.triangles.len());
        all.iter().for_each(|one| row(out, &scene, one, all.first()));
    }
    Ok(())
}

fn structures(model: &Model) -> Vec<Updated<'_>> {
    let (positions, triangles) = (&model.mesh.positions[..], &model.mesh.triangles[..]);
    let their_triangles = theirs::triangles(&model.mesh);
    let wide = |preset| {
        let config = Config::preset(preset);
        move |_| {
            black_box(TriangleBvh::<Watertight>::build(positions, triangles, &config)?);
            Ok(())
        }
    };
    vec![
        Updated::new("BIH", move |_| {
            black_box(Bih::<Watertight>::build(positions, triangles, &canted_bih::Config::default())?);
            Ok(())
        }),
        Updated::new("SAH kd-tree", move |_| {
            black_box(KdTree::<Watertight>::build(positions, triangles, &canted_kdtree::Config::default())?);
            Ok(())
        }),
        Updated::new("obvhs BVH2 fastest", move |_| {
            let params = BvhBuildParams::fastest_build();
            black_box(build_bvh2_from_tris(&their_triangles, params, &mut Duration::default()));
            Ok(())
        }),
        Updated::new("Bvh2, radix tree", move |_| {
            black_box(Bvh2::<Watertight>::build(positions, triangles, &BuildConfig::default())?);
            Ok(())
        }),
        Updated::new("WideBvh dynamic", wide(Preset::Dynamic)),
        Updated::new("WideBvh fast", wide(Preset::Fast)),
    ]
}
