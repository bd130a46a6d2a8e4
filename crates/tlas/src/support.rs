//! Boxes around the images of a bottom-level BVH, smaller than those around the images of its box.

use std::sync::OnceLock;

use canted_obb::round::{down, up};
use canted_obb::vector::{reach, scale};
use canted_obb::{Aabb, Affine};
use canted_trace::Intersect;

/// Steps along an edge of the cube of directions, from its middle to its end.
const STEPS: usize = 2;

/// Points along an edge of the cube.
const SIDE: usize = 2 * STEPS + 1;

/// More than what roundings of `f64` add, relative to the greatest terms.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// How far what can be hit reaches along some directions, which lie on the surface of a cube in a grid.
///
/// The support of a direction, the greatest product with a point, is a sublinear function of the direction: for `d = Σ w·d_i`
/// with weights that are not negative it is at most the same sum of the supports of the `d_i`. Every direction is such a sum of the corners of a
/// triangle of the grid, and these are so close that the sum exceeds the support of a ball by 3 %.
#[derive(Clone, Debug)]
pub(crate) struct Supports {
    /// By x, y, z of the grid; only those of its surface are used.
    values: [f64; SIDE * SIDE * SIDE],
    /// The greatest of all.
    greatest: f64,
}

impl Supports {
    /// `None` where the BVH knows none.
    pub(crate) fn of<B: Intersect>(blas: &B) -> Option<Self> {
        let mut values = [0.0; SIDE * SIDE * SIDE];
        let mut greatest = 0.0_f64;
        for (i, value) in values.iter_mut().enumerate() {
            let point = [i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE].map(|x| x as f64 - STEPS as f64);
            if reach(point) == STEPS as f64 {
                *value = blas.support(point)?;
                greatest = greatest.max(value.abs());
            }
        }
        Some(Self { values, greatest })
    }

    /// At least the support of `direction`.
    fn along(&self, direction: [f64; 3]) -> f64 {
        let size = reach(direction);
        if size == 0.0 {
            return 0.0;
        }
        // On the surface of the cube. Of an axis that is not on a side, the cell and where in it.
        let at = scale(direction, STEPS as f64 / size).map(|x| x + STEPS as f64);
        let longest = (0..3).find(|&k| direction[k].abs() == size).unwrap_or(0);
        let (a, b) = ((longest + 1) % 3, (longest + 2) % 3);
        let cell = |x: f64| (x as usize).min(SIDE - 2);
        let (in_a, in_b) = (cell(at[a]), cell(at[b]));
        let (part_a, part_b) = (at[a] - in_a as f64, at[b] - in_b as f64);
        let value = |of_a: usize, of_b: usize| {
            let mut place = [0; 3];
            place[longest] = if direction[longest] < 0.0 { 0 } else { SIDE - 1 };
            (place[a], place[b]) = (of_a, of_b);
            self.values[(place[0] * SIDE + place[1]) * SIDE + place[2]]
        };
        let (first, last) = (value(in_a, in_b), value(in_a + 1, in_b + 1));
        let sum = if part_a >= part_b {
            first + part_a * (value(in_a + 1, in_b) - first) + part_b * (last - value(in_a + 1, in_b))
        } else {
            first + part_b * (value(in_a, in_b + 1) - first) + part_a * (last - value(in_a, in_b + 1))
        };
        (sum + ROUNDINGS * self.greatest) * (size / STEPS as f64)
    }

    /// A box around the image of what can be hit.
    pub(crate) fn image(&self, map: &Affine) -> Aabb {
        let mut aabb = Aabb::EMPTY;
        for k in 0..3 {
            let row = [0, 1, 2].map(|j| f64::from(map.columns[j][k]));
            let shift = f64::from(map.columns[3][k]);
            let error = ROUNDINGS * shift.abs();
            aabb.min[k] = down(shift - (self.along(scale(row, -1.0)) + error));
            aabb.max[k] = up(shift + (self.along(row) + error));
        }
        aabb
    }
}

/// The supports of a BVH that knows them, from the first request on.
pub(crate) type KnownSupports = OnceLock<Option<Box<Supports>>>;

/// Whether the map takes axes to axes: then no box around an image is smaller than that of the box.
pub(crate) fn keeps_axes(map: &Affine) -> bool {
    (0..3).all(|k| (0..3).filter(|&j| map.columns[j][k] != 0.0).count() <= 1)
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::vector::to_f64;
    use canted_wide::TriangleBvh;

    use super::*;

    /// The box around the images of all vertices, and its size for a ball: 6 % is more than what the triangles of directions add.
    #[test]
    fn boxes_are_around_all_images_and_not_much_larger() {
        let mut rng = SplitMix64::new(9);
        for center in [[0.0; 3], [1e3, -2e3, 5e2]] {
            let at = |p: [f64; 3]| std::array::from_fn::<f32, 3, _>(|k| (p[k] + center[k]) as f32);
            let positions: Vec<[f32; 3]> = (0..3000).map(|_| at(rng.on_sphere())).collect();
            let triangles: Vec<[u32; 3]> = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let supports = Supports::of(&TriangleBvh::build(&positions, &triangles).unwrap()).unwrap();
            for _ in 0..200 {
                let columns = [(); 4].map(|()| rng.signed3().map(|x| x as f32));
                let map = Affine { columns };
                let Aabb { min, max } = supports.image(&map);
                for k in 0..3 {
                    let images = positions.iter().map(|&p| map.point_f64(to_f64(p))[k]);
                    let (least, most) = images.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
                    assert!(f64::from(min[k]) <= least && most <= f64::from(max[k]), "{map:?} {k}");
                    let extent = f64::from(max[k]) - f64::from(min[k]);
                    assert!(extent <= 1.06 * (most - least) + 1e-3, "{map:?} {k}: {extent}, {}", most - least);
                }
            }
        }
    }

    /// The support of a box is linear between the axes, so nothing is added: its eight corners.
    #[test]
    fn images_of_boxes_are_exact() {
        let ends: [[f32; 3]; 2] = [[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]];
        let corners: Vec<[f32; 3]> = (0..8).map(|i| [0, 1, 2].map(|k| ends[i >> k & 1][k])).collect();
        let triangles: Vec<[u32; 3]> = (0..6).map(|i| [i, i + 1, i + 2]).collect();
        let supports = Supports::of(&TriangleBvh::build(&corners, &triangles).unwrap()).unwrap();
        let map = Affine { columns: [[0.5, 0.25, -0.5], [1.0, -0.5, 0.125], [-0.25, 2.0, 0.0], [7.0, 8.0, 9.0]] };
        let Aabb { min, max } = supports.image(&map);
        for k in 0..3 {
            let half: f32 = (0..3).map(|j| map.columns[j][k].abs() * [1.0, 2.0, 3.0][j]).sum();
            let (lo, hi) = (map.columns[3][k] - half, map.columns[3][k] + half);
            assert!((min[k] - lo).abs() < 1e-5 && (max[k] - hi).abs() < 1e-5, "{k}: {min:?} {max:?}");
        }
    }

    #[test]
    fn maps_that_keep_axes_are_known() {
        assert!(keeps_axes(&Affine::IDENTITY) && keeps_axes(&Affine::scale([1.0, -2.0, 0.0])));
        let turned = Affine { columns: [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [3.0; 3]] };
        assert!(keeps_axes(&turned) && !keeps_axes(&Affine::rotation([0.0, 0.0, 1.0], 0.3)));
    }
}
