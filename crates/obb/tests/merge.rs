//! Merges: the extreme cases by name, against exact containment.

#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

mod common;

use canted_obb::merge::{self, Child, Weight};
use canted_obb::{Aabb, Frame, Moments, Obb, bound};
use common::clouds::{self, Random, placed};
use common::exact::{self, ExactBox};
use common::growth::{REFRAMED, assert_contains, growth};

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
    let clouds = clouds::all();
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
    for (name, points) in clouds::all() {
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
                    Child::Box(content) => exact::corners(content).iter().all(|corner| oracle.contains(corner)),
                    Child::Triangle(corners) => corners.iter().all(|&c| oracle.contains(&exact::exact_point(c))),
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
        assert!(vertices.iter().all(|&v| oracle.contains(&exact::exact_point(v))), "{rule}");
        let aligned = Aabb::from_points(vertices).area();
        assert!(chain.area() < 4.0 * aligned, "{rule}: {} grew over {aligned}", chain.area());
    }
}

#[test]
fn the_fallback_is_never_worse_than_the_aligned_box() {
    let mut random = Random(51);
    let mut fell_back = 0;
    for (name, points) in clouds::all() {
        let mid = points.len().div_ceil(2);
        let halves = [&points[..mid], &points[mid - 1..]].map(|half| bound(random.frame(), half.iter().copied()));
        let content = Aabb::from_points(points.iter().copied());
        let aligned = Obb::from_aabb(&content);
        for (rule, merged) in RULES {
            let with = merged(&halves[0], &halves[1]).or_aabb(&content);
            assert!(with.area() <= aligned.area(), "{rule}: {name}");
            let oracle = ExactBox::of(&with);
            assert!(points.iter().all(|&p| oracle.contains(&exact::exact_point(p))), "{rule}: {name}");
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
