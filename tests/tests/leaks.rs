//! Closed meshes do not leak and crossings alternate: a million rays, every tracer, every placement.
//!
//! `cargo xtask watertight` traces more rays, also at the bunny. Not covered here: every volume strategy (`watertight.rs`) and
//! every build configuration (`wide/closed.rs`).

use canted_tests::{
    closed::closed,
    leaks::{Found, placements, search},
    tracers,
};

const N_RAYS: usize = 1_000_000;

#[test]
#[expect(clippy::print_stderr, reason = "unavailable features are reported")]
fn a_million_rays_find_no_leak() {
    let (methods, missing) = tracers::ours();
    for name in missing {
        eprintln!("not tested: {name} is not available");
    }
    let found = search(&closed(), &placements(), &methods, N_RAYS, &mut |_| ());
    let leaks: Vec<&Found> = found.iter().filter(|found| found.n_leaks > 0).collect();
    assert!(leaks.is_empty(), "{leaks:#?}");
    assert!(found.iter().map(|found| found.n_rays).sum::<usize>() >= N_RAYS);
    for method in ["binary dop", "two-level binary", "wide scalar", "two-level wide"] {
        assert!(found.iter().any(|found| found.method == format!("crossings, {method}")), "{method}");
    }
}
