//! Build and picture times of binary BVHs by several builders.

use anyhow::Result;
use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{scaffold_nodes, scaffold_of};
use canted_lbvh::Leaf;
use canted_obb::Aabb;
use canted_sah::{Builder, TopDownConfig};
use canted_trace::Watertight;

use super::passes::one_thread;
use crate::clock;
use crate::models::Model;
use crate::report::{effort::Effort, samples::Samples, subjects};
use crate::wide::sets;

/// The cheapest.
pub(super) const RADIX: (&str, Builder) = ("radix tree", Builder::Lbvh);

/// Evaluates every split of every node with the surface area heuristic.
pub(super) const SWEPT: (&str, Builder) = ("full SAH sweep", Builder::TopDown(TopDownConfig::SWEEP, None));

/// The times of one BVH.
pub(super) struct Took {
    /// Milliseconds.
    pub(super) build: Samples,
    /// Milliseconds of all camera rays.
    pub(super) picture: Samples,
    pub(super) n_bytes: usize,
}

/// A scaffold of about `2^log2` triangles.
pub(super) fn scaffold(log2: u32) -> Model {
    subjects::of_mesh(scaffold_of(1, false, scaffold_nodes(log2)))
}

/// Every BVH of a model, built and traced in turn on one thread.
pub(super) fn measure(model: &Model, builders: &[(&'static str, Builder)], effort: Effort) -> Result<Vec<Took>> {
    one_thread(|| measure_here(model, builders, effort))?
}

fn measure_here(model: &Model, builders: &[(&'static str, Builder)], effort: Effort) -> Result<Vec<Took>> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    // Four views together have the pixels of one picture of twice the width and height.
    let rays = sets::camera(model, effort.pick(16, 128, 128));
    let mut took: Vec<(Vec<f64>, Vec<f64>, usize)> = vec![Default::default(); builders.len()];
    for repeat in 0..=effort.pick(2, 3, 5) {
        for ((_, builder), (builds, pictures, n_bytes)) in builders.iter().zip(&mut took) {
            let (blas, build) = clock::time(|| {
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                let tree = canted_sah::build(&boxes, &bounds, builder);
                Bvh2::<Watertight>::over(tree, &corners, &bounds, &BuildConfig::default())
            });
            let (_, picture) = clock::time(|| {
                for ray in &rays {
                    std::hint::black_box(blas.closest_hit(ray));
                }
            });
            *n_bytes = blas.n_bytes();
            if repeat > 0 {
                builds.push(build.cpu * 1e3);
                pictures.push(picture.cpu * 1e3);
            }
        }
    }
    let took = took.into_iter().map(|(build, picture, n_bytes)| Took {
        build: build.into(),
        picture: picture.into(),
        n_bytes,
    });
    Ok(took.collect())
}
