//! Bugs reported to other libraries, by number of the thread: our results and those of the libraries.
//!
//! Inputs follow the text of the reports; attached files are replaced by the shape that the report describes.

mod embree;
mod tinybvh;

use canted_fixtures::{Mesh, displaced_icosphere};
use canted_obb::Affine;
use canted_trace::Ray;

use super::{Oracle, Promise, Row};
use crate::{
    closed::{Closed, rays},
    tracers::{Guarantee, Method},
};

/// A bug report and its rows.
pub struct Tracker {
    /// Library and number; also the name of the test.
    pub name: &'static str,
    /// The rows of each tracer on the report's input.
    pub rows: fn(&[Method]) -> Vec<Row>,
}

/// All reports.
pub const TRACKERS: [Tracker; 9] = [
    Tracker { name: "embree_174", rows: embree::embree_174 },
    Tracker { name: "embree_181", rows: embree::embree_181 },
    Tracker { name: "embree_188", rows: embree::embree_188 },
    Tracker { name: "embree_387", rows: embree::embree_387 },
    Tracker { name: "tinybvh_277", rows: tinybvh::tinybvh_277 },
    Tracker { name: "tinybvh_282", rows: tinybvh::tinybvh_282 },
    Tracker { name: "tinybvh_283", rows: tinybvh::tinybvh_283 },
    Tracker { name: "tinybvh_286", rows: tinybvh::tinybvh_286 },
    Tracker { name: "parry_444", rows: parry_444 },
];

/// One row for each tracer: rays, and failed rays.
fn each<'a>(
    promise: Promise,
    methods: impl IntoIterator<Item = &'a Method>,
    failed: impl Fn(&Method) -> (usize, usize),
) -> Vec<Row> {
    let row = |method: &Method| {
        let ((n, n_failed), n_cut) = method.with_cuts(|| failed(method));
        Row { is_peer: method.guarantee == Guarantee::Peer, n_cut, ..promise.count_certain(&method.name, n, n_failed) }
    };
    methods.into_iter().map(row).collect()
}

/// Number of rays, and of rays that miss or are not occluded.
fn slipped(method: &Method, mesh: &Mesh, rays: &[Ray]) -> (usize, usize) {
    let tracer = method.of(mesh);
    let (hits, occluded) = (tracer.closest(rays), tracer.occluded(rays));
    (rays.len(), hits.iter().zip(occluded).filter(|(hit, occluded)| hit.is_none() || !occluded).count())
}

fn ball(mesh: Mesh) -> Closed {
    Closed { name: "sphere", mesh, inner_point: [0.0; 3], clearance: [0.4; 3], is_simple: true }
}

#[expect(clippy::cast_possible_truncation, reason = "rays are rounded like everything")]
fn rounded(x: [f64; 3]) -> [f32; 3] {
    x.map(|x| x as f32)
}

/// A closed scan has holes one pixel large.
fn parry_444(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "parry #444",
        "a closed displaced mesh of 5,120 triangles, from outside, at its edges",
        "no ray leaks in",
        Oracle::Known,
        "rays",
    );
    let ball = ball(displaced_icosphere(3, 4));
    let from_outside: Vec<Ray> =
        rays(&ball.mesh, &ball, &Affine::IDENTITY, 8_000, 444).into_iter().skip(1).step_by(2).collect();
    each(PROMISE, methods, |method| slipped(method, &ball.mesh, &from_outside))
}
