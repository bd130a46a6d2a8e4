//! Invalid rays in a batch with valid ones: not finite, zero direction, empty interval.

use canted_fixtures::soup;
use canted_trace::{Hit, Ray};

use super::{Oracle, Promise, Row};
use crate::{
    reference,
    tracers::{Guarantee, Method},
};

/// Invalid variants of a ray.
fn invalid(ray: &Ray) -> Vec<Ray> {
    let mut rays = vec![
        Ray { direction: [0.0, -0.0, 0.0], ..*ray },
        Ray { t_min: f32::NAN, ..*ray },
        Ray { t_max: f32::NAN, ..*ray },
        Ray { t_min: 2.0, t_max: 1.0, ..*ray },
    ];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut of_origin, mut of_direction) = (*ray, *ray);
            of_origin.origin[axis] = bad;
            of_direction.direction[axis] = bad;
            rays.extend([of_origin, of_direction]);
        }
    }
    rays
}

pub(super) fn rows(methods: &[Method]) -> Vec<Row> {
    const NONE: Promise = Promise::none(
        "triangle BVH",
        "NaN, infinity, zero direction, empty interval",
        "no hit",
        Oracle::Known,
        "rays hit",
    );
    const BESIDE: Promise = Promise {
        promise: "valid rays in the batch are unaffected",
        oracle: Oracle::Same,
        unit: "rays differ",
        ..NONE
    };
    let mesh = soup(26, 60);
    let good = reference::rays(&mesh, 60, 97);
    // One valid ray, then all its invalid variants.
    let mixed: Vec<(bool, Ray)> = good
        .iter()
        .flat_map(|ray| std::iter::once((true, *ray)).chain(invalid(ray).into_iter().map(|ray| (false, ray))))
        .collect();
    let rays: Vec<Ray> = mixed.iter().map(|&(_, ray)| ray).collect();
    let mut by_promise: [Vec<Row>; 2] = Default::default();
    for method in methods {
        let tracer = method.of(&mesh);
        let ask = |rays: &[Ray]| {
            let short = |hit: Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.primitive));
            tracer.closest(rays).into_iter().map(short).zip(tracer.occluded(rays)).collect::<Vec<_>>()
        };
        let ((alone, among), n_cut) = method.with_cuts(|| (ask(&good), ask(&rays)));
        let of = |is_good: bool| {
            mixed.iter().zip(&among).filter(move |((good, _), _)| *good == is_good).map(|(_, found)| *found)
        };
        let n_hit = of(false).filter(|&found| found != (None, false)).count();
        let n_other = of(true).zip(&alone).filter(|(among, alone)| among != *alone).count();
        let counts = [(rays.len() - good.len(), n_hit), (good.len(), n_other)];
        for ((of_promise, promise), (n, n_failed)) in by_promise.iter_mut().zip([NONE, BESIDE]).zip(counts) {
            of_promise.push(Row {
                is_peer: method.guarantee == Guarantee::Peer,
                n_cut,
                ..promise.count(&method.name, n, n_failed)
            });
        }
    }
    by_promise.concat()
}
