use super::{Child, enclose};
use crate::vector::{self, cross, sub};
use crate::{Moments, Obb};

/// How much a child's corners weigh in [`bounded`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Weight {
    /// Every corner the same, as in the sources: a speck weighs like the box beside it.
    Corners,
    /// By the child's surface area, a triangle's counted on both sides; corners where neither child has any.
    #[default]
    Area,
}

/// Correlation left between axes: what rounding the frame to `f32` leaves anyway, so a box merged with itself keeps its
/// axes.
const TOLERANCE: f64 = f32::EPSILON as f64;

/// Box along the principal axes of the children's corners: sixteen, eight and three, or six (Ericson 2004; Sabino
/// 2020, 3.5, variant 2).
///
/// The scatter of a box's corners has a closed form, so no corner is ever made.
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

/// Moments of a child's corners, together of the given weight.
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
