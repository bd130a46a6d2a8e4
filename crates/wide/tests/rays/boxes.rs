//! Which boxes a ray enters: by traversal, and by a loop in `f64`.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Intersect, Ray, ScaledRay};
use canted_wide::{Config, NodeBox, NodeLanes, Order, Preset, PrimitiveError, TriangleBvh, WideBvh};

use crate::common::{paths, scenes};

/// Half of `f32::EPSILON`: the relative error of one rounding.
const U: f64 = 0.5 * f32::EPSILON as f64;

/// Error of the loop in `f64`, relative: a hundred of its roundings.
const F64_SLACK: f64 = 100.0 * f64::EPSILON;

/// Boxes of all sizes, some flat, some points, some twice.
fn boxes(n: usize, scale: f32, offset: f32) -> Vec<Aabb> {
    let mut rng = SplitMix64::new(31);
    let mut boxes: Vec<Aabb> = (0..n)
        .map(|i| {
            let min: [f32; 3] = std::array::from_fn(|_| scale * (8.0 * rng.unit() as f32 - 4.0) + offset);
            let size = [0.0, 0.01, 0.3, 3.0][i % 4];
            let flat = i % 5;
            let max =
                std::array::from_fn(|k| if k == flat { min[k] } else { min[k] + scale * size * rng.unit() as f32 });
            Aabb { min, max }
        })
        .collect();
    boxes.extend_from_within(..n / 4);
    boxes
}

/// At corners, along edges and faces, from inside, far away and bounded.
fn rays(boxes: &[Aabb], n: usize, scale: f32) -> Vec<Ray> {
    let mut rng = SplitMix64::new(32);
    (0..n)
        .map(|i| {
            let target = boxes[rng.below(boxes.len())];
            let corner: [f32; 3] = std::array::from_fn(|k| if i >> k & 1 == 0 { target.min[k] } else { target.max[k] });
            let random: [f32; 3] = rng.on_sphere().map(|x| x as f32);
            let distance = scale * [0.0, 0.1, 10.0, 1e3][i % 4];
            let origin: [f32; 3] = std::array::from_fn(|k| corner[k] + distance * random[k]);
            let mut direction: [f32; 3] = std::array::from_fn(|k| corner[k] - origin[k]);
            if i % 7 == 0 || direction == [0.0; 3] {
                direction = [[1.0, 0.0, -0.0], [0.0, -1.0, 0.0], random][i % 3];
            }
            let t_max = if i % 6 == 0 { 1.0 } else { f32::INFINITY };
            Ray { t_max, ..Ray::new(origin, direction) }
        })
        .collect()
}

/// Boxes that the ray enters when they are grown by `grown` in each coordinate, and the interval by a relative `slack`.
fn entered(boxes: &[Aabb], ray: &ScaledRay, grown: f64, slack: f64) -> BTreeSet<u32> {
    let enters = |aabb: &Aabb| {
        let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
        for k in 0..3 {
            let (o, d) = (f64::from(ray.origin[k]), f64::from(ray.direction[k]));
            let (lo, hi) = (f64::from(aabb.min[k]) - grown - o, f64::from(aabb.max[k]) + grown - o);
            if d == 0.0 {
                if lo > 0.0 || hi < 0.0 {
                    return false;
                }
                continue;
            }
            near = near.max((lo / d).min(hi / d));
            far = far.min((lo / d).max(hi / d));
        }
        near <= far + slack * far.abs().min(1e30)
    };
    (0..).zip(boxes).filter(|(_, aabb)| enters(aabb)).map(|(number, _)| number).collect()
}

fn visited(bvh: &WideBvh<Aabb>, ray: &ScaledRay, error: f64) -> BTreeSet<u32> {
    let mut numbers = BTreeSet::new();
    let stack = &mut vec![0; bvh.stack_len()][..];
    bvh.traverse_scaled(ray, error, Order::Nearest, stack, &mut |PrimId(number), t_max| {
        assert!(numbers.insert(number), "box {number} is entered twice");
        t_max
    });
    let mut in_any_order = BTreeSet::new();
    bvh.traverse_scaled(ray, error, Order::Any, stack, &mut |PrimId(number), t_max| {
        in_any_order.insert(number);
        t_max
    });
    assert_eq!(numbers, in_any_order);
    numbers
}

#[test]
fn boxes_that_an_exact_ray_enters_are_entered_and_few_others() {
    for (scale, offset) in [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e5)] {
        let boxes = boxes(300, scale, offset);
        let reach = boxes.iter().map(Aabb::reach).fold(0.0, f32::max);
        let rays = rays(&boxes, 400, scale);
        for preset in [Preset::Fast, Preset::Quality] {
            let bvh = WideBvh::over_with(boxes.clone(), preset).expect("valid boxes");
            for path in paths() {
                let bvh = bvh.clone().with_path(path);
                for (i, ray) in rays.iter().enumerate() {
                    let ray = ScaledRay::new(ray).expect("a valid ray");
                    let size = f64::from(ray.origin.iter().fold(reach, |all, o| all.max(o.abs())));
                    let error = [0.0, 1e-3, 1.0][i % 3] * f64::from(scale);
                    let visited = visited(&bvh, &ray, error);
                    let least = entered(&boxes, &ray, error * (1.0 - F64_SLACK), -F64_SLACK);
                    let lost: Vec<_> = least.difference(&visited).collect();
                    assert!(lost.is_empty(), "{scale} {offset} {}: {ray:?} does not enter {lost:?}", path.name());
                    // 8 u of pad, 5 u of rounding, relative to at most twice the size and the error.
                    let most = entered(&boxes, &ray, error + 13.0 * U * (2.0 * size + error), F64_SLACK);
                    let needless: Vec<_> = visited.difference(&most).collect();
                    assert!(needless.is_empty(), "{scale} {offset} {}: {ray:?} enters {needless:?}", path.name());
                }
            }
        }
    }
}

/// With a stated error of zero, boxes are lost that one of a tenth enters.
#[test]
fn the_stated_error_admits_near_misses() {
    let boxes = boxes(300, 1.0, 0.0);
    let bvh = WideBvh::over(boxes.clone()).expect("valid boxes");
    let lost = |error: f64| {
        let rays = rays(&boxes, 400, 1.0).into_iter().filter_map(|ray| ScaledRay::new(&ray));
        rays.map(|ray| entered(&boxes, &ray, 0.1, -F64_SLACK).difference(&visited(&bvh, &ray, error)).count())
            .sum::<usize>()
    };
    assert_eq!(lost(0.1001), 0);
    assert!(lost(0.0) > 100, "{} lost", lost(0.0));
}

#[test]
fn traversal_is_ordered_and_ends_at_the_returned_t_max() {
    let row: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb { min: [x; 3], max: [x + 0.5; 3] }).collect();
    let bvh = WideBvh::over(row.clone()).expect("valid boxes");
    let ray = Ray::new([-1.0; 3], [0.25; 3]);
    let scaled = ScaledRay::new(&ray).expect("a valid ray");
    let (mut order, mut n, stack) = (vec![], 0, &mut vec![0; bvh.stack_len()][..]);
    // Something in box 40 is hit.
    bvh.traverse_scaled(&scaled, 0.0, Order::Nearest, stack, &mut |PrimId(number), t_max| {
        order.push(number);
        if number == 40 { 41.25 } else { t_max }
    });
    assert_eq!(order, (0..=40).collect::<Vec<_>>());
    let n_boxes = bvh.traverse_scaled(&scaled, 0.0, Order::Any, stack, &mut |_, _| {
        n += 1;
        if n == 3 { -1.0 } else { 1e9 }
    });
    assert_eq!((n, n_boxes % 8), (3, 0));
    // The same in units of the ray's own direction.
    order.clear();
    bvh.traverse(&ray, |PrimId(number), t_max| {
        order.push(number);
        ControlFlow::Continue(if number == 40 { 4.0 * 41.25 } else { t_max })
    });
    assert_eq!(order, (0..=40).collect::<Vec<_>>());
    bvh.traverse(&ray, |PrimId(number), _| {
        order.push(number);
        ControlFlow::Break(())
    });
    assert_eq!(order[41..], [0]);
}

#[test]
fn invalid_boxes_are_rejected_by_id() {
    let valid = Aabb { min: [0.0; 3], max: [1.0; 3] };
    for bad in [Aabb::EMPTY, Aabb { min: [f32::NAN; 3], ..valid }, Aabb { max: [f32::INFINITY; 3], ..valid }] {
        let rejected = WideBvh::over(vec![valid, bad, valid]).map(|_| ());
        assert_eq!(rejected, Err(PrimitiveError::Bounds { primitive: PrimId(1) }), "{bad:?}");
    }
    let none = WideBvh::<Aabb>::over(vec![]).expect("no box is invalid");
    assert!(none.aabb().is_empty());
    none.traverse(&Ray::new([0.0; 3], [1.0; 3]), |_, _| panic!("nothing can be entered"));
}

/// A walk by hand finds every primitive, in boxes that contain it, and lanes hold the same boxes.
#[test]
fn subtrees_contain_their_primitives() {
    for (name, mesh) in scenes() {
        for aligned_node in [1.0, f32::INFINITY] {
            let mut config = Config::preset(Preset::Quality);
            config.costs.aligned_node = aligned_node;
            let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap();
            let reference = bvh.reference_point().map(f64::from);
            let contains = |NodeBox { rows, lo, hi }: &NodeBox, p: [f32; 3]| {
                (0..3).all(|k| {
                    let along: f64 = (0..3).map(|j| f64::from(rows[k][j]) * (f64::from(p[j]) - reference[j])).sum();
                    lo[k] <= along && along <= hi[k]
                })
            };
            let mut n_found = vec![0; mesh.triangles.len()];
            let mut open: Vec<_> = bvh.root().map(|root| (root, bvh.root_box())).into_iter().collect();
            while let Some((subtree, around)) = open.pop() {
                bvh.for_each_in(subtree, |primitive, triangle| {
                    n_found[primitive.index()] += 1;
                    assert!(triangle.iter().all(|&vertex| contains(&around, vertex)), "{name}: {primitive}");
                });
                assert_eq!(bvh.lanes(subtree).is_none(), subtree.is_leaf());
                let children = (0..8).filter_map(|lane| Some((lane, bvh.child(subtree, lane)?)));
                for (lane, (child, slot)) in children {
                    let (lo, hi) = match bvh.lanes(subtree) {
                        Some(NodeLanes::Aligned(rows)) => (rows[2][lane], rows[3][lane]),
                        Some(NodeLanes::Oriented(rows)) => {
                            (rows[8][lane] - rows[9][lane], rows[8][lane] + rows[9][lane])
                        }
                        None => panic!("{name}: a leaf has no children"),
                    };
                    assert_eq!([lo, hi], [slot.lo[1] as f32, slot.hi[1] as f32], "{name}");
                    open.push((child, slot));
                }
            }
            assert!(n_found.iter().all(|&n| n > 0), "{name}");
        }
    }
    assert!(TriangleBvh::build(&[[0.0_f32; 3]; 0], &[[0_u32; 3]; 0]).unwrap().root().is_none());
}
