//! The boxes around all instances, kept up to date as single instances change: unions of 16 instances, unions of 16 of these, and so on.

use canted_obb::Aabb;
use canted_trace::ReferencePoint;

use crate::placement::Bounds;

/// Instances, or boxes around some, in a box of the next level.
const BLOCK: usize = 16;

/// The box around some instances, and around them with what of the error of their hits does not depend on rays.
pub(crate) type Boxes = [Aabb; 2];

/// See the module. The last level has one box, or none without instances.
#[derive(Clone, Debug)]
pub(crate) struct Around {
    levels: Vec<Vec<Boxes>>,
}

/// Of all instances.
pub(crate) fn around(bounds: &[Bounds]) -> Boxes {
    joined(bounds.iter().map(boxes_of))
}

fn boxes_of(bounds: &Bounds) -> Boxes {
    match bounds.is_empty() {
        true => [Aabb::EMPTY; 2],
        false => [bounds.aabb, bounds.grown(ReferencePoint::ORIGIN)],
    }
}

fn joined(all: impl Iterator<Item = Boxes>) -> Boxes {
    all.fold([Aabb::EMPTY; 2], |[a, b], [c, d]| [a.union(c), b.union(d)])
}

impl Around {
    pub(crate) fn new(bounds: &[Bounds]) -> Self {
        let mut levels = vec![bounds.chunks(BLOCK).map(around).collect::<Vec<_>>()];
        while let Some(below) = levels.last().filter(|below| below.len() > 1) {
            levels.push(below.chunks(BLOCK).map(|chunk| joined(chunk.iter().copied())).collect());
        }
        Self { levels }
    }

    /// The instance `i` had these bounds and has changed, or was added after all others with empty ones. Of several that have changed, this is called for one
    /// after another.
    pub(crate) fn update(&mut self, mut i: usize, old: &Bounds, bounds: &[Bounds]) {
        let (mut old, mut new) = (boxes_of(old), boxes_of(&bounds[i]));
        for level in 0.. {
            let block = i / BLOCK;
            if level == self.levels.len() {
                self.levels.push(vec![]);
            }
            let (below, above) = self.levels.split_at_mut(level);
            let of = |n: usize| block * BLOCK..n.min((block + 1) * BLOCK);
            let all = || match below.last() {
                None => around(&bounds[of(bounds.len())]),
                Some(below) => joined(below[of(below.len())].iter().copied()),
            };
            let of_level = &mut above[0];
            (old, new) = match of_level.get_mut(block) {
                Some(known) => {
                    let [a, b] = [0, 1].map(|k| known[k].after_change(&old[k], &new[k]));
                    let boxes = a.zip(b).map_or_else(all, |(a, b)| [a, b]);
                    (std::mem::replace(known, boxes), boxes)
                }
                None => {
                    of_level.push(all());
                    ([Aabb::EMPTY; 2], of_level[block])
                }
            };
            if of_level.len() == 1 || old == new {
                return;
            }
            i = block;
        }
    }

    /// Of all instances.
    pub(crate) fn all(&self) -> Boxes {
        self.levels.last().and_then(|level| level.first()).copied().unwrap_or([Aabb::EMPTY; 2])
    }

    pub(crate) fn n_bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(&level[..])).sum()
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    fn random(rng: &mut SplitMix64) -> Bounds {
        let min = rng.signed3().map(|x| x as f32);
        let aabb = Aabb { min, max: min.map(|x| x + 0.5) };
        if rng.below(4) == 0 { Bounds::EMPTY } else { Bounds { aabb, ..Bounds::EMPTY } }
    }

    #[test]
    fn boxes_are_those_around_all() {
        let mut rng = SplitMix64::new(4);
        for first in [0, 1, 16, 17, 300] {
            let mut bounds: Vec<Bounds> = (0..first).map(|_| random(&mut rng)).collect();
            let mut kept = Around::new(&bounds);
            assert_eq!(kept.all(), around(&bounds), "{first}");
            for step in 0..600 {
                let i = if step % 3 == 0 || bounds.is_empty() { bounds.len() } else { rng.below(bounds.len()) };
                let new = random(&mut rng);
                if i == bounds.len() {
                    bounds.push(Bounds::EMPTY);
                }
                let old = std::mem::replace(&mut bounds[i], new);
                kept.update(i, &old, &bounds);
                assert_eq!(kept.all(), around(&bounds), "{first}, {step}");
            }
        }
    }
}
