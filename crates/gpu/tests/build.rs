//! Builds on devices that have no room for all of one. Twins of whole builds are in the package of tests.

#[expect(dead_code, reason = "no test here has a device without such a limit")]
mod common;

use canted_gpu::{
    GpuError,
    build::{Items, Passes},
};
use canted_lbvh::{Bits, Corners, Strategy};
use common::lowered;

#[test]
fn passes_that_fit_are_timed_where_others_are_refused() {
    let Some(gpu) = lowered("passes_that_fit_are_timed_where_others_are_refused", 48 << 10) else { return };
    // Of each triangle 36 bytes of corners and 24 of an axis-aligned box, which fit, and 60 of a leaning box, which do not.
    let triangle = |i: u16| {
        let x = f32::from(i);
        [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, f32::from(i % 7)]]
    };
    let corners: Vec<Corners> = (0..1000).map(triangle).collect();
    let items = Items::triangles(&gpu, [&corners[..]]).unwrap();
    let passes = Passes::measure(&gpu, &items, Bits::B63, 1).unwrap();
    let fit = [passes.domain, passes.codes, passes.sort, passes.tree, passes.boxes[0]];
    assert!(fit.iter().all(Option::is_some) && passes.total(Strategy::Aabb).is_some(), "{passes:?}");
    assert_eq!((&passes.boxes[1..], passes.total(Strategy::Combined)), (&[None; 4][..], None));
    match passes.refused {
        Some(GpuError::Limit { need: 60_000, most: 49_152, .. }) => {}
        other => panic!("{other:?}"),
    }
    // Where all fits nothing is refused.
    let few = Items::triangles(&gpu, [&corners[..500]]).unwrap();
    let passes = Passes::measure(&gpu, &few, Bits::B63, 1).unwrap();
    assert!(passes.refused.is_none() && passes.boxes.iter().all(Option::is_some), "{passes:?}");
}
