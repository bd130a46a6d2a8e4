//! The numerical contract: every row of the table that `cargo xtask extremes` writes holds.

use canted_obb::PrimId;
use canted_tests::{
    extremes::{self, Oracle, Row, TRACKERS, hierarchy},
    tracers::{self, Make, Tracer, Way, Word},
};
use canted_trace::{Hit, InstanceId, Ray, Side};

#[test]
#[expect(clippy::print_stderr, reason = "what this machine has not is named")]
fn every_promise_is_kept() {
    let (ways, missing) = tracers::ours();
    for name in missing {
        eprintln!("not tested, this machine has no {name}");
    }
    let rows = extremes::rows(1, &ways);
    let broken: Vec<&Row> = rows.iter().filter(|row| !row.is_peer && !row.holds()).collect();
    assert!(broken.is_empty(), "{}", extremes::table(&broken.into_iter().cloned().collect::<Vec<_>>()));
    let stations =
        ["fit", "merge", "rotation", "tree", "cells", "box", "triangle", "tree of triangles", "instance", "film"];
    for station in stations {
        let n = rows.iter().filter(|row| row.promise.station == station).count();
        assert!(n >= 2, "{station}: {n} rows");
    }
}

/// Answers every ray the same.
#[derive(Clone, Copy)]
struct Stubborn(Option<Hit>);

impl Tracer for Stubborn {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        vec![self.0; rays.len()]
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        vec![self.0.is_some(); rays.len()]
    }
}

fn stubborn(answer: Option<Hit>) -> Way {
    let make: Make = Box::new(move |_, _| Box::new(Stubborn(answer)));
    Way::new("stubborn", Word::Loop, make)
}

const ANY: Hit = Hit { t: 1.0, u: 0.25, v: 0.25, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front };

#[test]
fn who_sees_nothing_or_anything_breaks_every_promise() {
    for answer in [None, Some(ANY)] {
        let rows = hierarchy::rows(1, &[stubborn(answer)]);
        for oracle in [Oracle::Exact, Oracle::Loop] {
            let judged: Vec<&Row> = rows.iter().filter(|row| row.promise.oracle == oracle).collect();
            let n_kept = judged.iter().filter(|row| row.holds()).count();
            // Of needles without area, and where rounding is larger than triangles, nothing is certain.
            assert!(judged.len() > 10 && 4 * n_kept <= judged.len(), "{answer:?}, {oracle:?}: {n_kept} kept");
        }
    }
}

#[test]
fn who_sees_nothing_fails_every_report_that_asks_him() {
    let ways = [stubborn(None)];
    for tracker in &TRACKERS {
        let rows = (tracker.rows)(&ways);
        let is_asked = rows.iter().any(|row| row.routine == "stubborn");
        // Sameness of two answers is kept by who always says the same.
        if is_asked && tracker.name != "tinybvh_282" {
            assert!(rows.iter().all(|row| !row.holds()), "{}", tracker.name);
        }
    }
}
