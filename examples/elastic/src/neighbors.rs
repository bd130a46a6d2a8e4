//! Which phyxels act on which.

use glam::{DMat3, DVec3};

use crate::grid::{Grid, distance_squared};

/// A radius of action in units of the mean distance to the nearest phyxels: in a cubic lattice it reaches the 26 around.
const SUPPORT: f64 = 1.9;

/// Nearest phyxels whose mean distance is the local spacing: as many as a cubic lattice has at its spacing.
const N_NEAREST: usize = 6;

/// Largest condition number of a moment matrix. The gradients then keep 32 of the 52 bits of `f64`.
const MAX_CONDITION: f64 = (1 << 20) as f64;

/// One phyxel in the radius of action of another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// The phyxel acted on.
    pub(crate) to: u32,
    /// From the acting phyxel to it, at rest.
    pub(crate) offset: DVec3,
    /// The displacement gradient of the acting phyxel is the sum of `(u[to] - u[from]) * gradient^T` over its links.
    pub(crate) gradient: DVec3,
    /// Kernel weight, divided by the sum of `weight * |offset|²` over the links of the acting phyxel; 1/m².
    pub(crate) weight: f64,
}

/// Weight of a phyxel at a distance, in a radius of action: the kernel of Müller et al., without its constant factor, which cancels.
pub(crate) fn kernel(distance_squared: f64, radius: f64) -> f64 {
    let inside = (1.0 - distance_squared / (radius * radius)).max(0.0);
    inside * inside * inside
}

/// Positions as `f64`.
pub(crate) fn vector(point: [f32; 3]) -> DVec3 {
    DVec3::from(point.map(f64::from))
}

/// `a * b^T`.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The radius of action of each phyxel: larger where phyxels are sparse.
pub(crate) fn radii_of_action(points: &[[f32; 3]]) -> Vec<f64> {
    let mut radii = vec![0.0; points.len()];
    let mut pending: Vec<usize> = (0..points.len()).collect();
    let Some(first) = points.first() else { return radii };
    let farthest = points.iter().map(|&point| distance_squared(*first, point)).fold(0.0, f64::max).sqrt();
    // All pairs are closer than twice that. A first guess is the spacing of a cube of as many points.
    #[expect(clippy::cast_precision_loss, reason = "a guess")]
    let mut radius = 2.0 * farthest / (points.len() as f64).cbrt();
    while !pending.is_empty() {
        let is_last = radius >= 2.0 * farthest;
        let grid = Grid::new(points, radius);
        pending.retain(|&i| {
            let near = grid.within(points[i], radius);
            if near.len() <= N_NEAREST && !is_last {
                return true;
            }
            let others = near.iter().filter(|&&j| j as usize != i);
            let mut distances: Vec<f64> =
                others.map(|&j| distance_squared(points[i], points[j as usize]).sqrt()).collect();
            distances.sort_unstable_by(f64::total_cmp);
            distances.truncate(N_NEAREST);
            #[expect(clippy::cast_precision_loss, reason = "at most 6")]
            let n = distances.len().max(1) as f64;
            radii[i] = SUPPORT * distances.iter().sum::<f64>() / n;
            false
        });
        radius *= 2.0;
    }
    radii
}

/// The links of all phyxels, or the first phyxel whose neighbors do not span space, with their number.
pub(crate) fn links(points: &[[f32; 3]], radii: &[f64]) -> Result<Vec<Vec<Link>>, (usize, usize)> {
    let grid = Grid::new(points, radii.iter().copied().fold(0.0, f64::max));
    points
        .iter()
        .zip(radii)
        .enumerate()
        .map(|(i, (&from, &radius))| of_phyxel(&grid, points, i, from, radius))
        .collect()
}

fn of_phyxel(
    grid: &Grid,
    points: &[[f32; 3]],
    i: usize,
    from: [f32; 3],
    radius: f64,
) -> Result<Vec<Link>, (usize, usize)> {
    let mut links = Vec::new();
    let (mut moments, mut sum) = (DMat3::ZERO, 0.0);
    for to in grid.within(from, radius) {
        let offset = vector(points[to as usize]) - vector(from);
        let weight = kernel(offset.length_squared(), radius);
        if to as usize == i || weight == 0.0 {
            continue;
        }
        moments += outer(weight * offset, offset);
        sum += weight * offset.length_squared();
        links.push(Link { to, offset, gradient: weight * offset, weight });
    }
    // Dimensionless, of trace 1. The greatest eigenvalue is at most 1; the product of the two greatest is at most 1/4,
    // so that the least one is at least 4 times the determinant.
    let shape = moments * (1.0 / sum);
    let is_spanning = sum.is_normal() && 4.0 * shape.determinant() >= 1.0 / MAX_CONDITION;
    if !is_spanning {
        return Err((i, links.len()));
    }
    let inverse = shape.inverse();
    for link in &mut links {
        link.gradient = inverse * (link.gradient / sum);
        link.weight /= sum;
    }
    Ok(links)
}
