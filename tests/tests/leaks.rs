//! Closed meshes leak nowhere, and rays lead in and out of them in turn: a million rays, every way to trace, every place.
//!
//! `cargo xtask watertight` shoots more, at the bunny too. Not covered here: every strategy of volumes (`watertight.rs`) and
//! every way to build (`wide/closed.rs`).

use canted_tests::{
    closed::closed,
    leaks::{Found, places, search},
    tracers,
};

const N_RAYS: usize = 1_000_000;

#[test]
#[expect(clippy::print_stderr, reason = "what this machine has not is named")]
fn a_million_rays_find_no_leak() {
    let (ways, missing) = tracers::ours();
    for name in missing {
        eprintln!("not tested, this machine has no {name}");
    }
    let found = search(&closed(), &places(), &ways, N_RAYS, &mut |_| ());
    let leaks: Vec<&Found> = found.iter().filter(|found| found.n_leaks > 0).collect();
    assert!(leaks.is_empty(), "{leaks:#?}");
    assert!(found.iter().map(|found| found.n_rays).sum::<usize>() >= N_RAYS);
    for way in ["binary dop", "two levels of binary", "wide scalar", "two levels of wide"] {
        assert!(found.iter().any(|found| found.way == format!("crossings, {way}")), "{way}");
    }
}
