use crate::{
    partition::halve,
    reference::{Bounds, Reference},
};

/// Halves the references by count on the axis whose halves have the least area, the first of equals.
pub(crate) fn part(references: &mut [Reference], axes: &[usize]) -> usize {
    let mut best = (f32::INFINITY, axes[0]);
    if let [_, _, ..] = axes {
        for &axis in axes {
            let n_left = halve(references, axis);
            let (left, right) = references.split_at(n_left);
            let cost = half_area(left) + half_area(right);
            if cost < best.0 {
                best = (cost, axis);
            }
        }
    }
    halve(references, best.1)
}

fn half_area(references: &[Reference]) -> f32 {
    references.iter().fold(Bounds::EMPTY, |all, r| all.union(r.bounds())).half_area()
}
