//! Rays and boxes: what is lost, what enters for the pad, and what a test costs.

use canted_tests::{extremes::slab, fractions};
use canted_trace::{Ray, ray_aabb, ray_obb};
use obvhs::{aabb::Aabb as TheirAabb, ray::Ray as TheirRay};

use super::super::model::{Cell, Table};
use super::super::samples::{Samples, number};
use crate::interleave::{self, Contender};

/// Whether a ray enters a box.
type Enters = fn(&slab::Pair) -> bool;

/// A leaning box is tested as it is and by the straight box around it; of a peer only the latter exists.
const ROUTINES: [(&str, Enters); 3] = [
    ("leaning box", |(ray, obb)| ray_obb(ray, obb).is_some()),
    ("its straight box", |(ray, obb)| ray_aabb(ray, &obb.aabb()).is_some()),
    ("its straight box, obvhs", |(ray, obb)| {
        let aabb = obb.aabb();
        TheirAabb::new(aabb.min.into(), aabb.max.into()).intersect_ray(&theirs(ray)).is_finite()
    }),
];

fn theirs(ray: &Ray) -> TheirRay {
    TheirRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

/// Every case by every routine.
#[expect(clippy::cast_precision_loss, reason = "small counts")]
pub(super) fn table(effort: usize, rounds: usize) -> Table {
    let title = "Rays and boxes, judged by fractions; times include making the box ready";
    let mut table = Table::new(title, &["case", "test", "meets the box, lost", "misses the box, enters", "time"]);
    for slab::Case { name, pairs } in slab::cases(effort) {
        let truths: Vec<bool> = pairs.iter().map(|(ray, obb)| fractions::meets_box(ray, obb)).collect();
        let contender = |(routine, enters): (&'static str, Enters)| {
            let pairs = &pairs;
            Contender::new(routine, move || {
                pairs.iter().for_each(|pair| {
                    std::hint::black_box(enters(pair));
                });
            })
        };
        let timings = interleave::run(rounds, ROUTINES.into_iter().map(contender).collect());
        for ((routine, enters), timing) in ROUTINES.into_iter().zip(timings) {
            let share = |of: bool, wanted: bool| {
                let among: Vec<_> = pairs.iter().zip(&truths).filter(|(_, meets)| **meets == of).collect();
                let n = among.iter().filter(|(pair, _)| enters(pair) == wanted).count();
                format!("{}%", number(100.0 * n as f64 / among.len().max(1) as f64))
            };
            let ns = Samples::from(timing.seconds).scaled(1e9 / pairs.len().max(1) as f64);
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(routine),
                Cell::text(share(true, false)),
                Cell::text(share(false, true)),
                Cell::measured(ns, "ns"),
            ]);
        }
    }
    table
}
