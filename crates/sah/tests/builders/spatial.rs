use canted_fixtures as fixtures;
use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};
use canted_sah::{References, SpatialConfig, TopDownConfig, spatial, top_down};

use crate::{boxes, checked, corners, degenerate};

/// Rounding of a sampled point relative to the greatest coordinate: two products, two sums, and
/// barycentric coordinates of two roundings each that need not sum to 1.
const SAMPLE_ERROR: f64 = 8.0 * f64::EPSILON;

/// Steps along an edge at which triangles are sampled.
const STEPS: u32 = 24;

/// The first triangle with a point outside the boxes of all its references.
fn uncovered(corners: &[Corners], references: &References) -> Option<PrimId> {
    let mut of = vec![vec![]; corners.len()];
    for (primitive, aabb) in references.primitives.iter().zip(&references.boxes) {
        of[primitive.index()].push(*aabb);
    }
    (0..)
        .map(PrimId)
        .zip(corners)
        .zip(&of)
        .find(|((_, triangle), boxes)| !covers(boxes, triangle))
        .map(|((id, _), _)| id)
}

fn covers(boxes: &[Aabb], triangle: &Corners) -> bool {
    let reach = triangle.iter().flatten().fold(0.0, |reach: f64, &x| reach.max(f64::from(x).abs()));
    let error = SAMPLE_ERROR * reach;
    let weights = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| [i, j, STEPS - i - j]));
    weights.map(|w| w.map(|w| f64::from(w) / f64::from(STEPS))).all(|w| {
        let at = |k: usize| (0..3).map(|i| w[i] * f64::from(triangle[i][k])).sum::<f64>();
        let point = [at(0), at(1), at(2)];
        let inside = |aabb: &Aabb| {
            (0..3).all(|k| f64::from(aabb.min[k]) - error <= point[k] && point[k] <= f64::from(aabb.max[k]) + error)
        };
        boxes.iter().any(inside)
    })
}

const EAGER: SpatialConfig =
    SpatialConfig { extra_references: 3.0, min_overlap: 0.0, bins: 32, object_splits: TopDownConfig::BINNED };

fn built(corners: &[Corners], config: &SpatialConfig) -> (canted_lbvh::Tree, References) {
    let (tree, references) = spatial(corners, config);
    let (stats, _) = checked(&tree, &references.boxes);
    assert_eq!(stats.n_leaves, references.primitives.len());
    assert!(stats.depth <= 96, "depth {}", stats.depth);
    let most = corners.len() + (f64::from(config.extra_references) * corners.len() as f64) as usize;
    assert!(stats.n_leaves <= most, "{} references of at most {most}", stats.n_leaves);
    let uncovered = uncovered(corners, &references);
    assert!(uncovered.is_none(), "{uncovered:?} reaches out of its references");
    (tree, references)
}

#[test]
fn references_cover_their_triangles() {
    for (name, corners) in degenerate() {
        for config in [SpatialConfig::default(), EAGER] {
            let (_, references) = built(&corners, &config);
            assert!(references.primitives.len() >= corners.len(), "{name}");
        }
    }
    for mesh in [fixtures::soup(1, 500), fixtures::slivers(3, 500), fixtures::fan(300)] {
        built(&corners(&mesh), &EAGER);
    }
    for n in 0..20 {
        built(&corners(&fixtures::soup(u64::from(n), n)), &EAGER);
    }
}

/// Sabotage: a box that is one bit too small on one side is detected.
#[test]
fn a_box_that_is_too_small_is_detected() {
    let corners = corners(&fixtures::slivers(3, 200));
    let (_, mut references) = built(&corners, &EAGER);
    let split = |id: PrimId| references.primitives.iter().filter(|&&other| other == id).count() > 1;
    let i = (0..references.boxes.len()).find(|&i| split(references.primitives[i])).expect("slivers are split");
    let aabb = &mut references.boxes[i];
    aabb.min = aabb.max;
    assert_eq!(uncovered(&corners, &references), Some(references.primitives[i]));
}

#[test]
fn splits_reduce_the_cost_of_needles_within_their_budget() {
    let corners = corners(&fixtures::slivers(2, 3_000));
    let boxes = boxes(&corners);
    let unsplit = checked(&top_down(&boxes, &TopDownConfig::BINNED), &boxes).1.sah;
    let mut before = unsplit * (1.0 + 1e-2);
    for extra in [0.0, 0.3, 1.0] {
        let (tree, references) =
            built(&corners, &SpatialConfig { extra_references: extra, ..SpatialConfig::default() });
        let cost = checked(&tree, &references.boxes).1.sah;
        assert!(cost < before, "{extra} extra references: {cost}, with fewer {before}");
        before = cost;
    }
    assert!(before < 0.9 * unsplit, "{before} split, {unsplit} without");
}

/// Needles that halve in size towards a corner, so that planes separate one after another.
#[test]
fn the_depth_limit_holds() {
    let needles: Vec<Corners> =
        (0..120).map(|i| 2.0f32.powi(-i)).map(|x| [[x, 0.0, 0.0], [0.0, 1.5 * x, 0.0], [0.0, 0.0, 0.75 * x]]).collect();
    let depth = |max_depth| {
        let below = TopDownConfig { max_depth, ..TopDownConfig::BINNED };
        let (tree, references) = spatial(&needles, &SpatialConfig { object_splits: below, ..EAGER });
        checked(&tree, &references.boxes).0.depth
    };
    let unlimited = depth(u32::MAX);
    assert!(unlimited > 12, "depth {unlimited} without a limit");
    assert_eq!(depth(u32::MAX - 1), unlimited);
    for max_depth in [0, 1, 8, 9, 12] {
        assert!(depth(max_depth) <= max_depth.max(1 + 7), "{} beyond {max_depth}", depth(max_depth));
    }
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let corners = corners(&fixtures::scaffold(1, false));
    let on = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| spatial(&corners, &SpatialConfig::default()))
    };
    let one = on(1);
    assert!(one.1.boxes.len() > corners.len());
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
}
