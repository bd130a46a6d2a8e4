//! The numerical contract: every row of the table that `cargo xtask extremes` writes holds, and bugs reported to other libraries, by number of
//! the thread, are not ours.
//!
//! `benches/results/extremes.md` shows the results of Embree and `obvhs` on the same inputs if recorded with `--peers`. tinybvh is not tested,
//! because it ends the process on a fatal error. parry is not tested, because `parry3d` would add more than a dozen dependencies
//! for one row.

use canted_obb::PrimId;
use canted_tests::{
    extremes::{
        self, Row, TRACKERS,
        hierarchy::{self, MISSED, PIERCED, SAME},
        instance::{self, NEAR},
    },
    tracers::{self, Guarantee, Make, Method, Tracer},
};
use canted_trace::{Hit, InstanceId, Ray, Side};

/// Number of inputs as in a full report.
const AS_A_REPORT: usize = 4;

#[test]
#[expect(clippy::print_stderr, reason = "unavailable features are reported")]
fn every_promise_holds() {
    let (methods, missing) = tracers::ours();
    let not_tried = extremes::not_tried(&missing);
    for what in &not_tried {
        eprintln!("not tried: {what}");
    }
    let rows = extremes::rows(AS_A_REPORT, &methods);
    let broken: Vec<&Row> = rows.iter().filter(|row| row.is_broken()).collect();
    assert!(broken.is_empty(), "{}", extremes::table(&broken.into_iter().cloned().collect::<Vec<_>>()));
    let stages = [
        "fit",
        "merge",
        "rotation",
        "tree",
        "cells",
        "limits",
        "tree on a device",
        "box",
        "box in an eight-wide node",
        "triangle",
        "triangle BVH",
        "instance",
        "curve",
        "patch",
        "film",
    ];
    for stage in stages {
        let n = rows.iter().filter(|row| row.promise.stage == stage && row.is_promise()).count();
        let is_reported = not_tried.iter().any(|what| what.contains(&format!("\"{stage}\"")));
        assert!(n >= 2 || is_reported, "{stage}: {n} rows");
    }
}

/// Returns the same answer for every ray.
#[derive(Clone, Copy)]
struct Constant(Option<Hit>);

impl Tracer for Constant {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        vec![self.0; rays.len()]
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        vec![self.0.is_some(); rays.len()]
    }
}

fn constant(answer: Option<Hit>) -> Method {
    let make: Make = Box::new(move |_, _| Box::new(Constant(answer)));
    Method::new("constant", Guarantee::Loop, make)
}

const ANY: Hit = Hit { t: 1.0, u: 0.25, v: 0.25, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front };

#[test]
fn constant_answers_break_every_promise() {
    for (answer, broken) in [(None, [PIERCED, SAME]), (Some(ANY), [MISSED, SAME])] {
        let rows = hierarchy::rows(1, &[constant(answer)]);
        for words in broken {
            let promised: Vec<&Row> =
                rows.iter().filter(|row| row.promise.promise == words && row.is_promise()).collect();
            let kept: Vec<&&Row> = promised.iter().filter(|row| row.holds()).collect();
            assert!(promised.len() > 15 && kept.is_empty(), "{} of {words}; kept: {kept:#?}", promised.len());
        }
    }
}

/// The cases of these rows.
fn cases<'a>(rows: &'a [Row], promise: &'a str, is: impl Fn(&Row) -> bool) -> Vec<&'a str> {
    rows.iter().filter(|row| row.promise.promise == promise && is(row)).map(|row| row.promise.case).collect()
}

#[test]
fn constant_answers_break_every_promise_of_instances() {
    let [nothing, anything] = [None, Some(ANY)].map(|answer| instance::rows(1, &[&constant(answer)]));
    for rows in [&nothing, &anything] {
        assert_eq!(cases(rows, SAME, Row::is_broken).len(), 8, "{rows:#?}");
    }
    assert_eq!(cases(&nothing, NEAR, Row::is_broken).len(), 8, "no hit has a valid position: {nothing:#?}");
    // There the stated error is larger than the mesh.
    let large = ["size 1e-3 at 1e7", "condition just below 2^20"];
    assert_eq!(cases(&anything, NEAR, Row::holds), large);
}

#[test]
fn a_device_without_hits_breaks_every_promise_of_instances() {
    let blind = Method::new("no hits", Guarantee::Device(canted_gpu::HIT_ERROR), constant(None).make);
    let rows = instance::rows(1, &[&blind]);
    // Transforms that the device rejects have no row, and nothing is certain where its error is larger than the mesh.
    assert_eq!(cases(&rows, SAME, |row| !row.is_promise()), ["size 1e-3 at 1e7"]);
    let broken = ["mirrored", "sheared", "scaled by 1e-6", "scaled by 1e6", "condition just below 2^10"];
    assert_eq!(cases(&rows, SAME, Row::is_broken), broken);
}

/// Every case but one has at least one ray with a certain result; that one promises nothing.
#[test]
fn nearly_every_case_has_certain_hits() {
    let rows = hierarchy::rows(1, &[constant(None)]);
    let reported: Vec<&str> = rows.iter().filter(|row| !row.is_promise()).map(|row| row.promise.case).collect();
    assert_eq!(reported, ["slivers, some of zero area"]);
}

#[test]
fn a_tracer_without_hits_fails_every_report() {
    let methods = [constant(None)];
    for tracker in &TRACKERS {
        let rows = (tracker.rows)(&methods);
        let is_asked = rows.iter().any(|row| row.routine == "constant");
        // Two equal answers are always consistent.
        let of_hits = |row: &&Row| row.promise.promise != MISSED;
        if is_asked && tracker.name != "tinybvh_282" {
            assert!(rows.iter().filter(of_hits).all(Row::is_broken), "{}", tracker.name);
        }
    }
}

#[test]
fn reported_bugs_are_not_ours() {
    for tracker in &TRACKERS {
        let rows = (tracker.rows)(&tracers::ours().0);
        let table = || format!("{}\n{}", tracker.name, extremes::table(&rows));
        assert!(!rows.iter().any(Row::is_broken), "{}", table());
        assert!(rows.iter().filter(|row| row.is_promise()).count() >= 2, "{}", table());
    }
}
