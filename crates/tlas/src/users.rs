//! Which instances a bottom-level BVH has.

use canted_trace::InstanceId;

use crate::placement::Placement;

/// The instances of each BVH, as chains through all of them, so that a change of one takes constant time.
///
/// Made by the first change of a BVH, in linear time: 8 bytes an instance, which scenes whose BVHs do not change save.
#[derive(Clone, Debug)]
pub(crate) struct Users {
    /// The first instance of each BVH.
    first: Vec<u32>,
    /// Of each instance the one before it and the one after it.
    links: Vec<[u32; 2]>,
}

/// The end of a chain.
const NONE: u32 = u32::MAX;

impl Users {
    pub(crate) fn new(n_blas: usize, placements: &[Placement]) -> Self {
        let mut users = Self { first: vec![NONE; n_blas], links: vec![] };
        (0..).zip(placements).for_each(|(instance, placement)| users.add(instance, placement.blas));
        users
    }

    /// The instances of a BVH, in ascending order.
    pub(crate) fn of(&self, blas: u32) -> Vec<InstanceId> {
        let mut at = self.first.get(blas as usize).copied().unwrap_or(NONE);
        let mut all = vec![];
        while at != NONE {
            all.push(InstanceId(at));
            at = self.links[at as usize][1];
        }
        all.sort_unstable();
        all
    }

    /// An instance gets another BVH; a removed one has none.
    pub(crate) fn change(&mut self, instance: u32, from: u32, to: u32) {
        if from != to {
            self.take(instance, from);
            self.add(instance, to);
        }
    }

    fn add(&mut self, instance: u32, blas: u32) {
        let i = instance as usize;
        if self.links.len() <= i {
            self.links.resize(i + 1, [NONE; 2]);
        }
        let Some(first) = self.first.get_mut(blas as usize) else { return };
        let after = std::mem::replace(first, instance);
        self.links[i] = [NONE, after];
        if after != NONE {
            self.links[after as usize][0] = instance;
        }
    }

    fn take(&mut self, instance: u32, blas: u32) {
        let Some(first) = self.first.get_mut(blas as usize) else { return };
        let [before, after] = std::mem::replace(&mut self.links[instance as usize], [NONE; 2]);
        match before {
            NONE => *first = after,
            before => self.links[before as usize][1] = after,
        }
        if after != NONE {
            self.links[after as usize][0] = before;
        }
    }

    pub(crate) fn n_bytes(&self) -> usize {
        size_of_val(&self.first[..]) + size_of_val(&self.links[..])
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::Affine;

    use super::*;
    use crate::Instance;
    use crate::placement::Placed;

    #[test]
    fn chains_are_those_of_a_search_after_any_changes() {
        let mut rng = SplitMix64::new(46);
        let of = |blas: u32| Placed::hidden(&Instance::new(blas, Affine::IDENTITY)).placement;
        let mut all: Vec<Placement> = (0..50).map(|_| of(rng.below(5) as u32)).collect();
        let mut users = Users::new(5, &all);
        for round in 0..2000 {
            // One of no BVH is removed.
            let to = [0, 1, 2, 3, 4, Instance::REMOVED.blas][rng.below(6)];
            let i = rng.below(all.len() + usize::from(all.len() < 80));
            if i == all.len() {
                all.push(of(Instance::REMOVED.blas));
            }
            users.change(i as u32, all[i].blas, to);
            all[i].blas = to;
            for blas in 0..6 {
                let want = (0..).zip(&all).filter(|(_, placement)| placement.blas == blas).map(|(i, _)| InstanceId(i));
                assert_eq!(users.of(blas), want.collect::<Vec<_>>(), "round {round}, BVH {blas}");
            }
        }
        assert!(all.len() == 80 && users.n_bytes() == 5 * 4 + 80 * 8, "{} instances", all.len());
    }
}
