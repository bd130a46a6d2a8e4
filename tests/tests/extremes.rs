//! The numerical contract: every row of the table that `cargo xtask extremes` writes holds.

use canted_tests::{
    extremes::{self, Row},
    tracers,
};

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
