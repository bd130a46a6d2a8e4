//! Automatic choice of a camera.
//!
//! ```text
//! rays from points inside -> interior? -> one open side -> from outside, through that side
//!                                      -> closed        -> from the point and direction with the best view
//!                         -> object                     -> from outside, from direction (1, 0.6, 0.8)
//! ```
//!
//! From points inside its bounding box, an interior shows front faces nearly everywhere. A closed object shows back
//! faces, and an open one shows mostly the background. A pipe or a vessel shows front faces inside and outside, and is an object.

mod exterior;
mod interior;
mod turn;

use canted_obb::{Aabb, PrimId};
use canted_scene::{Camera, Scene};
use canted_trace::{Hit, InstanceId, Ray, Side};

use crate::Tracer;
use crate::vector::{Vector, length, narrow};

use exterior::fit;
use interior::{is_closed_object, is_interior, open_side, view};
use turn::Turn;

/// The direction from which objects are viewed.
const THREE_QUARTERS: Vector = [1.0, 0.6, 0.8];

/// Chooses a camera for `scene` and an image whose width is `aspect` times its height, with +y up; see [`frame_up`].
#[must_use]
pub fn frame<T: Tracer>(scene: &Scene, tracer: &T, aspect: f64) -> Camera {
    frame_up(scene, tracer, aspect, [0.0, 1.0, 0.0])
}

/// Chooses a camera for `scene` and an image whose width is `aspect` times its height. `up` is the scene's up direction, in
/// world space; a direction without length counts as +y.
///
/// Objects are viewed from direction (1, 0.6, 0.8), as large as the image allows; interiors with one open side from
/// outside, through it; closed interiors from inside, at two fifths of their height, from the point and direction with
/// the best view. Directions are those of a scene with +y up. The result does not depend on the acceleration structure.
#[must_use]
pub fn frame_up<T: Tracer>(scene: &Scene, tracer: &T, aspect: f64, up: [f32; 3]) -> Camera {
    let turn = Turn::of_up(up);
    let bounds = turn.bounds(scene);
    let probe = Probe { tracer, bounds, turn };
    let framed = if is_interior(&probe) && !(is_plain(scene) && is_closed_object(&probe)) {
        match open_side(&probe) {
            Some(side) => fit(scene, turn, bounds.center(), side, aspect),
            None => view(&probe, aspect),
        }
    } else {
        fit(scene, turn, bounds.center(), THREE_QUARTERS, aspect)
    };
    turn.camera(&framed)
}

/// Whether a scene has few materials, as a pipe or a vessel has; buildings, whose walls may have fronts on both sides, have many.
fn is_plain(scene: &Scene) -> bool {
    const MAX_PARTS: usize = 4;
    scene.meshes.iter().map(|mesh| mesh.parts.len()).sum::<usize>() <= MAX_PARTS
}

/// Casts rays in the bounding box of a scene whose up direction was turned to +y.
struct Probe<'a, T> {
    tracer: &'a T,
    bounds: Aabb,
    turn: Turn,
}

/// The closest hit of a ray.
enum RayResult {
    /// The front of a triangle.
    Front {
        /// Distance in world units.
        distance: f64,
        /// The triangle.
        triangle: (InstanceId, PrimId),
    },
    /// The back of a triangle.
    Back,
    /// No hit.
    Miss,
}

impl<T: Tracer> Probe<'_, T> {
    /// The point at relative coordinates in 0..=1.
    fn point_at(&self, relative: Vector) -> Vector {
        let (center, extent) = (self.bounds.center(), self.bounds.extent());
        std::array::from_fn(|k| center[k] + (relative[k] - 0.5) * extent[k])
    }

    fn cast(&self, from: Vector, direction: Vector) -> RayResult {
        let [from, towards] = [from, direction].map(|v| narrow(self.turn.to_world(v)));
        match self.tracer.closest_hit(&Ray::new(from, towards), &mut ()) {
            None => RayResult::Miss,
            Some(Hit { side: Side::Back, .. }) => RayResult::Back,
            Some(hit) => RayResult::Front {
                distance: f64::from(hit.t) * length(direction),
                triangle: (hit.instance, hit.primitive),
            },
        }
    }
}

/// Point `i` of a low-discrepancy sequence in the unit cube, the R₃ sequence of Roberts 2018, *The Unreasonable
/// Effectiveness of Quasirandom Sequences*.
fn quasirandom(i: u32) -> Vector {
    /// The root of x⁴ = x + 1 above 1.
    const ROOT: f64 = 1.220_744_084_605_759_5;
    std::array::from_fn(|k| {
        let step = (0..=k).fold(1.0, |step, _| step / ROOT);
        (0.5 + f64::from(i) * step).fract()
    })
}
