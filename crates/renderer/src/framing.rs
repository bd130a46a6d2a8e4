//! A camera for a scene that brings none.
//!
//! ```text
//! rays from inside points -> a room? -> one open side -> from outside, in through it
//!                                    -> closed        -> from where one sees farthest and most
//!                         -> an object                -> from outside, from the direction (1, 0.6, 0.8)
//! ```
//!
//! A room is told from an object by what one sees from inside its box: in a room front faces nearly everywhere, in a
//! closed object back faces, around an open one much sky.

mod exterior;
mod interior;

use canted_obb::{Aabb, PrimId};
use canted_scene::{Camera, Scene};
use canted_trace::{Hit, InstanceId, Ray, Side};

use crate::Tracer;
use crate::vector::{Vector, length, narrow};

use exterior::fit;
use interior::{is_room, open_side, view};

/// The direction from which objects are seen.
const THREE_QUARTERS: Vector = [1.0, 0.6, 0.8];

/// Chooses a camera for `scene`, for a picture whose width is `aspect` times its height. Up is +y.
///
/// Objects are seen from the direction (1, 0.6, 0.8), as large as the picture allows; a room with one open side is
/// seen from outside through it; a closed room from inside, at two fifths of its height, where one sees farthest and most.
/// Depends on the scene alone, not on the tracer's structure.
#[must_use]
pub fn frame<T: Tracer>(scene: &Scene, tracer: &T, aspect: f64) -> Camera {
    let bounds = scene.bounds_world();
    let probe = Probe { tracer, bounds };
    if !is_room(&probe) {
        return fit(scene, bounds.center(), THREE_QUARTERS, aspect);
    }
    match open_side(&probe) {
        Some(side) => fit(scene, bounds.center(), side, aspect),
        None => view(&probe, aspect),
    }
}

/// What can be seen inside the box of a scene.
struct Probe<'a, T> {
    tracer: &'a T,
    bounds: Aabb,
}

/// What a ray meets first.
enum Visible {
    /// The front of a triangle.
    Front {
        /// World units away.
        distance: f64,
        /// The triangle that was met.
        triangle: (InstanceId, PrimId),
    },
    /// The back of a surface.
    Back,
    /// Nothing.
    Sky,
}

impl<T: Tracer> Probe<'_, T> {
    /// The point of the box at relative coordinates in 0..=1.
    fn place(&self, relative: Vector) -> Vector {
        let (center, extent) = (self.bounds.center(), self.bounds.extent());
        std::array::from_fn(|k| center[k] + (relative[k] - 0.5) * extent[k])
    }

    fn look(&self, from: Vector, direction: Vector) -> Visible {
        match self.tracer.closest_hit(&Ray::new(narrow(from), narrow(direction)), &mut ()) {
            None => Visible::Sky,
            Some(Hit { side: Side::Back, .. }) => Visible::Back,
            Some(hit) => Visible::Front {
                distance: f64::from(hit.t) * length(direction),
                triangle: (hit.instance, hit.primitive),
            },
        }
    }
}

/// Point `i` of an endless even spread over the unit cube: steps by the powers of one irrational number, after Roberts
/// 2018, *The Unreasonable Effectiveness of Quasirandom Sequences*.
fn spread(i: u32) -> Vector {
    /// The root of x⁴ = x + 1 above 1.
    const ROOT: f64 = 1.220_744_084_605_759_5;
    std::array::from_fn(|k| {
        let step = (0..=k).fold(1.0, |step, _| step / ROOT);
        (0.5 + f64::from(i) * step).fract()
    })
}
