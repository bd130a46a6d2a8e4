//! Merges: the extreme cases by name, against exact containment; averages of two boxes' rotations: signs, symmetries, weights.

use canted_obb::{
    Aabb, Frame, Moments, Obb, Quaternion, bound, frame,
    merge::{self, Child, Weight},
};

use super::common::{ExactBox, REFRAMED, Random, all_clouds, assert_contains, corners, exact_point, growth, placed};

/// A rule by name.
type Rule = (&'static str, fn(&Obb, &Obb) -> Obb);

const RULES: [Rule; 5] = [
    ("bounded by corners", |a, b| merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Corners)),
    ("bounded by area", |a, b| merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Area)),
    ("quaternion", |a, b| merge::quaternion(a, b, [a.area(), b.area()])),
    ("best", |a, b| merge::best(a, b, None)),
    ("combined", |a, b| merge::combined(&Child::Box(*a), &Child::Box(*b))),
];

#[test]
fn every_pair_of_clouds_is_contained() {
    let mut random = Random(41);
    let clouds = all_clouds();
    for (i, (name, points)) in clouds.iter().enumerate() {
        let (other_name, other) = &clouds[(i * 7 + 3) % clouds.len()];
        let a = bound(random.frame(), points.iter().copied());
        let b = bound(random.frame(), other.iter().copied());
        for (rule, merged) in RULES {
            assert_contains(&format!("{rule}: {name} and {other_name}"), &merged(&a, &b), &[a, b]);
        }
        let content = Moments::from_points(points.iter().chain(other).copied());
        assert_contains("best with moments", &merge::best(&a, &b, Some(&content)), &[a, b]);
    }
}

#[test]
fn triangles_and_boxes_are_contained() {
    let mut random = Random(42);
    for (name, points) in all_clouds() {
        let child = Child::Box(bound(random.frame(), points.iter().copied()));
        let triangle = std::array::from_fn(|i| points[(i * i) % points.len()]);
        let (leaf, other) = (Child::Triangle(triangle), Child::Triangle(triangle.map(|[x, y, z]| [y, z, x])));
        for (a, b) in [(child, leaf), (leaf, child), (leaf, other)] {
            let merges = [
                merge::bounded(&a, &b, Weight::Area),
                merge::bounded(&a, &b, Weight::Corners),
                merge::combined(&a, &b),
            ];
            for merged in merges {
                let oracle = ExactBox::of(&merged);
                let inside = |content: &Child| match content {
                    Child::Box(content) => corners(content).iter().all(|corner| oracle.contains(corner)),
                    Child::Triangle(corners) => corners.iter().all(|&c| oracle.contains(&exact_point(c))),
                };
                assert!(inside(&a) && inside(&b), "{name}: {a:?} {b:?} {merged:?}");
            }
        }
    }
}

#[test]
fn equal_and_nested_boxes_do_not_grow() {
    let mut random = Random(43);
    for _ in 0..200 {
        let outer = Obb { center: [0.0; 3], frame: random.frame(), half_extents: [4.0, 1.0, 0.25] };
        let inner = Obb { half_extents: [2.0, 0.5, 0.125], ..outer };
        for (rule, merged) in RULES {
            for child in [outer, inner] {
                let parent = merged(&outer, &child);
                assert!(growth(&parent, &outer) <= REFRAMED, "{rule}: {parent:?} for {outer:?}");
            }
        }
        // Along a child's own axes only the half-extents are rounded up, once.
        let parent = merge::best(&outer, &inner, None);
        assert!(growth(&parent, &outer) <= f64::from(f32::EPSILON), "{parent:?} for {outer:?}");
    }
}

#[test]
fn boxes_without_volume_merge() {
    let mut random = Random(49);
    for _ in 0..50 {
        let rotated = random.frame();
        let flat = Obb { center: [0.0; 3], frame: rotated, half_extents: [2.0, 1.0, 0.0] };
        let line = Obb { half_extents: [2.0, 0.0, 0.0], ..flat };
        let crossing = Obb { half_extents: [0.0, 2.0, 0.0], ..flat };
        let point = Obb { half_extents: [0.0; 3], ..flat };
        let nearby = Obb { center: placed(rotated, [1.0; 3], [0.0; 3], [5.0, 0.0, 0.0]), ..flat };
        for (rule, merged) in RULES {
            for (a, b) in [(flat, nearby), (flat, point), (line, crossing), (line, line), (point, point)] {
                let parent = merged(&a, &b);
                assert_contains(rule, &parent, &[a, b]);
                assert!(parent.half_extents.iter().all(|half| half.is_finite()), "{rule}");
                // All lie in one plane: what stands out of it is rounding, of the frame and of the centers at five.
                let crossed = a != b && a.area() == 0.0 && b.area() == 0.0;
                if crossed {
                    // Two lines may be the diagonals of a box that stands out of their plane and has less area.
                    continue;
                }
                let thin = parent.half_extents.iter().fold(f32::MAX, |a, &b| a.min(b));
                assert!(thin <= 32.0 * f32::EPSILON, "{rule}: {a:?} {b:?} {parent:?}");
            }
        }
    }
}

#[test]
fn thirty_levels_lose_no_vertex() {
    let mut random = Random(50);
    for (rule, merged) in RULES {
        let mut vertices: Vec<[f32; 3]> = (0..3).map(|_| random.vector().map(|x| x as f32)).collect();
        let mut chain = bound(random.frame(), vertices.iter().copied());
        for level in 0..30 {
            let (rotated, reach) = (random.frame(), 1.2_f64.powi(level));
            let scale = [reach, 0.1 * reach, 0.0];
            let triangle: Vec<_> = (0..3).map(|_| placed(rotated, scale, [0.0; 3], random.vector())).collect();
            let leaf = bound(rotated, triangle.iter().copied());
            vertices.extend(triangle);
            chain = if level % 2 == 0 { merged(&chain, &leaf) } else { merged(&leaf, &chain) };
            if level % 5 == 4 {
                chain = chain.or_aabb(&Aabb::from_points(vertices.iter().copied()));
            }
        }
        let oracle = ExactBox::of(&chain);
        assert!(vertices.iter().all(|&v| oracle.contains(&exact_point(v))), "{rule}");
        let aligned = Aabb::from_points(vertices).area();
        assert!(chain.area() < 4.0 * aligned, "{rule}: {} grew over {aligned}", chain.area());
    }
}

#[test]
fn the_fallback_is_never_worse_than_the_aligned_box() {
    let mut random = Random(51);
    let mut fell_back = 0;
    for (name, points) in all_clouds() {
        let mid = points.len().div_ceil(2);
        let halves = [&points[..mid], &points[mid - 1..]].map(|half| bound(random.frame(), half.iter().copied()));
        let content = Aabb::from_points(points.iter().copied());
        let aligned = Obb::from_aabb(&content);
        for (rule, merged) in RULES {
            let with = merged(&halves[0], &halves[1]).or_aabb(&content);
            assert!(with.area() <= aligned.area(), "{rule}: {name}");
            let oracle = ExactBox::of(&with);
            assert!(points.iter().all(|&p| oracle.contains(&exact_point(p))), "{rule}: {name}");
            fell_back += usize::from(with == aligned);
        }
    }
    assert!(fell_back > 0, "random halves should lose to the aligned box somewhere");
}

#[test]
fn the_best_is_no_worse_than_any_rule_it_tries() {
    let mut random = Random(52);
    for _ in 0..300 {
        let [a, b] = [0, 1].map(|_| {
            let center = random.vector().map(|x| 3.0 * x as f32);
            Obb { center, frame: random.frame(), half_extents: random.vector().map(|x| x.abs() as f32) }
        });
        let best = merge::best(&a, &b, None).area();
        let candidates: [Frame; 4] =
            [a.frame, b.frame, merge::average(a.frame, b.frame, [a.area(), b.area()]), Obb::IDENTITY_FRAME];
        for candidate in candidates {
            let parent = merge::enclose(candidate, [&Child::Box(a), &Child::Box(b)]);
            assert!(best <= parent.area());
        }
    }
}

#[test]
fn the_combined_rule_follows_the_kind_of_child() {
    let mut random = Random(53);
    let mut triangle = || Child::Triangle([0, 1, 2].map(|_| random.vector().map(|x| x as f32)));
    let (s, t) = (triangle(), triangle());
    let (a, b) = (merge::bounded(&s, &t, Weight::Area), merge::bounded(&triangle(), &t, Weight::Area));
    let [a_child, b_child] = [a, b].map(Child::Box);
    assert_eq!(merge::combined(&s, &t), merge::bounded(&s, &t, Weight::Area));
    assert_eq!(merge::combined(&a_child, &t), merge::bounded(&a_child, &t, Weight::Area));
    assert_eq!(merge::combined(&s, &b_child), merge::bounded(&s, &b_child, Weight::Area));
    assert_eq!(merge::combined(&a_child, &b_child), merge::quaternion(&a, &b, [a.area(), b.area()]));
}

#[test]
fn powers_of_two_scale_every_bit() {
    let mut random = Random(54);
    for _ in 0..50 {
        let make = |random: &mut Random| Obb {
            center: random.vector().map(|x| x as f32),
            frame: random.frame(),
            half_extents: random.vector().map(|x| x.abs() as f32),
        };
        let (a, b) = (make(&mut random), make(&mut random));
        for exponent in [-60, 60] {
            let scaled = |obb: &Obb| Obb {
                center: obb.center.map(|x| x * 2.0_f32.powi(exponent)),
                half_extents: obb.half_extents.map(|x| x * 2.0_f32.powi(exponent)),
                ..*obb
            };
            for (rule, merged) in RULES {
                assert_eq!(merged(&scaled(&a), &scaled(&b)), scaled(&merged(&a, &b)), "{rule}");
            }
        }
    }
}

#[test]
fn opposite_quaternions_give_the_same_bits() {
    let mut random = Random(44);
    for _ in 0..500 {
        let (p, q) = (random.rotation(), random.rotation());
        let expected = merge::average_rotations(p, q, [1.0, 3.0]).frame();
        for (p, q) in [(p.scaled(-1.0), q), (p, q.scaled(-1.0)), (p.scaled(-1.0), q.scaled(-1.0))] {
            assert_eq!(merge::average_rotations(p, q, [1.0, 3.0]).frame(), expected);
        }
    }
}

/// The 24 ways to name a box's axes, right-handed, with the half-extents in their order.
fn renamed(obb: &Obb) -> Vec<Obb> {
    let mut all = Vec::new();
    for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
        for signs in 0..4 {
            let signed = |k: usize, flip: bool| obb.frame[k].map(|c| if flip { -c } else { c });
            let frame = [signed(x, signs & 1 == 1), signed(y, signs & 2 == 2), obb.frame[z]];
            let third = frame::right_handed(frame);
            all.push(Obb {
                frame: third,
                half_extents: [obb.half_extents[x], obb.half_extents[y], obb.half_extents[z]],
                ..*obb
            });
        }
    }
    all
}

#[test]
fn rotations_by_90_and_180_degrees_are_symmetries() {
    let mut random = Random(45);
    for rotated in [Obb::IDENTITY_FRAME, random.frame(), random.frame(), random.frame()] {
        let obb = Obb { center: [1.0, -2.0, 3.0], frame: rotated, half_extents: [2.0, 0.5, 0.25] };
        let all = renamed(&obb);
        assert_eq!(all.len(), 24);
        for a in &all {
            for b in &all {
                let parent = merge::quaternion(a, b, [1.0, 2.0]);
                assert!(growth(&parent, &obb) <= REFRAMED, "{a:?} and {b:?} to {parent:?}");
            }
        }
        // What averaging without care would make of two such boxes, as a volume.
        let parent = merge::quaternion(&all[0], &all[8], [1.0, 1.0]);
        // Each half-extent may grow by that part of the greatest: the volume by it times 2 · (1/2 + 1/0.5 + 1/0.25).
        assert!((parent.volume() / 2.0 - 1.0).abs() <= 13.0 * REFRAMED, "{}", parent.volume());
    }
}

#[test]
fn the_nearest_symmetry_is_the_nearest_of_all_twenty_four() {
    let mut random = Random(46);
    let all = renamed(&Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0; 3] });
    let symmetries: Vec<Quaternion> = all.iter().map(|obb| Quaternion::from_frame(obb.frame)).collect();
    for _ in 0..2_000 {
        let (p, q) = (random.rotation(), random.rotation());
        let least = symmetries.iter().map(|&g| p.dot(q.times(g)).abs()).fold(0.0, f64::max);
        // Halfway between the two the rotation to either end is half of the least: cos(θ/4) from cos(θ/2).
        let halfway = merge::average_rotations(p, q, [1.0, 1.0]);
        let expected = (0.5 * (1.0 + least)).sqrt();
        assert!((halfway.dot(p) - expected).abs() < 16.0 * f64::EPSILON, "{p:?} {q:?}");
        // No two frames are farther apart than 62.8° once symmetries are counted (Mackenzie 1958).
        assert!(2.0 * least.acos() < 62.81_f64.to_radians());
    }
}

#[test]
fn weights_pull_the_average() {
    let mut random = Random(47);
    for _ in 0..50 {
        let great = Obb { center: [0.0; 3], frame: random.frame(), half_extents: [4.0, 1.0, 0.01] };
        let speck = Obb { center: [1.0, 0.0, 0.0], frame: random.frame(), half_extents: [1e-6; 3] };
        assert!(parallel(merge::average(great.frame, speck.frame, [1e6, 1.0]), great.frame) > 1.0 - 1e-5);
        let evenly = merge::average(great.frame, speck.frame, [0.0, 0.0]);
        assert_eq!(evenly, merge::average(great.frame, speck.frame, [7.0, 7.0]));
        // By area the corners of a speck do not weigh either; by count they rotation the plane towards it.
        let far = Obb { center: placed(great.frame, [1.0; 3], [0.0; 3], [0.0, 3.0, 2.0]), ..speck };
        let axes = |weight| merge::bounded(&Child::Box(great), &Child::Box(far), weight).frame;
        assert!(parallel(axes(Weight::Area), great.frame) > 1.0 - 1e-5);
        assert!(parallel(axes(Weight::Corners), great.frame) < 0.9);
    }
}

/// Least cosine between axes of the same number.
fn parallel(a: Frame, b: Frame) -> f32 {
    (0..3).map(|k| (0..3).map(|j| a[k][j] * b[k][j]).sum::<f32>().abs()).fold(1.0, f32::min)
}

#[test]
fn skewed_and_mirrored_children_merge_by_their_rotations() {
    let mut random = Random(48);
    for _ in 0..50 {
        let [x, y, z] = random.frame();
        let aligned = Obb { center: [0.0; 3], frame: [x, y, z], half_extents: [3.0, 1.0, 0.5] };
        let mirrored = Obb { frame: [x, y, z.map(|c| -c)], ..aligned };
        let stretched = Obb { frame: [x.map(|c| 4.0 * c), y, z], half_extents: [0.75, 1.0, 0.5], ..aligned };
        for other in [mirrored, stretched] {
            let parent = merge::quaternion(&aligned, &other, [1.0, 1.0]);
            assert_contains("skewed", &parent, &[aligned, other]);
            assert!(growth(&parent, &aligned) <= REFRAMED, "{other:?} {parent:?}");
        }
    }
}
