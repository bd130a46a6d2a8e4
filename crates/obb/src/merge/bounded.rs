use super::{Child, enclose};
use crate::vector::{self, cross, sub};
use crate::{Moments, Obb};

/// Weights of the corners in [`bounded`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Weight {
    /// Every corner the same, as in the sources: a tiny box weighs as much as a large sibling.
    Corners,
    /// By the surface area of the child, both sides for a triangle; [`Weight::Corners`] where neither has an area.
    #[default]
    Area,
}

/// Remaining correlation between axes: no more than rounding the frame to `f32` leaves, so a box merged with itself
/// keeps its axes.
const TOLERANCE: f64 = f32::EPSILON as f64;

/// Box along the principal axes of the corners of both children, 16, 11 or 6 points (Ericson 2004; Sabino 2020, 3.5,
/// variant 2).
///
/// The scatter of the corners of a box has a closed form, so no corners are computed.
#[must_use]
pub fn bounded(a: &Child, b: &Child, weight: Weight) -> Obb {
    let areas = match weight {
        Weight::Area => [surface(a), surface(b)],
        Weight::Corners => [0.0; 2],
    };
    let [a_moments, b_moments] = if areas[0] + areas[1] > 0.0 {
        [moments(a, areas[0]), moments(b, areas[1])]
    } else {
        [moments(a, n_corners(a)), moments(b, n_corners(b))]
    };
    enclose(a_moments.merged(&b_moments).axes(TOLERANCE), [a, b])
}

fn n_corners(child: &Child) -> f64 {
    match child {
        Child::Box(_) => 8.0,
        Child::Triangle(_) => 3.0,
    }
}

/// Surface area in square scene units.
fn surface(child: &Child) -> f64 {
    match child {
        Child::Box(child) => child.area(),
        Child::Triangle(corners) => {
            let [a, b, c] = corners.map(vector::to_f64);
            vector::length(cross(sub(b, a), sub(c, a)))
        }
    }
}

/// Moments of the corners of a child, with a total of `weight`.
fn moments(child: &Child, weight: f64) -> Moments {
    match child {
        Child::Box(child) => Moments::from_box_corners(child, weight),
        Child::Triangle(corners) => {
            let corners = Moments::from_points(*corners);
            let each = weight / corners.weight;
            Moments { weight, mean: corners.mean, scatter: corners.scatter.map(|x| x * each) }
        }
    }
}
