//! Whether things stand here in the order in which a source prints them.

/// What a part of the chapter found.
#[derive(Default)]
pub(super) struct Found {
    /// What it shows; empty where it says nothing by itself.
    pub(super) says: String,
    /// Lists of things that the source compares by number: its number and ours of each.
    pub(super) compared: Vec<Vec<[f64; 2]>>,
}

impl From<String> for Found {
    fn from(says: String) -> Self {
        Self { says, ..Self::default() }
    }
}

/// How many pairs of things stand in one order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pairs {
    /// In theirs and ours alike.
    pub(super) n_same: usize,
    /// In theirs.
    pub(super) n_all: usize,
}

impl Pairs {
    /// Of every list each pair to which the source gives different numbers.
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
    fn pairs_that_turn_round_are_not_the_same() {
        // The last two change places, and the first two are equal in the source: five pairs are left, of which one is turned.
        let list = vec![[1.0, 9.0], [1.0, 8.0], [2.0, 30.0], [3.0, 20.0]];
        assert_eq!(Pairs::of(std::slice::from_ref(&list)), Pairs { n_same: 4, n_all: 5 });
        // What is equal here is in no order.
        assert_eq!(Pairs::of(&[vec![[1.0, 5.0], [2.0, 5.0]], list]), Pairs { n_same: 4, n_all: 6 });
    }
}
