//! Builds on devices with too little memory. The package of tests compares whole builds with the CPU.

use crate::common::lowered;
use canted_gpu::{
    GpuError,
    build::{Items, Passes},
};
use canted_lbvh::{Bits, Corners, Strategy};

#[test]
fn stages_that_fit_are_timed_when_others_do_not_fit() {
    let Some(gpu) = lowered("stages_that_fit_are_timed_when_others_do_not_fit", 48 << 10) else { return };
    // Per triangle, 36 bytes of vertices and 24 of an axis-aligned box fit; 60 of an oriented box do not.
    let triangle = |i: u16| {
        let x = f32::from(i);
        [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, f32::from(i % 7)]]
    };
    let corners: Vec<Corners> = (0..1000).map(triangle).collect();
    let items = Items::triangles(&gpu, [&corners[..]]).unwrap();
    let passes = Passes::measure(&gpu, &items, Bits::B63, 1).unwrap();
    let fit = [passes.domain, passes.codes, passes.sort, passes.tree, passes.boxes[0]];
    assert!(fit.iter().all(Option::is_some) && passes.total(Strategy::Aabb).is_some(), "{passes:?}");
    assert_eq!((&passes.boxes[1..], passes.total(Strategy::Combined)), (&[None; 5][..], None));
    match passes.error {
        Some(GpuError::Limit { need: 60_000, most: 49_152, .. }) => {}
        other => panic!("{other:?}"),
    }
    // A build that fits reports no error.
    let few = Items::triangles(&gpu, [&corners[..500]]).unwrap();
    let passes = Passes::measure(&gpu, &few, Bits::B63, 1).unwrap();
    assert!(passes.error.is_none() && passes.boxes.iter().all(Option::is_some), "{passes:?}");
}
