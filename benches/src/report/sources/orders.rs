//! The scenes of the sources, and whether our values have the same order as theirs.

use anyhow::Result;

use crate::{
    models::{self, Model},
    report::model::{Chapter, Effort},
};

/// Scenes of the dissertation, or a small lattice for tests.
pub(super) fn scenes(
    effort: Effort,
    names: &[&'static str],
    chapter: &mut Chapter,
) -> Result<Vec<(&'static str, Model)>> {
    let names = if effort == Effort::Tiny { &[models::SMALL] } else { names };
    let mut scenes = vec![];
    for &name in names {
        match models::load(name)? {
            Some(model) => scenes.push((name, model)),
            None => {
                let lacking = format!("{name}: the model is not available.");
                if !chapter.skipped.contains(&lacking) {
                    chapter.skipped.push(lacking);
                }
            }
        }
    }
    if scenes.is_empty() {
        // Generated, so always available.
        scenes.extend(models::load("truss")?.map(|model| ("truss", model)));
    }
    Ok(scenes)
}

/// The findings of a part of the chapter.
#[derive(Default)]
pub(super) struct Found {
    /// A sentence; may be empty.
    pub(super) says: String,
    /// Lists of compared items: the source's value and ours.
    pub(super) compared: Vec<Vec<[f64; 2]>>,
}

impl From<String> for Found {
    fn from(says: String) -> Self {
        Self { says, ..Self::default() }
    }
}

/// Numbers of ordered pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pairs {
    /// In the same order in theirs and ours.
    pub(super) n_same: usize,
    /// Ordered in theirs.
    pub(super) n_all: usize,
}

impl Pairs {
    /// All pairs of every list whose values differ in the source.
    pub(super) fn of(compared: &[Vec<[f64; 2]>]) -> Self {
        let mut pairs = Self::default();
        for list in compared {
            for (i, a) in list.iter().enumerate() {
                for b in list[..i].iter().filter(|b| b[0] != a[0]) {
                    pairs.n_all += 1;
                    pairs.n_same += usize::from((a[0] < b[0]) == (a[1] < b[1]) && a[1] != b[1]);
                }
            }
        }
        pairs
    }

    pub(super) fn and(self, other: Self) -> Self {
        Self { n_same: self.n_same + other.n_same, n_all: self.n_all + other.n_all }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reversed_pairs_are_not_the_same() {
        // The last two are swapped, and the first two are equal in the source: five pairs remain, one of them reversed.
        let list = vec![[1.0, 9.0], [1.0, 8.0], [2.0, 30.0], [3.0, 20.0]];
        assert_eq!(Pairs::of(std::slice::from_ref(&list)), Pairs { n_same: 4, n_all: 5 });
        // Equal values here have no order.
        assert_eq!(Pairs::of(&[vec![[1.0, 5.0], [2.0, 5.0]], list]), Pairs { n_same: 4, n_all: 6 });
    }
}
