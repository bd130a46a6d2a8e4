//! Refits: results equal the loop over the moved shapes.

use canted_fixtures::SplitMix64;
use canted_obb::PrimId;
use canted_trace::Hit;
use canted_wide::{PrimitiveError, RefitError, WideBvh};

use crate::agree::{configs, first_difference, paths};
use crate::scenes::{capsules, rays, struts};
use crate::shape::{Capsule, loop_over_all};

fn moved(shapes: &[Capsule], size: f64, seed: u64) -> Vec<Capsule> {
    let mut rng = SplitMix64::new(seed);
    let mut step = |x: f32| (f64::from(x) + size * rng.signed()) as f32;
    shapes.iter().map(|shape| Capsule { ends: shape.ends.map(|end| end.map(&mut step)), ..*shape }).collect()
}

#[test]
fn hits_equal_the_loop_after_any_motion() {
    for shapes in [capsules(120, 1.0, 0.0), struts(200)] {
        for (name, config) in configs() {
            let mut bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
            let flat = shapes.iter().map(|s| Capsule { ends: s.ends.map(|[x, y, _]| [x, y, -0.0]), radius: 0.0 });
            let motions = [moved(&shapes, 0.1, 1), moved(&shapes, 5.0, 2), flat.collect(), shapes.clone()];
            for shapes in motions {
                bvh.refit(shapes.clone()).unwrap();
                assert_eq!(bvh.primitives(), shapes);
                let rays = rays(&shapes, 150);
                let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(&shapes, ray)).collect();
                for path in paths() {
                    let bvh = bvh.clone().with_path(path);
                    assert_eq!(first_difference(&bvh, &rays, &wants), None, "{name}");
                }
            }
        }
    }
}

#[test]
fn the_same_shapes_give_the_same_bvh() {
    let shapes = struts(500);
    for (name, config) in configs() {
        let mut bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
        let records = |bvh: &WideBvh<Capsule>| bvh.to_bytes()[160..bvh.to_bytes().len() - 8].to_vec();
        let built = records(&bvh);
        let refit = bvh.refit(shapes.clone()).unwrap();
        assert_eq!((refit.drift, refit.cost_before), (1.0, refit.cost_built), "{name}");
        assert_eq!(records(&bvh), built, "{name}");
        let away = bvh.refit(moved(&shapes, 2.0, 3)).unwrap();
        assert!(away.drift > 1.0, "{name}: {}", away.drift);
        let back = bvh.refit(shapes.clone()).unwrap();
        assert_eq!((back.drift, back.cost_before), (1.0, away.cost_now), "{name}");
        assert_eq!(records(&bvh), built, "{name}");
    }
}

#[test]
fn a_bvh_that_is_not_refitted_is_detected() {
    let shapes = struts(200);
    let after = moved(&shapes, 0.5, 1);
    let bvh = WideBvh::over(shapes).unwrap();
    let rays = rays(&after, 150);
    let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(&after, ray)).collect();
    assert!(first_difference(&bvh, &rays, &wants).is_some());
}

#[test]
fn rejected_shapes_change_nothing() {
    let shapes = struts(50);
    let mut bvh = WideBvh::over(shapes.clone()).unwrap();
    let before = bvh.to_bytes();
    let mut bad = shapes.clone();
    bad[17].ends[1][2] = f32::NAN;
    let error = RefitError::Primitive(PrimitiveError::Bounds { primitive: PrimId(17) });
    assert_eq!(bvh.refit(bad), Err(error));
    assert_eq!(error.to_string(), "primitive 17 has bounds that are empty or not finite");
    assert_eq!(bvh.refit(shapes[1..].to_vec()), Err(RefitError::Count { n_primitives: 50, n_given: 49 }));
    assert_eq!(bvh.to_bytes(), before);
}
