//! Bugs reported to other libraries, by number of the thread; our results are correct.
//!
//! `benches/results/extremes.md` shows the results of Embree and `obvhs` on the same inputs if recorded with `--peers`. tinybvh is not tested,
//! because it ends the process on a fatal error. parry is not tested, because `parry3d` would add more than a dozen dependencies
//! for one row.

use canted_tests::{
    extremes::{self, Row, TRACKERS},
    tracers,
};

#[track_caller]
fn passes(name: &str) {
    let tracker = TRACKERS.iter().find(|tracker| tracker.name == name).expect("a known report");
    let rows = (tracker.rows)(&tracers::ours().0);
    assert!(!rows.iter().any(Row::is_broken), "{}", extremes::table(&rows));
    assert!(rows.iter().filter(|row| row.is_promise()).count() >= 2, "{}", extremes::table(&rows));
}

#[test]
fn embree_174() {
    passes("embree_174");
}

#[test]
fn embree_181() {
    passes("embree_181");
}

#[test]
fn embree_188() {
    passes("embree_188");
}

#[test]
fn embree_387() {
    passes("embree_387");
}

#[test]
fn tinybvh_277() {
    passes("tinybvh_277");
}

#[test]
fn tinybvh_282() {
    passes("tinybvh_282");
}

#[test]
fn tinybvh_283() {
    passes("tinybvh_283");
}

#[test]
fn tinybvh_286() {
    passes("tinybvh_286");
}

#[test]
fn parry_444() {
    passes("parry_444");
}

/// Every report has a test of the same name above.
#[test]
fn every_report_is_tested() {
    let source = include_str!("trackers.rs");
    for tracker in &TRACKERS {
        assert!(source.contains(&format!("\nfn {}() {{", tracker.name)), "{}", tracker.name);
    }
}
