//! Groups equal warnings: one line per kind, with the first location and the number of further ones.

use super::text::printable;

/// Grouped warnings in order of first occurrence.
#[derive(Default)]
pub(crate) struct WarningGroups {
    list: Vec<WarningGroup>,
}

struct WarningGroup {
    what: String,
    first: String,
    n_more: usize,
}

impl WarningGroups {
    /// Adds the warning `what` at `location`.
    pub(crate) fn add(&mut self, what: &str, location: &str) {
        match self.list.iter_mut().find(|group| group.what == what) {
            Some(group) => group.n_more += 1,
            None => self.list.push(WarningGroup { what: what.to_owned(), first: location.to_owned(), n_more: 0 }),
        }
    }

    /// As [`WarningGroups::add`], unless `what` was added before.
    pub(crate) fn add_once(&mut self, what: &str, location: &str) {
        if self.list.iter().all(|group| group.what != what) {
            self.add(what, location);
        }
    }

    /// Appends one line per kind.
    pub(crate) fn finish(self, warnings: &mut Vec<String>) {
        warnings.extend(self.list.into_iter().map(|WarningGroup { what, first, n_more }| match n_more {
            0 => printable(&format!("{what}: {first}")).into_owned(),
            _ => printable(&format!("{what}: {first} and {n_more} more")).into_owned(),
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_equal_warnings() {
        let mut groups = WarningGroups::default();
        for (what, location) in [("ignoring b", "node 1"), ("ignoring a", "node 2"), ("ignoring b", "node 3")] {
            groups.add(what, location);
        }
        groups.add_once("ignoring b", "the file");
        let mut warnings = Vec::new();
        groups.finish(&mut warnings);
        assert_eq!(warnings, ["ignoring b: node 1 and 1 more", "ignoring a: node 2"]);
    }
}
