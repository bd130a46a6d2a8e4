//! Holes and speckle of a picture.
//!
//! A *gap* is a pixel whose central ray misses everything while those of its eight neighbors hit something: a hole of a surface, or a slit of a
//! model. It is *lost* if a loop over all triangles finds a hit for the ray: then it is an error of the BVH. A *bright* pixel has more than
//! [`FACTOR`] times the luminance of the brightest of its eight neighbors, a *dark* one less than the darkest over [`FACTOR`].

use std::fmt;

use anyhow::Result;
use canted_film::{Film, srgb};
use canted_renderer::{SceneBvh, View, flatten};
use canted_scene::Scene;
use canted_tests::brute;
use canted_trace::{Intersect, Ray, Watertight};
use rayon::prelude::*;

/// How far a pixel of speckle is from all of its neighbors.
pub(crate) const FACTOR: f64 = 4.0;

/// Counts of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Blemishes {
    pub(crate) gaps: usize,
    pub(crate) lost: usize,
    pub(crate) bright: usize,
    pub(crate) dark: usize,
}

impl Blemishes {
    /// Those of a picture of a scene, seen by `view`.
    pub(crate) fn of(film: &Film, scene: &Scene, bvh: &SceneBvh, view: &View) -> Result<Self> {
        let size = [film.width() as usize, film.height() as usize];
        let luminances: Vec<f64> = film.pixels().iter().map(|pixel| srgb::luminance(pixel.mean())).collect();
        let [bright, dark] = speckle(size, &luminances);
        let ray = |i: usize| view.ray([i % size[0], i / size[0]].map(|x| x as f64 + 0.5));
        let is_hit: Vec<bool> =
            (0..size[0] * size[1]).into_par_iter().map(|i| bvh.closest_hit(&ray(i)).is_some()).collect();
        let gaps = gaps(size, &is_hit);
        let lost = if gaps.is_empty() { 0 } else { n_hits_of_loop(scene, gaps.iter().map(|&i| ray(i)))? };
        Ok(Self { gaps: gaps.len(), lost, bright, dark })
    }
}

impl fmt::Display for Blemishes {
    /// In this order: gaps, of which lost; bright, dark.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { gaps, lost, bright, dark } = self;
        write!(f, "{gaps}, of which {lost} lost; {bright} bright, {dark} dark")
    }
}

/// How many of the rays hit one of the triangles, by a loop over them.
fn n_hits_of_loop(scene: &Scene, rays: impl Iterator<Item = Ray>) -> Result<usize> {
    let (positions, triangles, _) = flatten(scene)?;
    let records = brute::records::<Watertight>(&positions, &triangles);
    let rays: Vec<Ray> = rays.collect();
    Ok(rays.par_iter().filter(|ray| brute::closest_hit::<Watertight>(&records, ray).is_some()).count())
}

/// The pixels that are no border pixels, each with its eight neighbors.
fn inner([width, height]: [usize; 2]) -> impl Iterator<Item = (usize, [usize; 8])> {
    let columns = move |y: usize| (1..width.saturating_sub(1)).map(move |x| y * width + x);
    let of = move |i: usize| {
        let [above, below] = [i - width, i + width];
        (i, [above - 1, above, above + 1, i - 1, i + 1, below - 1, below, below + 1])
    };
    (1..height.saturating_sub(1)).flat_map(columns).map(of)
}

/// The pixels that are not hit, but all of their neighbors are.
fn gaps(size: [usize; 2], is_hit: &[bool]) -> Vec<usize> {
    inner(size).filter(|&(i, around)| !is_hit[i] && around.iter().all(|&j| is_hit[j])).map(|(i, _)| i).collect()
}

/// How many pixels are much brighter, and much darker, than all of their neighbors.
fn speckle(size: [usize; 2], luminances: &[f64]) -> [usize; 2] {
    let mut counts = [0; 2];
    for (i, around) in inner(size) {
        let around = around.map(|j| luminances[j]);
        let least = around.into_iter().fold(f64::INFINITY, f64::min);
        let greatest = around.into_iter().fold(0.0, f64::max);
        counts[0] += usize::from(luminances[i] > FACTOR * greatest);
        counts[1] += usize::from(FACTOR * luminances[i] < least);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five by four pixels with this value, and others at some of them.
    fn picture<T: Copy>(value: T, others: &[(usize, T)]) -> Vec<T> {
        let mut all = vec![value; 20];
        others.iter().for_each(|&(i, other)| all[i] = other);
        all
    }

    #[test]
    fn a_pixel_is_a_gap_if_its_neighbors_are_hit() {
        for (misses, expected) in [
            (&[6][..], &[6][..]),
            (&[6, 8], &[6, 8]),
            // Two next to each other, one at the border, and none.
            (&[6, 12], &[]),
            (&[5, 19], &[]),
            (&[], &[]),
        ] {
            let is_hit = picture(true, &misses.iter().map(|&i| (i, false)).collect::<Vec<_>>());
            assert_eq!(gaps([5, 4], &is_hit), expected, "{misses:?}");
        }
        assert!(gaps([1, 1], &[false]).is_empty());
    }

    #[test]
    fn speckle_differs_from_all_neighbors() {
        for (others, expected) in [
            (&[(6, 4.1), (13, 0.24)][..], [1, 1]),
            (&[(6, 3.9), (13, 0.26)], [0, 0]),
            // An edge of two pixels, and one at the border, are no speckle.
            (&[(6, 9.0), (7, 9.0), (4, 9.0)], [0, 0]),
        ] {
            assert_eq!(speckle([5, 4], &picture(1.0, others)), expected, "{others:?}");
        }
    }
}
