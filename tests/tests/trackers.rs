//! What other libraries' users reported, by the number of the thread: ours passes.
//!
//! What Embree and `obvhs` do on the same inputs stands in `tests/EXTREMES.md`, where `--peers` was given. tinybvh is not asked: what it
//! takes for a fatal error ends the process. Neither is parry: `parry3d` would bring more than a dozen crates along, a triangulator
//! and a tree of rectangles among them, for one row.

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

/// Every report has a test of its name above.
#[test]
fn every_report_is_tested() {
    let source = include_str!("trackers.rs");
    for tracker in &TRACKERS {
        assert!(source.contains(&format!("\nfn {}() {{", tracker.name)), "{}", tracker.name);
    }
}
